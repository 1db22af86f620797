# SPDX-License-Identifier: GPL-3.0-or-later
"""What reads files and messages of others: each a function that may raise nothing but ScopeError,
and valid inputs.
"""

from __future__ import annotations

import base64
import io
import json
import pickle
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scope.scope_addon.capture.camera.calibration import placed_cameras, read_calibration
from scope.scope_addon.capture.media.heif import read_layout
from scope.scope_addon.capture.media.quicktime import focal_35mm
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.edit.corrected_motion import (
    corrections_of,
    uncorrected,
    with_corrections,
)
from scope.scope_addon.edit.corrections import (
    Contact,
    DepthFlip,
    Exchange,
    FeetOnFloor,
    Interpolation,
    Pin,
    Upright,
)
from scope.scope_addon.exif import animation_length, read_exif
from scope.scope_addon.motion import Motion
from scope.scope_addon.retarget.bone_map import REQUIRED, load_bone_map
from scope.scope_addon.retarget.expression_map import load_expression_map
from scope.scope_addon.retarget.import_motions import import_motions
from scope.scope_addon.retarget.rig_source import rig_source
from scope.scope_addon.untrusted.body_file import load_body
from scope.scope_addon.untrusted.onnx_file import check_onnx_file

from ..capture.camera.test_calibration_tables import EXTRI, FREEMOCAP, INTRI
from ..capture.small_graphs import simcc
from ..made_motion import made_face, made_motion
from ..untrusted.conftest import dump_python2, make_tables
from . import own_targets as own

ASSETS = Path(__file__).resolve().parents[2] / "assets"


@dataclass(frozen=True)
class Target:
    """A reader of a file with one of ``suffixes``, and ``seeds``, which make valid inputs in a
    folder.
    """

    read: Callable[[Path], object]
    suffixes: tuple[str, ...]
    seeds: Callable[[Path], list[bytes]]


def _open_picture_or_video(path: Path) -> None:
    with open_video(path) as video:
        for number, _ in enumerate(video):
            if number == 3:
                break


def _read_layout(path: Path) -> None:
    read_layout(path.read_bytes())


def _read_exif(path: Path) -> None:
    read_exif(path.read_bytes())
    animation_length(path.read_bytes())


def _load_motion(path: Path) -> None:
    motion = Motion.load(path)
    corrections_of(motion)
    uncorrected(motion)


def _read_calibration(path: Path) -> None:
    read_calibration(path).intrinsics_for(640, 360)


def _place_cameras(path: Path) -> None:
    if path.suffix == ".yml":  # lenses and places, which have files of their own, in one
        for name in ("intri.yml", "extri.yml"):
            path.with_name(name).write_bytes(path.read_bytes())
        path = path.with_name("intri.yml")
    for camera, _ in placed_cameras(path, ["cam_0", "cam_1"]):
        calibration = read_calibration(camera)
        width, height = calibration.size or (1920, 1080)
        calibration.intrinsics_for(int(width), int(height))


def _pictures(_: Path) -> list[bytes]:
    picture = (np.indices((24, 32)).sum(axis=0) * 4).astype(np.uint8)[..., None].repeat(3, axis=2)
    return [
        cv2.imencode(suffix, picture)[1].tobytes()
        for suffix in (".png", ".jpg", ".webp", ".tiff", ".bmp")
    ]


def _videos(folder: Path) -> list[bytes]:
    path = folder / "seed.mp4"
    mp4v = cv2.VideoWriter_fourcc(*"mp4v")  # type: ignore[attr-defined]
    writer = cv2.VideoWriter(str(path), mp4v, 10.0, (64, 48))
    for level in range(4):
        writer.write(np.full((48, 64, 3), 60 * level, np.uint8))
    writer.release()
    return [path.read_bytes()]


def _box(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content) + 8) + name + content


def _heif(_: Path) -> list[bytes]:
    locations = _box(
        b"iloc", struct.pack(">IBBH", 0, 0x44, 0, 1) + struct.pack(">HHHII", 1, 0, 1, 400, 20)
    )
    entry = _box(b"infe", struct.pack(">IHH", 2 << 24, 1, 0) + b"hvc1\0")
    size = _box(b"ispe", struct.pack(">III", 0, 32, 24)) + _box(b"irot", b"\1")
    uses = _box(b"ipma", struct.pack(">II", 0, 1) + struct.pack(">HBBB", 1, 2, 1, 2))
    inside = [
        _box(b"pitm", struct.pack(">IH", 0, 1)),
        _box(b"iinf", struct.pack(">IH", 0, 1) + entry),
        locations,
        _box(b"iprp", _box(b"ipco", size) + uses),
        _box(b"iref", struct.pack(">I", 0) + _box(b"dimg", struct.pack(">HHH", 1, 1, 1))),
    ]
    return [
        _box(b"ftyp", b"heic\0\0\0\0mif1heic")
        + _box(b"meta", struct.pack(">I", 0) + b"".join(inside))
    ]


