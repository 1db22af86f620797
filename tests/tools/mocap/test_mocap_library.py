# SPDX-License-Identifier: GPL-3.0-or-later
"""The shorter files of the real archives: lengths, scale, left and right, and gait that any walking
person has.
"""

import numpy as np
import pytest
from scope.tools.mocap import library

from .archives import beginning

SIDED = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist", "foot_end")
BONES = (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))

# Of each archive, the last file that is read, and how many characters a file may have.
PARTS = {
    "cmu_asf_amc": ("01/01.asf", 2_300_000),
    "cmu_expmap": ("cmu_mocap/train/walking/walking_3.txt", 1_000_000),
}


@pytest.fixture(scope="module")
def texts(shared):
    folder = shared / "data" / "mocap"
    found = {}
    for archive, (last, most) in PARTS.items():
        files = beginning(folder / f"{archive}.tar.xz", last)
        found[archive] = {name: text for name, text in files.items() if len(text) < most}
    return found


@pytest.fixture(scope="module")
def takes(shared, texts):
    read = library.read_archive
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            library,
            "read_archive",
            lambda path: texts.get(path.name.partition(".")[0]) or read(path),
        )
        return library.load_library(shared / "data" / "mocap", fps=30)


def lengths(take, a, b):
    return np.linalg.norm(take.joint(a) - take.joint(b), axis=1)


def test_bones_are_rigid_and_of_human_length(takes):
    for take in takes:
        for a, b in BONES:
            for side in ("left", "right"):
                length = lengths(take, f"{side}_{a}", f"{side}_{b}")
                assert np.ptp(length) < 1e-6
                assert 0.22 < length.mean() < 0.5, (take.name, a, b)


def test_orientations_are_rotations_that_carry_the_bones(takes):
    for take in takes[::10]:
        R = take.orientations[:, [take.index("left_hip"), take.index("right_elbow")]]
        np.testing.assert_allclose(
            R @ np.swapaxes(R, -1, -2), np.broadcast_to(np.eye(3), R.shape), atol=1e-9
        )
        assert (np.linalg.det(R) > 0).all()
        shank = take.joint("left_ankle") - take.joint("left_knee")
        local = np.einsum("tji,tj->ti", take.orientations[:, take.index("left_knee")], shank)
        assert np.ptp(local, axis=0).max() < 1e-6


def test_feet_are_near_the_ground(takes):
    for take in takes:
        if take.subject in ("cmu_01", "cmu_03"):  # these climb on things, among them a terrain
            continue
        lowest = np.minimum(take.joint("left_foot_end")[:, 1], take.joint("right_foot_end")[:, 1])
        assert -0.1 < np.quantile(lowest, 0.1) < 0.1, take.name


def test_walkers_walk_forwards_at_walking_pace_with_left_on_the_left(takes):
    walkers = [t for t in takes if "walking" in t.name or t.name in ("02_01", "walk", "long_walk1")]
    speeds = []
    forwards = []
    for take in walkers:
        pelvis = take.joint("pelvis")
        step = round(take.fps / 5)
        velocity = (pelvis[step:] - pelvis[:-step]) * take.fps / step
        speed = np.linalg.norm(velocity[:, [0, 2]], axis=1)
        moving = speed > 0.5
        if moving.mean() < 0.9:
            continue
        speeds.append(np.median(speed))
        left = (take.joint("left_hip") - take.joint("right_hip"))[step:]
        forward = np.cross(left, [0.0, 1.0, 0.0])  # x left, y up, z forward
        forwards.append((np.einsum("ti,ti->t", forward, velocity)[moving] > 0).mean())
        # knees never bend forwards, so the ankle lies behind the line of the thigh
        for side in ("left", "right"):
            thigh = (take.joint(f"{side}_knee") - take.joint(f"{side}_hip"))[step:]
            shank = (take.joint(f"{side}_ankle") - take.joint(f"{side}_knee"))[step:]
            assert (np.einsum("ti,ti->t", np.cross(thigh, shank), left) > -1e-4).mean() > 0.95, (
                take.name
            )
    assert len(speeds) > 50
    assert np.mean(np.array(forwards) > 0.95) > 0.9  # some go sideways for a while
    assert np.min(forwards) > 0.7
    assert np.median(speeds) == pytest.approx(1.2, abs=0.1)


def test_mirrored_takes_mirror_their_originals(takes):
    by_name = {t.name: t for t in takes if t.source == "deepmimic"}
    mirrored = [t for t in takes if t.mirrored]
    assert len(mirrored) == 3
    for take in mirrored:
        original = by_name[take.name.removesuffix("_mirror")]
        for joint in SIDED:
            a, b = (
                t.joint(n) - t.joint("pelvis")
                for t, n in ((take, f"left_{joint}"), (original, f"right_{joint}"))
            )
            # about the start's heading, which both share, the sides exchange
            assert np.abs(a * [-1, 1, 1] - b).max() < 0.02, take.name
