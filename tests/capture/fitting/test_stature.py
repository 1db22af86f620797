# SPDX-License-Identifier: GPL-3.0-or-later
"""Known heights: the extent of the mesh, and the size and distance of captured people."""

import numpy as np
import pytest
from scope.scope_addon.capture.fitting.stature import with_stature
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.options import CaptureOptions, check_options
from scope.scope_addon.capture.pipeline import capture
from scope.scope_addon.errors import UsageError
from scope.solver import default_priors, load_body
from scope.solver.loaders.body_file import ASSETS

SAMPLE = ASSETS / "sample" / "sample.mp4"


@pytest.mark.parametrize("height_m", [1.3, 1.55, 1.7, 1.95, 2.1])
def test_the_mean_is_the_most_probable_shape_of_a_height(height_m):
    body = load_body("scope")
    priors = with_stature(default_priors(body), body, height_m)
    betas = np.asarray(priors.shape_mean)
    assert np.ptp(body.rest_vertices(betas)[:, 1]) == pytest.approx(height_m, abs=0.003)
    rng = np.random.default_rng(0)
    for step in rng.standard_normal((20, body.P)):  # any other of this height is less common
        other = betas + 0.3 * step
        for _ in range(5):
            other[0] += (height_m - np.ptp(body.rest_vertices(other)[:, 1])) / 0.0956
        assert np.linalg.norm(other) > np.linalg.norm(betas)


@pytest.mark.parametrize(
    ("height_m", "says"),
    [
        (0.3, "a height of 30 cm is not plausible"),
        (np.nan, "nan"),
        (1.0, "can be 127 to 213 cm"),
        (2.5, "not 250"),
        (-1.8, "-180"),
    ],
)
def test_impossible_heights_are_refused(height_m, says):
    with pytest.raises(UsageError, match=says):
        check_options(load_body("scope"), CaptureOptions(heights_m=(1.8, height_m)))


def test_a_known_height_sets_size_and_distance():
    """If a person is a quarter taller, the same pixels mean a quarter more distance."""
    body = load_body("scope")
    found = {}
    for height_m in (1.5, 1.9):
        options = CaptureOptions("fast", heights_m=(height_m, 1.6), fov_deg=60.0, wanted=VideoRange(0, 0.5))
        result = capture(SAMPLE, body, options)
        motion = result.motions[0]
        assert body.stature(motion.betas) == pytest.approx(height_m, abs=0.015)
        assert result.report["per_person"][0]["height_m"] == pytest.approx(height_m, abs=0.015)
        assert any("2 heights were given, but one person was found" in text for text in result.report["warnings"])
        found[height_m] = np.linalg.norm(motion.joints_cam[:, 0], axis=1).mean()
    assert found[1.9] / found[1.5] == pytest.approx(1.9 / 1.5, rel=0.05)
