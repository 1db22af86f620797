# SPDX-License-Identifier: GPL-3.0-or-later
"""Find the packages of the wheel by rule, and its version in the extension's manifest; everything
else about the distribution is in pyproject.toml.

The root folder is the package `scope`, and setuptools' own search cannot put a prefix before the
names it finds. Editable installations map the whole folder, so that `scope.benchmarks` and
`scope.tools` are importable in these.
"""

import tomllib
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

MANIFEST = Path(__file__).with_name("blender_manifest.toml")
PRODUCT = ["solver", "solver.*", "scope_addon", "scope_addon.*"]


class BuildProduct(build_py):
    """Copies the packages, without this file, which lies in the folder of the root package."""

    def find_package_modules(self, package, package_dir):
        """Return (package, module, file) of every module of a package."""
        return [
            found
            for found in super().find_package_modules(package, package_dir)
            if found[1] != "setup"
        ]


setup(
    # Blender needs the version written out in the manifest; a test compares it with the citations.
    version=tomllib.loads(MANIFEST.read_text(encoding="utf-8"))["version"],
    packages=["scope", *(f"scope.{name}" for name in find_packages(".", include=PRODUCT))],
    cmdclass={"build_py": BuildProduct},
)
