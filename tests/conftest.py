# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures shared by all tests."""

from __future__ import annotations

import gc
import importlib.util
import os
import shutil
import sys
import tempfile
from collections.abc import Generator, Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import scope.scope_addon  # noqa: F401 - keeps the machine code of what tests compile

from .required import missing

if TYPE_CHECKING:
    from scope.solver.body import Body

ROOT = Path(__file__).resolve().parent.parent
SHARED = ROOT.parent / "shared"
IS_SECOND = os.environ.get("PYTEST_XDIST_WORKER", "gw0")[-1] in "13579"

# Blender reads this once, when bpy is first imported: tests must not write in the home folder.
# Processes that this one starts use the same folder, and leave it.
OWN_BLENDER_FOLDER = None
if "BLENDER_USER_RESOURCES" not in os.environ:
    OWN_BLENDER_FOLDER = tempfile.mkdtemp(prefix="scope-tests-blender-")
    os.environ["BLENDER_USER_RESOURCES"] = OWN_BLENDER_FOLDER

# Tests that use onnxruntime itself, not through Scope, do not report to its makers either.
os.environ["ORT_DISABLE_TELEMETRY"] = "1"

# In this order, ahead of all others, so that two processes never compile the same. The first file
# compiles the solver, and the second a version of its own, whose process then takes the third,
# which needs none. When the first is done, the fourth compiles all other kernels of a capture, and
# the next six need none. A process is given another file when two tests are left of its own: the
# long ones of these files come first in them. The rig that Rigify generates is shared in the same
# way. Files that take long would otherwise end last, alone.
FIRST = (
    "solver/test_validation.py",
    "solver/residuals/test_registry.py",
    "capture/tracking/test_tracker.py",
    "job/test_warm_up.py",
    "tools/test_build_body.py",
    "capture/tracking/test_people.py",
    "fuzz/test_findings.py",
    "tools/test_convert_networks.py",
    "scene/rigs/test_rig_retarget.py",
    "scene/export/test_export.py",
    "tools/mocap/test_mocap_library.py",
    "capture/test_pipeline.py",
    "capture/test_pipeline_own_networks.py",
    "ui/capture/test_capture_job.py",
    "fuzz/test_kills.py",
    "fuzz/test_faults_outputs.py",
    "job/test_batch.py",
    "machine_code/test_code_cache.py",
    "test_cli.py",
    "scene/rigs/test_rig_export.py",
    "ui/test_compiled_solver.py",
    "ui/edit/test_edit_operators.py",
    "ui/pins/test_correction_operators.py",
    "cluster/test_runner.py",
    "scripts/test_build_extension.py",
    "ui/capture/test_capture_panel.py",
    "ui/pins/test_upright_operators.py",
    "capture/test_pipeline_moving_camera.py",
    "capture/camera/test_heading_drift.py",
    "capture/test_pipeline_visitor.py",
    "live/test_session.py",
)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Let every second process collect folders backwards.

    Pytest compiles each file of tests for itself, which takes seconds, and keeps the code: two
    processes compile a half each and find the other's.
    """
    report = yield
    if IS_SECOND and isinstance(collector, pytest.Directory):
        report.result.reverse()
    return report


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the files of `FIRST` first, and all others in one order in every process."""
    places = {ROOT / "tests" / name: place for place, name in enumerate(FIRST)}
    items.sort(key=lambda item: (places.get(item.path, len(places)), item.path))


def pytest_collection_finish() -> None:
    """Search for garbage less often, and never in what the collection made: it took a twentieth of
    the time.
    """
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
        from scope.scope_addon.command_line.blender_folder import discard_temporary

        discard_temporary()
        os._exit(int(config.stash.get(EXIT_STATUS, 1)))


EXIT_STATUS = pytest.StashKey[int]()


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Remember the status for ``pytest_unconfigure``, which is not told."""
    session.config.stash[EXIT_STATUS] = int(exitstatus)
