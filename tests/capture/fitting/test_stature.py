# SPDX-License-Identifier: GPL-3.0-or-later
"""Known heights: the extent of the mesh, and the size and distance of captured people."""

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.fitting.stature import (
    STIFFNESS,
    mean_shape,
    with_stature,
    with_unknown_stature,
)
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.options import CaptureOptions, check_options
from scope.scope_addon.capture.pipeline import capture
from scope.scope_addon.errors import UsageError
from scope.solver import (
    default_priors,
    load_body,
)
from scope.solver.body_file import ASSETS, CHILD_BELOW_M

SIDES = ("left", "right")
SAMPLE = ASSETS / "sample" / "sample.mp4"


@pytest.mark.parametrize("height_m", [1.3, 1.7, 2.1])
def test_the_mean_is_the_most_probable_shape_of_a_height(height_m):
    body = load_body("scope")
    priors = with_stature(default_priors(body), body, height_m)
    betas = np.asarray(priors.shape_mean)
    assert np.ptp(body.rest_vertices(betas)[:, 1]) == pytest.approx(height_m, abs=0.003)
    mean = np.zeros(body.P) if height_m < CHILD_BELOW_M else mean_shape(body)
    rng = np.random.default_rng(0)
    for step in rng.standard_normal((20, body.P)):  # any other of this height is less common
        other = betas + 0.3 * step
        for _ in range(5):
            other[0] += (height_m - np.ptp(body.rest_vertices(other)[:, 1])) / 0.0956
        assert np.linalg.norm(other - mean) > np.linalg.norm(betas - mean)


def test_an_unknown_stature_depends_less_on_proportions_and_varies_among_people():
    """Conditioning on any linear proportion of β moves the stature by 1 / (1 + κ) of what it moves
    under N(0, I).
    """
    body = load_body("scope")
    before = default_priors(body)
    after = with_unknown_stature(default_priors(body), body)
    assert before.shape_information is None
    covariance = np.linalg.inv(np.asarray(after.shape_information))
    np.testing.assert_allclose(covariance, covariance.T)
    mean = np.asarray(after.shape_mean)
    heights = np.array([np.ptp(body.rest_vertices(mean + 0.01 * b)[:, 1]) for b in np.eye(body.P)])
    taller = (heights - np.ptp(body.rest_vertices(mean)[:, 1])) / 0.01
    rng = np.random.default_rng(0)
    for proportion in rng.standard_normal((10, body.P)):
        pulled = taller @ covariance @ proportion
        assert pulled == pytest.approx(taller @ proportion / (1 + STIFFNESS), rel=0.02, abs=1e-3)
    assert 0.03 < np.sqrt(taller @ covariance @ taller) < 0.08  # metres


def test_the_mean_of_people_has_the_proportions_of_people(shared):
    """Trunk, upper arm and forearm against the leg: means of six people whose joints are known."""
    body = load_body("scope")
    assert not mean_shape(replace(body, file="/of/others.npz")).any()
    mean = mean_shape(body)
    assert body.stature(mean) == pytest.approx(body.stature(), abs=0.001)
    J = body.rest_joints(mean)
    ours = proportions(lambda name: J[body.joint_names.index(name)])
    people = shared / "data" / "people" / "truth"
    names = ("labval_squat", "labval_walk_ts", "opencap_squat_cam0", "zju_377", "shelf_c3_t1")
    truths = [people / f"{name}.npz" for name in names]
    truths.append(shared / "data" / "pose2sim" / "truth_cam1.npz")
    found = np.mean([proportions(truth_joint(np.load(path))) for path in truths], axis=0)
    np.testing.assert_allclose(ours, found, rtol=0.03)


def truth_joint(truth):
    """Return a function that gives a joint's (T, 3) true places by the name of ours."""
    kind = "_anat" if "joints_anat" in truth.files else ""
    names = [str(name) for name in truth[f"names{kind}"]]
    joints = truth[f"joints{kind}"].astype(float)

    def joint(name):
        side, part = name.split("_")
        return joints[:, names.index(side[0].upper() + part.capitalize())]

    return joint


