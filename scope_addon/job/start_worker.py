# SPDX-License-Identifier: GPL-3.0-or-later
"""The script that a worker process runs, in Blender's Python, isolated (``-I``) and without
Blender.

    python -I start_worker.py ROOT JOB_FOLDER SEARCH_PATH...      one line on stdin: the request

Inside Blender the extension is the package ``bl_ext.<repository>.scope``, whose parent exists only
there; this script loads the extension's root folder as the package ``scope``. Isolated Python
ignores PYTHONPATH, so that the folders of numpy and of the extension's wheels are passed as
arguments.
"""

import importlib.util
import os
import sys
from collections.abc import Sequence
from pathlib import Path


def worker_command(
    python: Sequence[str],
    root: Path,
    job_folder: Path,
    kernels: Path | None,
    script: Path = Path(__file__),
) -> tuple[list[str], dict[str, str]]:
    """Return the parent's command line for a worker, and the environment variables.

    :param kernels: folder for the code that the solver compiles; if None, next to the sources.
    """
    # An empty entry means the current folder, which isolated Python omits on purpose.
    search_path = [p for p in sys.path if p and os.path.exists(p)]
    environment = dict(os.environ, **({"NUMBA_CACHE_DIR": str(kernels)} if kernels else {}))
    return [*python, str(script), str(root), str(job_folder), *search_path], environment


def load_package(root: Path) -> None:
    """Load the extension's root folder as the package ``scope``."""
    spec = importlib.util.spec_from_file_location(
        "scope", root / "__init__.py", submodule_search_locations=[str(root)]
    )
    assert spec is not None
    assert spec.loader is not None
    package = importlib.util.module_from_spec(spec)
    sys.modules["scope"] = package
    spec.loader.exec_module(package)


if __name__ == "__main__":
    root, job_folder, *search_path = sys.argv[1:]
    # The parent's order is kept: the extension's wheels precede other installed packages. The
    # script's own folder is removed, because its modules would shadow others.
    own = str(Path(__file__).resolve().parent)
    sys.path[:] = search_path + [p for p in sys.path if p not in search_path and p != own]
    load_package(Path(root))
    from scope.scope_addon.job.worker import main

    main(Path(job_folder))
