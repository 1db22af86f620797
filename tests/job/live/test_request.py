# SPDX-License-Identifier: GPL-3.0-or-later
"""The request of a live capture as one line, told from that of other footage."""

import pytest
from scope.scope_addon.errors import UsageError
from scope.scope_addon.job.live.request import LiveRequest
from scope.scope_addon.job.request import WARM_UP, JobRequest


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
    [
        '{"live": 3}',
        '{"live": "0", "online": 1}',
        '{"live": "0", "vmc": "1.2.3.4:5"}',
        '{"live": "0", "threads": "x"}',
    ]
    + ['{"live": "0"', "[]", "", "[" * 100_000],
)
def test_an_invalid_request_is_an_error(text):
    with pytest.raises(UsageError):
        LiveRequest.from_json(text)