def _exif(_: Path) -> list[bytes]:
    found = []
    for order in "<>":
        tags = struct.pack(f"{order}HHIHH", 274, 3, 1, 6, 0) + struct.pack(
            f"{order}HHII", 34665, 4, 1, 38
        )
        inner = struct.pack(f"{order}HHHIHHI", 1, 41989, 3, 1, 26, 0, 0)
        start = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(f"{order}I", 8)
        found.append(start + struct.pack(f"{order}H", 2) + tags + bytes(4) + inner)
    jpeg = (
        b"\xff\xd8\xff\xe1"
        + struct.pack(">H", len(found[0]) + 8)
        + b"Exif\0\0"
        + found[0]
        + b"\xff\xd9"
    )
    chunk = struct.pack(">I", len(found[1])) + b"eXIf" + found[1] + bytes(4)
    return [*found, jpeg, b"\x89PNG\r\n\x1a\n" + chunk]


def _bodies(_: Path) -> list[bytes]:
    with np.load(ASSETS / "body" / "scope.npz") as file:
        arrays = {key: file[key] for key in file.files}
    return [
        npz(arrays),
        *(npz(_small_tables(family)) for family in ("smpl", "smplh", "smplx", "star")),
    ]


def _small_tables(family: str) -> dict[str, np.ndarray]:
    """Return the arrays of a body of some 50 kB, so that damage often hits what describes them."""
    tables = make_tables(family, vertices=60, betas=2)
    return {key: value for key, value in tables.items() if key != "posedirs"}


def _pickled_bodies(_: Path) -> list[bytes]:
    tables = [_small_tables(family) for family in ("smpl", "smplh", "star")]
    return [
        *(pickle.dumps(arrays, protocol) for arrays in tables for protocol in (2, 4)),
        *(dump_python2(tables[0], protocol) for protocol in (0, 2)),
    ]


def _motions(_: Path) -> list[bytes]:
    poses = np.zeros((6, 72))
    trans = np.zeros((6, 3))
    body = load_body("scope")
    motions = [made_motion(body, poses, trans, face=face) for face in ({}, made_face(6))]
    measured = (
        Pin(2, "head", (320.0, 200.0)),
        Contact(1, 3, "left"),
        Exchange(4, 5),
        DepthFlip(2, 3, "left_leg"),
        Upright.of(np.eye(4)),
    )
    corrections = (*measured, Interpolation(1, 2), FeetOnFloor(lift=False))
    return [
        motion.to_bytes() for motion in (*motions, with_corrections(motions[0], body, corrections))
    ]


def _smpl_motions(folder: Path) -> list[bytes]:
    """Return motions as SMPL's, AMASS's older and newer, AIST++'s and SMPL fits' files name their
    arrays.
    """
    joints = np.linspace(-0.6, 0.6, 5 * 55 * 3, dtype=np.float32).reshape(5, 55, 3)
    place = np.ones((5, 3))

    def flat(first: int, last: int) -> np.ndarray:
        return joints[:, first:last].reshape(5, -1)

    layouts: list[dict[str, Any]] = [
        {
            "poses": flat(0, 24),
            "trans": place,
            "mocap_framerate": np.array(30.0),
            "gender": np.array("male"),
        },
        {"poses": flat(0, 52), "trans": place, "betas": np.zeros(16)},
        {
            "root_orient": flat(0, 1),
            "pose_body": flat(1, 22),
            "pose_hand": flat(22, 52),
            "fps": np.array(120),
        },
        {"smpl_poses": flat(0, 24), "smpl_trans": place, "smpl_scaling": np.array([2.0])},
        {"global_orient": flat(0, 1), "body_pose": flat(1, 24), "transl": place},
    ]
    seeds = [npz(layout) for layout in layouts]
    (folder / "seed.npz").write_bytes(seeds[0])
    # compiles what it needs, which takes longer than an input may
    import_motions(folder / "seed.npz")
    return seeds


def _skeleton_motions(folder: Path) -> list[bytes]:
    """Return a BVH file of two frames: a pelvis with two legs and a head."""
    rotation = "CHANNELS 3 Zrotation Xrotation Yrotation"
    legs = "".join(
        f"JOINT {side}Hip {{ OFFSET {x} 0 0 {rotation} "
        f"JOINT {side}Knee {{ OFFSET 0 -4 0 {rotation} "
        f"JOINT {side}Ankle {{ OFFSET 0 -4 0 {rotation} End Site {{ OFFSET 0 0 1 }} }} }} }}\n"
        for side, x in (("Left", 1), ("Right", -1))
    )
    head = f"JOINT Head {{ OFFSET 0 6 0 {rotation} End Site {{ OFFSET 0 2 0 }} }}\n"
    position = "Xposition Yposition Zposition"
    root = f"ROOT Hips {{ OFFSET 0 0 0 {rotation.replace('3', '6 ' + position)}\n"
    frames = "\n".join(" ".join(["1.5"] * 27) for _ in range(2))
    seed = f"HIERARCHY\n{root}{legs}{head}}}\nMOTION\nFrames: 2\nFrame Time: 0.033\n{frames}\n"
    path = folder / "seed.bvh"
    path.write_text(seed)
    import_motions(path)
    return [seed.encode()]


