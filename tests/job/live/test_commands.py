# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands arrive in any pieces; nothing else is one.

The request of a live capture as one line, told from that of other footage.
"""

import pytest
from scope.scope_addon.errors import UsageError
from scope.scope_addon.job.request import RECORD, STOP, WARM_UP, Commands, JobRequest, LiveRequest


@pytest.mark.parametrize("size", [1, 100])
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


def test_a_request_is_sent_as_one_line():
    request = LiveRequest("a\nb.mp4", online=True, heights_m=(1.8,), calibration="lens.json")
    text = request.to_json()
    assert "\n" not in text
    assert LiveRequest.is_in(text)
    read = LiveRequest.from_json(text)
    assert (read.source, read.online, read.values) == (request.source, True, request.values)
    assert read.values["live_quality"] == "fast"


def test_other_requests_are_none():
    for text in (WARM_UP, JobRequest("live").to_json(), "", "[]"):
        assert not LiveRequest.is_in(text)


@pytest.mark.parametrize(
    "text",
    ['{"live": 3}', '{"live": "0", "online": 1}', '{"live": "0", "threads": "x"}', "[" * 100_000],
)
def test_an_invalid_request_is_an_error(text):
    with pytest.raises(UsageError):
        LiveRequest.from_json(text)
