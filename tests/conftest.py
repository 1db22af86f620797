# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures shared by all tests."""

from __future__ import annotations

import gc
import importlib.util
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from .required import missing

if TYPE_CHECKING:
    from scope.solver.body import Body

ROOT = Path(__file__).resolve().parent.parent
SHARED = ROOT.parent / "shared"


def make_importable() -> None:
    """Let tests, and the processes that they start, import a checkout that is not installed."""
    folder = ROOT / "build" / "types"
    link = folder / "scope"
    if not link.exists():
        folder.mkdir(parents=True, exist_ok=True)
        link.symlink_to(ROOT, target_is_directory=True)
    sys.path.insert(0, str(folder))
    os.environ["PYTHONPATH"] = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])


if importlib.util.find_spec("scope") is None:
    make_importable()
importlib.import_module("scope.scope_addon")  # It keeps the machine code of what tests compile.

# Blender reads this once, when bpy is first imported: tests must not write in the home folder.
# Processes that this one starts use the same folder, and leave it.
OWN_BLENDER_FOLDER = None
if "BLENDER_USER_RESOURCES" not in os.environ:
    OWN_BLENDER_FOLDER = tempfile.mkdtemp(prefix="scope-tests-blender-")
    os.environ["BLENDER_USER_RESOURCES"] = OWN_BLENDER_FOLDER

# Tests that use onnxruntime itself, not through Scope, do not report to its makers either.
os.environ["ORT_DISABLE_TELEMETRY"] = "1"


def pytest_collection_finish() -> None:
    """Search for garbage less often, and never in what the collection made, which saves time."""
    gc.freeze()
    gc.set_threshold(10_000, 20, 20)


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of real clips and motion data next to the checkout.

    It is not public: a CI that cannot have it sets ``SCOPE_WITHOUT_SHARED``, and the tests on real
    clips are skipped.
    """
    if os.environ.get("SCOPE_WITHOUT_SHARED") or not (SHARED / "data").is_dir():
        missing(
            f"the tests on real clips need {SHARED / 'data'}", allowed_by="SCOPE_WITHOUT_SHARED"
        )
    return SHARED


@pytest.fixture(scope="session")
def blender_module() -> None:
    """Require Blender's module, which a CI that cannot have it says with
    ``SCOPE_WITHOUT_BLENDER``.
    """
    if importlib.util.find_spec("bpy") is None:
        missing(
            "bpy is not installed, which writes scenes: pip install bpy",
            allowed_by="SCOPE_WITHOUT_BLENDER",
        )


@pytest.fixture(scope="session")
def networks() -> Path:
    """The folder of the built pose networks."""
    from scope.scope_addon.capture.perception.sessions import NETWORKS_FOLDER
    from scope.tools.convert_networks.catalogue import NETWORKS

    absent = [
        network.name
        for network in NETWORKS
        if not (NETWORKS_FOLDER / f"{network.name}.onnx").is_file()
    ]
    if absent:
        missing(
            f"{NETWORKS_FOLDER} lacks {', '.join(absent)}; python -m "
            "scope.tools.convert_networks builds them"
        )
    return NETWORKS_FOLDER


@pytest.fixture(scope="session", autouse=True)
def sessions_are_opened_once() -> Iterator[None]:
    """Keep the sessions on Scope's own networks: they have no state, and a capture opens four.

    They have one thread each: more would wait for each other while other tests need the cores.
    """
    if importlib.util.find_spec("onnxruntime") is None:  # as where only the solver is tested
        yield
        return
    from scope.scope_addon.capture.perception import sessions

    open_on = sessions._open_on
    keep = cache(open_on)

    def opened(name: str, path: Path, threads: int) -> object:
        return (
            keep(name, path, 1)
            if path.parent == sessions.NETWORKS_FOLDER
            else open_on(name, path, threads)
        )

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sessions, "_open_on", opened)
        yield


@pytest.fixture(scope="session", autouse=True)
def nothing_waits_for_the_disk() -> Iterator[None]:
    """Take for synced what this process writes. Tests that cut the power do so in processes of
    their own, see ``tests/fuzz/test_kills.py``.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", os.fstat)  # which refuses the same handles
        yield


@pytest.fixture(autouse=True)
def usual_priority() -> Iterator[None]:
    """Give the main thread its priority back. Where root encodes AV1, SVT-AV1 leaves its caller
    with a real-time priority, and all other processes wait for it and its children.
    """
    yield
    if sys.platform == "linux" and os.sched_getscheduler(0) != os.SCHED_OTHER:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


@pytest.fixture(scope="session")
def body() -> Body:
    """The built-in body without fingers."""
    from scope.solver.body_file import load_body

    return load_body("scope")


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """Leave without Blender's exit handlers, which can wait forever for a thread of their own (see
    ``cli.run``).
    """
    if OWN_BLENDER_FOLDER is not None:
        shutil.rmtree(OWN_BLENDER_FOLDER, ignore_errors=True)
    if "bpy" in sys.modules:
        sys.stdout.flush()
        sys.stderr.flush()
        from scope.scope_addon.command_line.blender_module import discard_temporary

        discard_temporary()
        os._exit(int(config.stash.get(EXIT_STATUS, 1)))


EXIT_STATUS = pytest.StashKey[int]()


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Remember the status for ``pytest_unconfigure``, which is not told."""
    session.config.stash[EXIT_STATUS] = int(exitstatus)