def npz(arrays: dict[str, Any]) -> bytes:
    """Return the content of a .npz file."""
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


def _calibrations(_: Path) -> list[bytes]:
    ours = {
        "intrinsics": [[500, 0, 320], [0, 500, 180], [0, 0, 1]],
        "dist": [0.1, 0, 0, 0, 0],
        "size": [640, 360],
    }
    return [json.dumps(ours).encode()]


def _camera_tables(_: Path) -> list[bytes]:
    """Return calibrations as FreeMoCap's, EasyMocap's and OpenCap's files name their values."""
    opencap = {
        "intrinsicMat": np.array([[500.0, 0.0, 320.0], [0.0, 500.0, 180.0], [0.0, 0.0, 1.0]]),
        "distortion": np.zeros((1, 5)),
        "imageSize": np.array([[360.0], [640.0]]),
        "rotation": np.eye(3),
        "translation": np.ones((3, 1)),
    }
    return [
        FREEMOCAP.encode(),
        (INTRI + EXTRI.partition("---")[2]).encode(),
        pickle.dumps(opencap, 4),
    ]


def _bone_maps(_: Path) -> list[bytes]:
    bones = {f"Bone {part}": part for part in REQUIRED}
    return [json.dumps({"format": "scope bone map", "version": 1, "bones": bones}).encode()]


def _networks(folder: Path) -> list[bytes]:
    return [simcc(folder / "seed.onnx", 17, 32, 32).read_bytes()]


def _rigs(_: Path) -> list[bytes]:
    data = struct.pack("<9f", *range(9))
    document = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": len(data)}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "nodes": [{"name": "Hips", "children": [1]}, {"name": "Spine", "translation": [0, 1, 0]}],
        "skins": [{"joints": [0, 1]}],
    }
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    separate = json.dumps({**document, "buffers": [{"byteLength": len(data), "uri": uri}]}).encode()
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = (
        struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(data), b"BIN\0")
        + data
    )
    glb = struct.pack("<4sII", b"glTF", 2, len(chunks) + 12) + chunks
    packed = zlib.compress(bytes(24))
    array = b"d" + struct.pack("<III", 3, 1, len(packed)) + packed
    header = b"Kaydara FBX Binary  \0\x1a\0" + struct.pack("<I", 7400)
    end = len(header) + 13 + 1 + len(array)
    fbx = header + struct.pack("<IIIB", end, 1, len(array), 1) + b"A" + array + bytes(13)
    return [glb, separate, fbx]


TARGETS = {
    "picture": Target(
        _open_picture_or_video, (".png", ".jpg", ".webp", ".tiff", ".bmp", ".heic"), _pictures
    ),
    "video": Target(_open_picture_or_video, (".mp4", ".mov"), _videos),
    "heif": Target(_read_layout, (".heic",), _heif),
    "exif": Target(_read_exif, (".jpg",), _exif),
    "quicktime": Target(focal_35mm, (".mov",), _videos),
    "body": Target(load_body, (".npz",), _bodies),
    "pickle": Target(load_body, (".pkl",), _pickled_bodies),
    "motion": Target(_load_motion, (".npz",), _motions),
    "smpl_motion": Target(import_motions, (".npz",), _smpl_motions),
    "bvh": Target(import_motions, (".bvh",), _skeleton_motions),
    "calibration": Target(_read_calibration, (".json",), _calibrations),
    "camera_tables": Target(_place_cameras, (".toml", ".yml", ".pickle"), _camera_tables),
    "bone_map": Target(load_bone_map, (".json",), _bone_maps),
    "network": Target(check_onnx_file, (".onnx",), _networks),
    "network_run": Target(own.run_network, (".onnx",), _networks),
    "rig": Target(rig_source, (".glb", ".gltf", ".fbx"), _rigs),
    "reply": Target(own.read_reply, (".json",), own.replies),
    "request": Target(own.read_request, (".json",), own.requests),
    "answer": Target(own.read_answer, (".bin",), own.answers),
    "recording": Target(own.read_recording, (".recording",), own.recordings),
    "live_reply": Target(own.read_live_reply, (".json",), own.live_replies),
    "expression_map": Target(load_expression_map, (".json",), own.expression_maps),
    "description": Target(own.read_description, (".json",), own.descriptions),
    "estimates": Target(own.find_estimates, (".npz",), own.estimates),
    "window": Target(own.load_window, (".npz",), own.windows),
    "cached_report": Target(own.find_capture, (".json",), own.cached_reports),
    "times": Target(own.load_times, (".json",), own.times),
    "batch_report": Target(own.read_batch_report, (".json",), own.batch_reports),
}
