# SPDX-License-Identifier: GPL-3.0-or-later
"""Signals that end a command: what is raised, what is restored afterwards, and what is left
alone.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator

import pytest
from scope.scope_addon.command_line import signals

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no signals to send")


@pytest.fixture(autouse=True)
def as_in_a_terminal() -> Iterator[None]:
    """Where the tests run under nohup, SIGHUP is ignored; and no signal is left for other tests."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)
    signals.received.clear()


@pytest.mark.parametrize(
    "number", [signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGINT)]
)
def test_a_signal_interrupts_and_is_remembered(number: signal.Signals) -> None:
    with pytest.raises(KeyboardInterrupt), signals.stopped_by_signals():
        signal.raise_signal(number)
    assert signals.received == [number]


def test_handlers_are_those_of_before_afterwards() -> None:
    before = {number: signal.getsignal(number) for number in signals.stopping_signals()}
    with signals.stopped_by_signals():
        assert all(signal.getsignal(number) is not handler for number, handler in before.items())
    assert {number: signal.getsignal(number) for number in before} == before
    assert signals.received == []


def test_a_closed_terminal_that_is_to_be_ignored_stays_so() -> None:
    """As nohup asks for it."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert signal.SIGHUP not in signals.stopping_signals()
        with signals.stopped_by_signals():
            signal.raise_signal(signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)
    assert signal.SIGHUP in signals.stopping_signals()


def test_in_another_thread_nothing_is_changed() -> None:
    """Python allows handlers to be set in the main thread alone."""
    handlers: list[object] = []

    def run() -> None:
        with signals.stopped_by_signals():
            handlers.extend(signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM))

    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert handlers == before


def test_an_interrupt_says_what_has_been_written() -> None:
    with pytest.raises(KeyboardInterrupt, match="two of five"), signals.interrupted("two of five"):
        raise KeyboardInterrupt
    with pytest.raises(ValueError, match="other"), signals.interrupted("two of five"):
        raise ValueError("other")
