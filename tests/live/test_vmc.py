# SPDX-License-Identifier: GPL-3.0-or-later
"""The VMC protocol, read back by a parser written from the OSC 1.0 specification, and its axes by
hand.
"""

import socket
import struct
from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.errors import OutputError, UsageError
from scope.scope_addon.live.pose import LivePose, Presence
from scope.scope_addon.live.vmc import (
    BONES,
    LARGEST_DATAGRAM,
    VmcSender,
    parse_address,
)
from scope.solver import rotations

R_WORLD_MODEL = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


def padded_string(data, at):
    """Read an OSC string, which is filled with zeros to a multiple of four bytes; return it and
    where it ends.
    """
    end = data.index(b"\0", at)
    return data[at:end].decode("ascii"), at + (end - at) // 4 * 4 + 4


def parsed(data):
    """Return address and arguments of every message of a packet."""
    assert len(data) % 4 == 0
    if data.startswith(b"#bundle\0"):
        found = []
        at = 16
        assert struct.unpack_from(">Q", data, 8)[0] == 1  # immediately
        while at < len(data):
            (size,) = struct.unpack_from(">i", data, at)
            found += parsed(data[at + 4 : at + 4 + size])
            at += 4 + size
        assert at == len(data)
        return found
    address, at = padded_string(data, 0)
    tags, at = padded_string(data, at)
    assert tags[0] == ","
    values = []
    for tag in tags[1:]:
        if tag == "s":
            value, at = padded_string(data, at)
        else:
            (value,) = struct.unpack_from({"i": ">i", "f": ">f"}[tag], data, at)
            at += 4
        values.append(value)
    assert at == len(data)
    return [(address, values)]


def pose_of(
    body, Omega=None, R_world_root=R_WORLD_MODEL, pelvis=(0.0, 0.0, 0.95), presence=Presence.SEEN
):
    """A pose in a camera whose axes are the world's."""
    R = np.tile(np.eye(3), (body.K + 1, 1, 1)) if Omega is None else Omega
    R[0] = R_world_root
    joints = np.zeros((body.K + 1, 3))
    joints[0] = pelvis
    root = np.array(pelvis)
    nothing = np.zeros(body.K + 1)
    return LivePose(
        3,
        0.5,
        presence,
        True,
        np.zeros(body.P),
        R,
        root,
        np.eye(4),
        joints,
        np.zeros(4),
        R,
        root,
        np.zeros((33, 3)),
        nothing,
    )


@pytest.fixture
def receiver():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiving:
        receiving.bind(("127.0.0.1", 0))
        receiving.settimeout(300)
        yield receiving


def received(receiver, body, pose):
    with VmcSender(body, *receiver.getsockname()) as sender:
        sender.send(pose, 0.0)
    messages = []
    while sum(address == "/VMC/Ext/Bone/Pos" for address, _ in messages) < len(BONES):
        data = receiver.recv(65536)
        assert len(data) <= LARGEST_DATAGRAM
        messages += parsed(data)
    return messages


def test_a_pose_is_read_back_from_the_bytes(receiver, body):
    messages = received(receiver, body, pose_of(body))
    assert messages[0] == ("/VMC/Ext/OK", [1, 3, 0, 1])
    assert messages[1] == ("/VMC/Ext/T", [0.5])
    assert messages[2] == ("/VMC/Ext/Root/Pos", ["root", 0, 0, 0, 0, 0, 0, 1])
    bones = {
        values[0]: values[1:] for address, values in messages if address == "/VMC/Ext/Bone/Pos"
    }
    assert len(bones) == 22
    # facing the camera, upright
    assert bones["Hips"] == pytest.approx([0, 0.95, 0, 0, 0, 0, 1], abs=1e-6)
    assert bones["LeftUpperArm"][3:] == pytest.approx([0, 0, 0, 1], abs=1e-6)
    # Unity's x axis points to the person's right
    assert bones["LeftUpperArm"][0] < 0 < bones["RightUpperArm"][0]


def test_each_receiver_gets_its_own_person(receiver, body):
    with VmcSender(body, *receiver.getsockname(), person=1) as sender:
        sender.send(replace(pose_of(body), timestamp_s=7.0), 0.0)
        sender.send(replace(pose_of(body), timestamp_s=8.0, person=1), 0.0)
        assert parsed(receiver.recv(65536))[1] == ("/VMC/Ext/T", [8.0])


def test_bones_turn_as_in_unity(receiver, body):
    Omega = np.tile(np.eye(3), (body.K + 1, 1, 1))
    # the left arm upwards
    Omega[body.joint_names.index("left_shoulder")] = rotations.exp(np.array([0, 0, np.pi / 2]))
    # the face to the floor
    Omega[body.joint_names.index("head")] = rotations.exp(np.array([np.pi / 2, 0, 0]))
    messages = received(receiver, body, pose_of(body, Omega))
    bones = {
        values[0]: values[4:] for address, values in messages if address == "/VMC/Ext/Bone/Pos"
    }
    half = np.sqrt(0.5)
    # A positive turn about z takes x to y, and −x, where Unity's left arm points, to −y: upwards is
    # negative.
    assert bones["LeftUpperArm"] == pytest.approx([0, 0, -half, half], abs=1e-6)
    assert bones["Head"] == pytest.approx([half, 0, 0, half], abs=1e-6)


def test_before_somebody_was_seen_no_bones_are_sent(body):
    sender = VmcSender(body, "127.0.0.1", 39539)
    with sender:
        messages = sender.messages(replace(pose_of(body, presence=Presence.LOST), is_known=False))
    assert [m.address for m in messages] == ["/VMC/Ext/OK", "/VMC/Ext/T"]
    assert list(messages[0].params) == [0, 3, 0, 0]


@pytest.mark.parametrize("text", ["host", ":1", "host:0", "host:65536", "host:x"])
def test_an_address_that_is_none_is_refused(text):
    with pytest.raises(UsageError, match="--vmc must be HOST:PORT"):
        parse_address(text)


def test_addresses():
    assert parse_address("127.0.0.1:39539") == ("127.0.0.1", 39539)
    assert parse_address("[::1]:39539") == ("::1", 39539)
    assert parse_address("host:65533", people=3) == ("host", 65533)
    with pytest.raises(UsageError, match="--vmc must be HOST:PORT"):
        parse_address("host:65534", people=3)  # no port is left for the last one


def test_an_unknown_host_is_named(body):
    with pytest.raises(OutputError, match="no such host.invalid is unknown"):
        VmcSender(body, "no such host.invalid", 39539)
