# SPDX-License-Identifier: GPL-3.0-or-later
"""The background process after enabling: once for an installation, ended with the extension or by a
capture.
"""

import sys
from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import pytest
from scope.scope_addon.job import process as job_process
from scope.scope_addon.machine_code.kernel_count import kernel_count
from scope.scope_addon.ui import warm_up
from scope.scope_addon.ui.preferences import cache

from ..job.processes import wait_for


@pytest.fixture
def process(tmp_path, monkeypatch):
    """Replace what the process runs."""

    worker_command = job_process.worker_command

    def use(code):
        monkeypatch.setattr(
            job_process,
            "worker_command",
            lambda python, root, folder, *rest: (
                ([sys.executable, "-c", code], None)
                if folder.name.startswith("warm-up")
                else worker_command(python, root, folder, *rest)
            ),
        )

    yield use
    warm_up.stop()


def wait_for_end():
    wait_for(lambda: not warm_up.step())


def test_it_runs_once_for_an_installation(process, tmp_path):
    process(
        f"import sys; open({str(tmp_path / 'said')!r}, 'a').write(sys.stdin.readline()); "
        'print(\'{"event": "result"}\')'
    )
    for _ in range(3):
        wait_for_end()
    assert (tmp_path / "said").read_text("utf-8") == '{"warm_up": true}\n'
    assert cache().clear() == 0
    wait_for_end()
    assert (tmp_path / "said").read_text("utf-8").count("\n") == 1


def test_progress_is_shown_only_while_something_is_compiled(process):
    earlier = (
        cache().kernels / "solver-01234567-0123456789ab" / "optimizer.optimize-0123456789ab.code"
    )
    earlier.parent.mkdir(parents=True)
    earlier.touch()
    layout = MagicMock()
    process("import time; time.sleep(600)")
    warm_up.draw(layout)
    warm_up.step()
    warm_up.draw(layout)
    layout.progress.assert_not_called()
    for n in range(kernel_count() // 2):
        earlier.with_name(f"{n}.code").touch()
    warm_up.draw(layout)
    shown = layout.progress.call_args.kwargs
    assert shown["factor"] == pytest.approx(0.5, abs=0.01)
    assert shown["text"] == f"Compiling the solver: {100 * shown['factor']:.0f} %"
    warm_up.stop()
    warm_up.draw(layout)
    layout.progress.assert_called_once()


def test_after_a_failure_it_runs_again(process, tmp_path):
    process(
        f"import sys; open({str(tmp_path / 'said')!r}, 'a').write(sys.stdin.readline()); "
        "sys.exit(1)"
    )
    for _ in range(2):
        wait_for_end()
    assert (tmp_path / "said").read_text("utf-8").count("\n") == 2


def test_it_ends_with_the_extension(process):
    process("import time; time.sleep(600)")
    assert warm_up.step() is not None
    running = warm_up.WarmUp.worker
    assert running.alive
    warm_up.detach()
    assert not running.alive


def test_a_capture_ends_it_for_good(process, fake_worker, footage):
    process("import time; time.sleep(600)")
    fake_worker("finish()")
    assert warm_up.step() is not None
    running = warm_up.WarmUp.worker
    bpy.app.timers.register(warm_up.step, first_interval=100.0)  # as attach() does
    bpy.context.scene.scope.footage = str(footage)
    assert bpy.ops.scope.capture() == {"FINISHED"}
    assert not running.alive
    # which would begin again, beside the capture
    assert not bpy.app.timers.is_registered(warm_up.step)


def test_without_a_window_it_does_not_begin():
    assert not bpy.app.timers.is_registered(warm_up.step)


def test_it_begins_also_if_a_file_is_opened_at_once(monkeypatch):
    window = SimpleNamespace(app=SimpleNamespace(background=False, timers=bpy.app.timers))
    monkeypatch.setattr(warm_up, "bpy", window)
    monkeypatch.setattr(warm_up, "preferences", object)
    warm_up.attach()
    try:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        assert bpy.app.timers.is_registered(warm_up.step)
    finally:
        warm_up.detach()
