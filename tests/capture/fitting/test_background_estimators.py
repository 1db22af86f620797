# SPDX-License-Identifier: GPL-3.0-or-later
"""Waiting for the solver is reported while it is being compiled, and only then."""

import threading

import pytest
from scope.scope_addon.capture.camera.intrinsics import assumed_camera
from scope.scope_addon.capture.fitting import background_estimators
from scope.scope_addon.capture.fitting.background_estimators import BackgroundEstimators


class SlowBody:
    """Loads until told."""

    def __init__(self):
        self.may_end, self.is_ready = threading.Event(), False

    def load(self):
        assert self.may_end.wait(300)
        self.is_ready = True


@pytest.mark.parametrize("compiled", [0, 7])
def test_only_compiling_is_reported(monkeypatch, compiled):
    live, reported, asked = SlowBody(), [], []

    def count():
        asked.append(compiled)
        if len(asked) == 3:
            live.may_end.set()
        return compiled

    monkeypatch.setattr(background_estimators, "compiled_kernels", count)
    monkeypatch.setattr(background_estimators, "_POLLING_INTERVAL_S", 0.01)
    with BackgroundEstimators(assumed_camera(64, 48, 64.0), 64, 48, live, None) as background:
        background.wait_for_solver(reported.append)
    assert live.is_ready
    assert len(asked) >= 3
    assert reported == [compiled] * len(asked) * bool(compiled)


def test_a_cancel_while_compiling_is_passed_on(monkeypatch):
    live = SlowBody()
    monkeypatch.setattr(background_estimators, "compiled_kernels", lambda: 1)

    def cancel(_):
        live.may_end.set()
        raise KeyboardInterrupt

    with (
        pytest.raises(KeyboardInterrupt),
        BackgroundEstimators(assumed_camera(64, 48, 64.0), 64, 48, live, None) as background,
    ):
        background.wait_for_solver(cancel)