def proportions(joint):
    """Trunk, upper arm and forearm in lengths of a leg, from a function of joints' places."""

    def length(start, end):
        return np.nanmedian(np.linalg.norm(np.atleast_2d(start - end), axis=-1))

    def middle(part):
        return (joint(f"left_{part}") + joint(f"right_{part}")) / 2

    def limb(start, end):
        return np.mean([length(joint(f"{s}_{start}"), joint(f"{s}_{end}")) for s in SIDES])

    leg = limb("hip", "knee") + limb("knee", "ankle")
    trunk = length(middle("shoulder"), middle("hip"))
    return np.array([trunk, limb("shoulder", "elbow"), limb("elbow", "wrist")]) / leg


@pytest.mark.parametrize("height_m", [0.8, 1.1, 1.44])
def test_below_the_stature_of_adults_the_most_probable_shape_is_a_childs(height_m):
    """Legs grow faster than the trunk: sitting height is 0.62 of the stature at one year, 0.52 at
    twelve (Fredriks).
    """
    body = load_body("scope_child")
    betas = np.asarray(with_stature(default_priors(body), body, height_m).shape_mean)
    assert np.ptp(body.rest_vertices(betas)[:, 1]) == pytest.approx(height_m, abs=0.003)
    assert np.linalg.norm(betas[:-1]) < 0.5  # no unusual adult
    share = np.interp(height_m, [0.75, 0.87, 1.15, 1.5], [0.62, 0.585, 0.548, 0.52])
    J = body.rest_joints(betas)
    low = body.rest_vertices(betas)[:, 1].min()
    hip = J[body.joint_names.index("left_hip"), 1] - low
    # the joint is above the seat, as in adults
    assert hip / height_m == pytest.approx(1.0535 - share, abs=0.04)


@pytest.mark.parametrize("height_m", [None, 1.8])
def test_adults_are_the_same_with_the_body_of_all_ages(height_m):
    adult, of_ages = (load_body(name) for name in ("scope", "scope_child"))
    means = []
    for body in (adult, of_ages):
        priors = default_priors(body)
        priors = (
            with_unknown_stature(priors, body)
            if height_m is None
            else with_stature(priors, body, height_m)
        )
        means.append(
            np.zeros(body.P) if priors.shape_mean is None else np.asarray(priors.shape_mean)
        )
        information = np.asarray(priors.shape_information)
        assert means[-1].shape == (body.P,)
        np.testing.assert_allclose(np.linalg.inv(information)[10:], 0.0, atol=1e-4)
    np.testing.assert_allclose(means[1][:10], means[0], atol=1e-3)
    assert abs(means[1][10]) < 1e-4


@pytest.mark.parametrize(
    ("height_m", "says"),
    [
        (0.3, "a height of 30 cm is not plausible"),
        (np.nan, "nan"),
        (
            1.0,
            "can be 127 to 213 cm tall, not 100: use the body 'scope_child', which can be 80 to "
            "213 cm tall",
        ),
        (0.7, "can be 127 to 213 cm tall, not 70: omit the height"),
        (2.5, "not 250"),
    ],
)
def test_impossible_heights_are_refused(height_m, says):
    with pytest.raises(UsageError, match=says):
        check_options(load_body("scope"), CaptureOptions(heights_m=(1.8, height_m)))


@pytest.mark.slow
def test_a_known_height_sets_size_and_distance():
    """If a person is a quarter taller, the same pixels mean a quarter more distance."""
    body = load_body("scope")
    found = {}
    for height_m in (1.5, 1.9):
        options = CaptureOptions(
            quality="fast", heights_m=(height_m, 1.6), fov_deg=60.0, wanted=VideoRange(0, 0.5)
        )
        result = capture(SAMPLE, body, options)
        motion = result.motions[0]
        assert body.stature(motion.betas) == pytest.approx(height_m, abs=0.015)
        assert result.report.per_person[0]["height_m"] == pytest.approx(height_m, abs=0.015)
        assert result.report.per_person[0]["height_sigma_m"] == pytest.approx(0.005, abs=0.002)
        assert any(
            "2 heights were given, but one person was found" in text
            for text in map(str, result.report.warnings)
        )
        found[height_m] = np.linalg.norm(motion.joints_cam[:, 0], axis=1).mean()
    assert found[1.9] / found[1.5] == pytest.approx(1.9 / 1.5, rel=0.05)
