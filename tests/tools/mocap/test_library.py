# SPDX-License-Identifier: GPL-3.0-or-later
"""The shorter files of the real archives: lengths, scale, left and right, and gait that any
walking person has.

Kinds of motion by the names of takes and by how the body moves.

The motion library against people: they stand and walk with nearly straight legs, and stand
upright. The fitted body is held to it, not the recordings, because its joints are what networks
and priors learn.
"""

from dataclasses import replace

import numpy as np
import pytest
from scope.tools.mocap import library
from scope.tools.mocap.fit_body import fit_library
from scope.tools.mocap.kinds import kind_of, named_kind
from scope.tools.mocap.position_sets import load_set
from scope.tools.mocap.straight_legs import knee_flexions, straightened

from ...required import missing
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


@pytest.mark.parametrize(
    ("source", "name", "kind"),
    [
        ("cmu_expmap", "train_walking_3", "walk"),
        ("cmu_expmap", "train_basketball_signal_1", "stand"),
        ("cmu_expmap", "train_basketball_1", "other"),
        ("deepmimic", "stealthy_walk0", "other"),
        ("deepmimic", "long_walk1", "walk"),
        ("rocketbox", "m_sit_chair_idle_cough", "sit"),
        ("rocketbox", "f_sit_stand_up_chair_01", "sit"),
        ("rocketbox", "m_walk_to_run", "run"),
        ("rocketbox", "f_turn_left_120_to_walk", "walk"),
        ("rocketbox", "m_idle_neutral_01", "stand"),
        ("accad", "Female1_B03_Walk1", "walk"),
        ("accad", "Female1_B24_WalkToCrouch", "floor"),
        ("accad", "Female1_C11_RunTurnLeft90", "run"),
        ("style100", "Neutral_FR", "run"),
        ("markers", "opencap_subject4_walkingTI2", "walk"),
        ("cmu_more", "13_15", ""),
    ],
)
def test_names_say_what_happens(source, name, kind):
    assert named_kind(source, name) == kind


STANDING_AND_WALKING = {
    "accad": ("Female1_A01_Stand", "Female1_A02_Sway", "Female1_B03_Walk1"),
    "cmu_more": ("07_01", "13_09"),
    "rocketbox": ("f_idle_neutral_09", "f_walk_neutral", "m_idle_breathe_01", "m_walk_neutral"),
    "style100": ("Neutral_FW", "Neutral_ID"),
}


MOST_FRAMES = 600


STRAIGHTEST = 10  # per cent of the frames


MOST_DEG = 8.0


LEAN_DEG = 6.0


STANDS_M_PER_S = 0.2


JOINTS = tuple(
    f"{side}_{joint}" for side in ("left", "right") for joint in ("hip", "knee", "ankle")
)


@pytest.fixture(scope="module")
def takes_of_people(shared):
    """A straightened walk of CMU's, and some of each set that has legs to go by, cut to 20
    seconds.
    """
    folder = shared / "data" / "mocap2"
    if not folder.is_dir():
        missing(f"the tests on real sets need {folder}", allowed_by="SCOPE_WITHOUT_SHARED")
    names = ("03/03.asf", "02/02.asf", "02/02_01.amc")
    texts = beginning(shared / "data" / "mocap" / "cmu_asf_amc.tar.xz", names[-1])
    walks, _ = library.load_asf_amc({name: texts[name] for name in names})
    found = [straightened(walk.resampled(30)) for walk in walks]
    for name, wanted in STANDING_AND_WALKING.items():
        found += [take for take in load_set(folder / f"{name}.npz") if take.name in wanted]
    return [
        replace(t, positions=t.positions[:MOST_FRAMES], orientations=t.orientations[:MOST_FRAMES])
        for t in found
    ]


@pytest.fixture(scope="module")
def fitted(takes_of_people, body):
    return fit_library(body, takes_of_people, straight_knees=True)


def at(fit, body, name):
    return fit.t[:, body.joint_names.index(name)]


def middle(fit, body, name):
    return 0.5 * (at(fit, body, f"left_{name}") + at(fit, body, f"right_{name}"))


def flexions(fit, body):
    return knee_flexions({joint: at(fit, body, joint) for joint in JOINTS})


def test_the_straightest_legs_of_people_who_stand_and_walk_are_nearly_straight(fitted, body):
    for source in ("cmu_asf_amc", *STANDING_AND_WALKING):
        for kind in ("stand", "walk"):
            own = [
                flexions(fit, body)
                for fit in fitted
                if fit.take.source == source and kind_of(fit.take) == kind
            ]
            if own:
                straighter = np.concatenate(own, axis=1).min(axis=0)
                assert 0.0 <= np.percentile(straighter, STRAIGHTEST) <= MOST_DEG, (source, kind)


def test_knees_bend_as_they_were_recorded(fitted, body):
    for fit in fitted:
        recorded = knee_flexions({joint: fit.take.joint(joint) for joint in JOINTS})
        off = (flexions(fit, body) - recorded)[:, fit.valid]
        assert abs(np.median(off)) < 1.5, fit.take.name
        assert np.percentile(np.abs(off), 95) < 5.0, fit.take.name


def lean(left, line):
    """Degrees by which lines (T, 3) lean ahead of up; ``left`` (T, 3) is the person's left."""
    ahead = np.cross(left, [0.0, 1.0, 0.0])
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    return np.degrees(np.arctan2(np.einsum("ti,ti->t", line, ahead), line[:, 1]))


def test_people_stand_upright(fitted, body):
    """The line from hips to shoulders against up, in frames in which the hips are still."""
    stands = [fit for fit in fitted if kind_of(fit.take) == "stand"]
    for source in {fit.take.source for fit in stands}:
        leans = []
        for fit in (fit for fit in stands if fit.take.source == source):
            hips, shoulders = (middle(fit, body, joint) for joint in ("hip", "shoulder"))
            speed = np.linalg.norm(np.gradient(hips, axis=0)[:, [0, 2]], axis=1) * fit.take.fps
            left = at(fit, body, "left_hip") - at(fit, body, "right_hip")
            leans.append(lean(left, shoulders - hips)[speed < STANDS_M_PER_S])
        assert abs(np.median(np.concatenate(leans))) < LEAN_DEG, source


def test_trunks_lean_as_they_were_recorded(fitted, body):
    """The line from hips to neck, which leans back in the body's rest pose, is the recorded one."""
    for fit in fitted:
        take = fit.take
        neck = "neck2" if "neck2" in take.joint_names else "neck"
        recorded = {joint: take.joint(joint) for joint in ("left_hip", "right_hip", neck)}
        shown = {joint: at(fit, body, joint) for joint in ("left_hip", "right_hip", "neck")}
        leans = []
        for left, right, top in (recorded.values(), shown.values()):
            leans.append(lean(left - right, top - 0.5 * (left + right)))
        assert abs(np.median((leans[1] - leans[0])[fit.valid])) < 2.5, take.name
