# SPDX-License-Identifier: GPL-3.0-or-later
"""Markers in .c3d files, read as the format says."""

import math
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scope.scope_addon.scene.export.without_scene import write_without_scene

BLOCK = 512


def read(content: bytes):
    """Return the header's numbers, the parameters by group and name, and the points (T, M, 4)."""
    assert len(content) % BLOCK == 0
    parameters_at = (content[0] - 1) * BLOCK
    assert content[1] == 0x50
    count, analog, first, last, _, scale, data_block, _, rate = struct.unpack_from(
        "<HHHHHfHHf", content, 2
    )
    blocks, processor = content[parameters_at + 2 : parameters_at + 4]
    assert processor == 84
    assert (data_block - 1) * BLOCK == parameters_at + blocks * BLOCK
    groups: dict[int, str] = {}
    found: dict[tuple[str, str], Any] = {}
    at = parameters_at + 4
    while True:
        length, number = struct.unpack_from("<bb", content, at)
        if length == 0:
            break
        name = content[at + 2 : at + 2 + length].decode()
        at += 2 + length
        (offset,) = struct.unpack_from("<H", content, at)
        if number < 0:
            groups[-number] = name
            assert content[at + 2] == offset - 3 == 0
        else:
            kind, dimensions = struct.unpack_from("<bB", content, at + 2)
            sizes = content[at + 4 : at + 4 + dimensions]
            values = content[at + 4 + dimensions : at + offset - 1]
            assert len(values) == abs(kind) * math.prod(sizes)
            if kind == -1:
                texts = [values[k : k + sizes[0]] for k in range(0, len(values), sizes[0])]
                found[groups[number], name] = [text.decode().rstrip() for text in texts]
            else:
                array = np.frombuffer(values, {2: "<u2", 4: "<f4"}[kind])
                found[groups[number], name] = array if dimensions else array[0]
        at += offset
    assert at + 2 <= parameters_at + blocks * BLOCK
    rows = np.frombuffer(content, "<f4", offset=(data_block - 1) * BLOCK)
    long = int(found["POINT", "LONG_FRAMES"])
    points = rows[: long * count * 4].reshape(long, count, 4)
    # Some readers take what fills the last block for points.
    padding = rows[long * count * 4 :].reshape(-1, 4)
    assert (padding == [0.0, 0.0, 0.0, -1.0]).all()
    assert len(rows) - long * count * 4 < BLOCK / 4
    return (count, analog, first, last, scale, data_block, rate), found, points


def written(motion, body, folder: Path) -> Path:
    (path,) = write_without_scene(folder / "walk.c3d", [motion], [body])
    return path


def with_deviations(motion, joints: int):
    """The motion with a deviation of k mm of joint k, one that is not known, and unseen frames."""
    sigma = np.tile(np.arange(joints) / 1000.0, (len(motion), 1))
    sigma[3] = np.nan
    sigma[4] = 0.4
    valid = np.ones(len(motion), bool)
    valid[6:8] = False
    return replace(motion, joint_sigma_m=sigma.astype(np.float32), valid=valid)


def test_points_are_the_joints_with_their_deviations(
    whole_body, make_motion, joints_world, tmp_path
):
    motion = with_deviations(make_motion(whole_body, 12), whole_body.K + 1)
    header, found, points = read(written(motion, whole_body, tmp_path).read_bytes())
    assert header[:4] == (23, 0, 1, 12)
    assert header[4] == found["POINT", "SCALE"] == -1.0
    assert header[5] == found["POINT", "DATA_START"]
    assert header[6] == found["POINT", "RATE"] == 30.0
    assert (found["POINT", "USED"], found["POINT", "FRAMES"]) == (23, 12)
    assert found["POINT", "UNITS"] == ["mm"]
    assert list(found["TRIAL", "ACTUAL_END_FIELD"]) == [12, 0]
    labels = found["POINT", "LABELS"]
    assert len(set(labels)) == len(found["POINT", "DESCRIPTIONS"]) == 23
    world = 1000.0 * joints_world(motion)
    seen = motion.valid
    for label, joint in {"RKnee": "right_knee", "LWrist": "left_wrist", "Neck": "neck"}.items():
        k = labels.index(label)
        joint_row = whole_body.joint_names.index(joint)
        np.testing.assert_allclose(points[seen, k, :3], world[seen, joint_row], atol=2e-2)
        assert found["POINT", "DESCRIPTIONS"][k] == joint.replace("_", " ")
        residuals = np.full(12, float(joint_row))
        residuals[[3, 4, 6, 7]] = [0.0, 255.0, -1.0, -1.0]
        np.testing.assert_array_equal(points[:, k, 3], residuals)
    ear = points[0, labels.index("LEar"), 3]
    assert ear == whole_body.joint_names.index("head")
    nose, knee = (points[seen, labels.index(label), 2] for label in ("Nose", "RKnee"))
    assert (nose > knee).all()


def test_a_variable_rate_becomes_constant_and_gaps_stay_missing(whole_body, make_motion, tmp_path):
    steady = make_motion(whole_body, 9)
    kept = np.array([0, 1, 2, 4, 5, 8])
    varying = make_motion(whole_body, timestamps=kept / 30)
    varying.valid[-1] = False
    _, _, points = read(written(varying, whole_body, tmp_path).read_bytes())
    _, _, expected = read(written(steady, whole_body, tmp_path).read_bytes())
    np.testing.assert_allclose(points[kept[:-1], :, :3], expected[kept[:-1], :, :3], atol=2e-2)
    assert (points[6:, :, 3] == -1.0).all()
    assert (points[:6, :, 3] >= 0.0).all()


def test_a_stretch_without_frames_is_missing(whole_body, make_motion, tmp_path):
    motion = make_motion(whole_body, 9)
    motion.timestamps[5:] += 0.5
    gap = round(0.5 * motion.mocap_framerate)
    _, _, points = read(written(motion, whole_body, tmp_path).read_bytes())
    missing = (points[..., 3] == -1.0).all(axis=1)
    assert np.flatnonzero(missing).tolist() == list(range(5, 5 + gap))
    assert not (points[~missing, :, 3] == -1.0).any()


@pytest.mark.parametrize(("late_s", "first"), [(5.0, 151), (3000.0, 90_001)])
def test_somebody_who_enters_later_begins_in_a_later_frame(
    whole_body, make_motion, tmp_path, late_s, first
):
    motion = make_motion(whole_body, 12)
    motion = replace(motion, timestamps=motion.timestamps + 2.0)
    late = replace(motion, timestamps=motion.timestamps + late_s)
    paths = write_without_scene(tmp_path / "walk.c3d", [late, motion], [whole_body] * 2)
    for path, begins in zip(paths, (first, 1), strict=True):
        header, found, points = read(path.read_bytes())
        assert header[2:4] == (min(begins, 65_535), min(begins + 11, 65_535))
        for name, frame in {"START": begins, "END": begins + 11}.items():
            low, high = found["TRIAL", f"ACTUAL_{name}_FIELD"].tolist()
            assert low + (high << 16) == frame
        assert found["POINT", "FRAMES"] == len(points) == 12
