# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion library against people: they stand and walk with nearly straight legs, and stand
upright. The fitted body is held to it, not the recordings, because its joints are what networks
and priors learn.
"""

from dataclasses import replace

import numpy as np
import pytest
from scope.tools.mocap import library
from scope.tools.mocap.fit_body import fit_library
from scope.tools.mocap.kinds import kind_of
from scope.tools.mocap.position_sets import load_set
from scope.tools.mocap.straight_legs import knee_flexions, straightened

from ...required import missing
from .archives import beginning

STANDING_AND_WALKING = {
    "accad": ("Female1_A01_Stand", "Female1_B03_Walk1"),
    "cmu_more": ("07_01", "13_09"),
    "rocketbox": ("f_idle_neutral_09", "m_walk_neutral"),
    "style100": ("Neutral_FW", "Neutral_ID"),
}


pytestmark = pytest.mark.slow  # fits the body to minutes of motion
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
        found += load_set(folder / f"{name}.npz", wanted)
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
