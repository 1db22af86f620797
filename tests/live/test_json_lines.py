# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines of JSON: what they say, several clients, and a slow one that delays nobody."""

import json
import socket
import time
from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.errors import OutputError
from scope.scope_addon.live import json_lines
from scope.scope_addon.live.json_lines import JsonServer

from ..job.processes import wait_for
from .test_vmc import pose_of


@pytest.fixture
def server(body):
    with JsonServer(body, "127.0.0.1", 0) as serving:
        yield serving


def connected(server, count):
    clients = [
        socket.create_connection(("127.0.0.1", server.port), timeout=300) for _ in range(count)
    ]
    files = [client.makefile("rb") for client in clients]
    return clients, files


def test_every_client_gets_the_description_and_then_poses(server, body):
    clients, files = connected(server, 2)
    for file in files:
        description = json.loads(file.readline())
        assert description["joints"] == list(body.joint_names)
        assert description["parents"] == list(body.parents)
    server.send(pose_of(body), 12.34)
    for client, file in zip(clients, files, strict=True):
        pose = json.loads(file.readline())
        assert (pose["frame"], pose["presence"], pose["latency_ms"]) == (3, "seen", 12.3)
        assert pose["positions"][0] == [0.0, 0.0, 0.95]
        assert np.allclose(np.linalg.norm(pose["rotations"], axis=1), 1, atol=1e-4)
        file.close()
        client.close()


def test_a_client_gets_a_line_of_each_person(body):
    with JsonServer(body, "127.0.0.1", 0, people=4) as serving:
        clients, files = connected(serving, 1)
        files[0].readline()
        for person in range(4):
            serving.send(replace(pose_of(body), person=person), 0.0)
        assert [json.loads(files[0].readline())["person"] for _ in range(4)] == [0, 1, 2, 3]
        files[0].close()
        clients[0].close()


def test_a_client_that_reads_nothing_neither_delays_nor_grows_and_others_get_the_newest(
    server, body
):
    (slow, quick), files = connected(server, 2)
    files[0].close()
    files[1].readline()
    for _ in range(500):  # far more than the system's buffers hold
        server.send(pose_of(body), 0.0)
    assert all(len(client._lines) <= 2 for client in server._clients)
    assert json.loads(files[1].readline())["frame"] == 3
    files[1].close()
    slow.close()
    quick.close()


def numbered(body, number):
    return replace(pose_of(body), index=number)


def test_the_end_gives_clients_what_is_queued(body, monkeypatch):
    monkeypatch.setattr(json_lines, "_CLOSING_S", 300)  # this computer may be busy
    for first in range(0, 8, 2):
        with JsonServer(body, "127.0.0.1", 0) as serving:
            (client,), (file,) = connected(serving, 1)
            file.readline()
            serving.send(numbered(body, first), 0.0)
            serving.send(numbered(body, first + 1), 0.0)
        assert [json.loads(text)["frame"] for text in file] == [first, first + 1]
        file.close()
        client.close()


def fill(serving, body):
    """Send until nothing more fits into the system's buffers: the queue then stays full for
    thirty sends.
    """
    full = 0
    for _ in range(20_000):  # far more than the buffers hold
        serving.send(numbered(body, 1), 0.0)
        time.sleep(0.004)  # the client's thread takes what it can send
        full = full + 1 if len(serving._clients[0]._lines) == 2 else 0
        if full > 30:
            return
    raise AssertionError("the queue was never full for thirty sends")


def test_the_end_does_not_wait_for_a_client_that_does_not_read(body, monkeypatch):
    monkeypatch.setattr(json_lines, "_SEND_TIMEOUT_S", 10_000)
    with JsonServer(body, "127.0.0.1", 0) as serving:
        (stuck, other), files = connected(serving, 2)
        files[0].readline()
        fill(serving, body)
        (client, _) = serving._clients
    client._thread.join(300)  # its connection is closed, too
    assert client.is_gone
    for each in (*files, stuck, other):
        each.close()


def test_clients_that_left_are_forgotten(server, body):
    (client,), (file,) = connected(server, 1)
    file.readline()
    wait_for(lambda: len(server._clients) == 1)
    file.close()
    client.close()
    wait_for(lambda: server.send(pose_of(body), 0.0) or not server._clients)


def test_an_address_of_another_computer_is_said(body):
    with pytest.raises(OutputError, match=r"cannot listen on 192\.0\.2\.1"):
        JsonServer(body, "192.0.2.1", 0)
