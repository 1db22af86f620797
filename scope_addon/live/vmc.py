# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses in the VMC protocol, as OSC messages over UDP, for virtual production and avatar tools.

The receiver's axes are Unity's: left-handed, x right, y up, z forward. Body models face their z
axis with their left hand on the x axis, so that the two differ by the sign of x. A rotation's axis,
which is a pseudovector, then changes the signs of y and z:

    position (x, y, z) -> (−x, y, z)        quaternion (w, x, y, z) -> (w, x, −y, −z)

Rotations are relative to the parent bone, and zero in the T-pose, which is also the body's rest
pose. The root stays at the origin; the hips move over the floor.

Source: the VMC protocol's specification, "Performer -> Marionette", and Open Sound Control 1.0.
"""

from __future__ import annotations

import socket
from contextlib import suppress
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ...solver import Body
from ...solver.rotations import quaternion_from_matrix
from ..arrays import Float64Array, FloatArray
from ..errors import OutputError, UsageError
from ..kinematics.axes import R_WORLD_MODEL
from .pose import LivePose, Presence

if TYPE_CHECKING:
    from pythonosc.osc_message import OscMessage

# Unity's humanoid bones, and the joints that turn them, parents first.
BONES = {
    "Hips": "pelvis",
    "Spine": "spine1",
    "Chest": "spine2",
    "UpperChest": "spine3",
    "Neck": "neck",
    "Head": "head",
    **{
        f"{side}{bone}": f"{side.lower()}_{joint}"
        for side in ("Left", "Right")
        for bone, joint in (
            ("UpperLeg", "hip"),
            ("LowerLeg", "knee"),
            ("Foot", "ankle"),
            ("Toes", "foot"),
            ("Shoulder", "collar"),
            ("UpperArm", "shoulder"),
            ("LowerArm", "elbow"),
            ("Hand", "wrist"),
        )
    },
}
LARGEST_DATAGRAM = 1400  # bytes; larger ones are split on their way through a network
_CALIBRATING = 2
_CALIBRATED = 3
_IDENTITY = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def unity_position(position: FloatArray) -> Float64Array:
    """Convert positions (..., 3) in the world, z up, to Unity's axes."""
    model: Float64Array = position @ R_WORLD_MODEL  # the inverse rotation, of row vectors
    return model * [-1.0, 1.0, 1.0]


def unity_quaternion(R: FloatArray) -> Float64Array:
    """Convert rotations (..., 3, 3) in model axes to quaternions (..., 4) x, y, z, w in Unity's."""
    return quaternion_from_matrix(R)[..., [1, 2, 3, 0]] * [1.0, -1.0, -1.0, 1.0]


def parse_address(text: str, people: int = 1) -> tuple[str, int]:
    """Return host and port of ``HOST:PORT``.

    :param people: to each of whom a port belongs, from that one on.
    :raises UsageError: it is not of that form.
    """
    host, _, port = text.rpartition(":")
    if not host or not port.isdecimal() or not 0 < int(port) <= 65536 - people:
        raise UsageError(f"--vmc must be HOST:PORT, such as 127.0.0.1:39539, not {text!r}")
    return host.strip("[]"), int(port)


class VmcSender:
    """A context that sends poses to one receiver; UDP neither waits for it nor notices that it is
    missing.

    :param person: whose poses are sent; a receiver shows one person.
    :raises OutputError: the host is unknown.
    """

    def __init__(self, body: Body, host: str, port: int, person: int = 0) -> None:
        self._person = person
        try:
            family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        except (OSError, UnicodeError) as error:
            raise OutputError(
                f"{host} is unknown ({error}); give --vmc the receiver's name or address"
            ) from error
        self._body = body
        self._address = address
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._bones = {
            bone: body.joint_names.index(joint)
            for bone, joint in BONES.items()
            if joint in body.joint_names
        }

    def __enter__(self) -> VmcSender:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def send(self, pose: LivePose, latency_ms: float) -> None:
        """Send a pose of the person, in as many datagrams as it needs."""
        if pose.person != self._person:
            return
        for datagram in datagrams(self.messages(pose)):
            with suppress(OSError):  # nobody listens, or the network is busy
                self._socket.sendto(datagram, self._address)

    def messages(self, pose: LivePose) -> list[OscMessage]:
        """Return the messages of a pose; without bones before somebody was seen."""
        state = _CALIBRATED if pose.is_settled else _CALIBRATING
        is_tracked = int(pose.presence is not Presence.LOST)
        out = [_message("/VMC/Ext/OK", int(pose.is_known), state, 0, is_tracked)]
        out.append(_message("/VMC/Ext/T", float(pose.timestamp_s)))
        if not pose.is_known:
            return out
        out.append(_message("/VMC/Ext/Root/Pos", "root", *_IDENTITY))
        rotations = np.concatenate(
            [(R_WORLD_MODEL.T @ pose.R_world_root)[None], pose.rotations[1:]]
        )
        quaternions = unity_quaternion(rotations)
        rest = self._body.rest_joints(pose.betas) * [-1.0, 1.0, 1.0]
        for bone, joint in self._bones.items():
            parent = self._body.parents[joint]
            place = unity_position(pose.joints[0]) if parent < 0 else rest[joint] - rest[parent]
            out.append(
                _message("/VMC/Ext/Bone/Pos", bone, *map(float, (*place, *quaternions[joint])))
            )
        return out


def datagrams(messages: list[OscMessage]) -> list[bytes]:
    """Put messages, in their order, into as few bundles as do not exceed `LARGEST_DATAGRAM`."""
    from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder

    bundles = []
    size = LARGEST_DATAGRAM
    for message in messages:
        if size + message.size + 4 > LARGEST_DATAGRAM:
            bundles.append(OscBundleBuilder(IMMEDIATELY))
            size = 16  # of an empty bundle
        # it takes messages too, but its type says bundles alone
        bundles[-1].add_content(cast("Any", message))
        size += message.size + 4
    return [bundle.build().dgram for bundle in bundles]


def _message(address: str, *values: str | float | int) -> OscMessage:
    from pythonosc.osc_message_builder import OscMessageBuilder

    builder = OscMessageBuilder(address)
    for value in values:
        builder.add_arg(value)
    return builder.build()
