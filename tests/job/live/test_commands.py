# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands arrive in any pieces; nothing else is one."""

import pytest
from scope.scope_addon.job.live.commands import RECORD, STOP, Commands


@pytest.mark.parametrize("size", [1, 3, 100])
def test_commands_arrive_in_any_pieces(size):
    commands = Commands()
    sent = b"nonsense\n" + RECORD + STOP
    for at in range(0, len(sent), size):
        assert not commands.stopped.is_set()
        commands.receive(sent[at : at + size])
    assert commands.recording.is_set()
    assert commands.stopped.is_set()


def test_what_is_no_command_does_nothing_and_is_not_kept():
    commands = Commands()
    for piece in (b"stop", b" now\n", b"\xff\x00", b"record" * 10_000):
        commands.receive(piece)
    assert not commands.recording.is_set()
    assert not commands.stopped.is_set()
    assert len(commands._unfinished) < 10_000
