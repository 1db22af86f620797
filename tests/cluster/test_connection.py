# SPDX-License-Identifier: GPL-3.0-or-later
"""The address of a scheduler: what is none, and what does not answer, is told in a sentence."""

import json
import socket

import pytest
from scope.scope_addon.errors import ClusterError, UsageError
from scope.solver.errors import InputError

from ..required import package


@pytest.fixture(scope="module")
def connection():
    """The module, without whose import, which takes a while, every process of a run collects this
    file.
    """
    package("distributed")
    from scope.scope_addon.cluster import workers

    return workers


@pytest.mark.parametrize(
    "text", ["", "localhost:8786", "http://host:8786", "tcp://", "nowhere.json"]
)
def test_what_is_no_address_and_no_file_is_refused(connection, text):
    with pytest.raises(UsageError, match="--scheduler must be an address"):
        connection.connect(text)


@pytest.mark.parametrize("content", ["[]", "{}", '{"address": "inproc://a"}'])
def test_a_file_that_is_no_scheduler_file_is_refused(connection, tmp_path, content):
    (tmp_path / "scheduler.json").write_text(content)
    with pytest.raises(InputError, match=r"scheduler\.json is not a scheduler file"):
        connection.connect(str(tmp_path / "scheduler.json"))


def test_a_scheduler_that_does_not_answer_is_a_sentence(connection, tmp_path, monkeypatch):
    monkeypatch.setattr(connection, "_TIMEOUT_S", 0.2)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    file = tmp_path / "scheduler.json"
    file.write_text(json.dumps({"address": address}))
    with pytest.raises(ClusterError, match="cannot be reached") as caught:
        connection.connect(str(file))
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)
