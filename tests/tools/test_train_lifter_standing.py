# SPDX-License-Identifier: GPL-3.0-or-later
"""How the lifter's training changes the legs of people who stand, against angles worked out by
hand.
"""

import numpy as np
import pytest
from scope.scope_addon.capture.perception.lifter import MIDDLE, WINDOW
from scope.solver.rotations import exp
from scope.tools.train_lifter.motions import Motions

from ..required import missing

try:
    import torch
except ImportError:
    missing(
        "torch is not installed, which trains the lifting network: pip install torch",
        "SCOPE_WITHOUT_TRAINING",
    )

from scope.tools.train_lifter import augment
from scope.tools.train_lifter.augment import PoseSampler


@pytest.fixture(autouse=True)
def _seed():
    torch.manual_seed(0)


def standing_sampler(body, bend_deg):
    """Windows of people who stand with both knees bent by so much from the rest pose, as
    recorded.
    """
    pose = np.zeros((20, body.K + 1, 3))
    for side in ("left", "right"):
        pose[:, body.joint_names.index(f"{side}_knee"), 0] = np.radians(bend_deg)
    same = (np.full(20, value) for value in (30.0, "cmu_01", "stand", "cmu_asf_amc"))
    return PoseSampler(
        body, Motions(exp(pose).astype(np.float32), np.zeros(20, int), *same), natural_share=1.0
    )


def turns_about_x(Omega, body, joint):
    """Angles (n,) in degrees of left joints that turn about x alone, in the middle of windows."""
    R = Omega[:, MIDDLE, body.joint_names.index(f"left_{joint}")]
    return torch.rad2deg(torch.atan2(R[:, 2, 1], R[:, 1, 1]))


def test_straightened_legs_lose_a_slight_flexion_and_keep_the_foot_below_the_hip(body):
    everybody = torch.ones(400, dtype=torch.bool)
    sampler = standing_sampler(body, 12.0)
    windows = sampler._states.reshape(20, 1, -1, 3, 3).expand(20, WINDOW, -1, 3, 3)[
        torch.zeros(400, dtype=torch.long)
    ]
    Omega = sampler.straightened(windows, everybody)
    hip, knee, ankle = (turns_about_x(Omega, body, joint) for joint in ("hip", "knee", "ankle"))
    assert (knee > -0.1).all()
    assert 0.3 < (knee < 11.9).float().mean() < 0.9  # most, not all
    torch.testing.assert_close(hip + knee + ankle, torch.full((400,), 12.0), atol=0.01, rtol=0)
    torch.testing.assert_close(hip, 0.5 * (12.0 - knee), atol=0.01, rtol=0)
    bent = standing_sampler(body, 40.0)
    windows = bent._states.reshape(20, 1, -1, 3, 3).expand(20, WINDOW, -1, 3, 3)
    assert torch.equal(bent.straightened(windows, everybody[:20]), windows)
    assert torch.equal(sampler.straightened(windows, ~everybody[:20]), windows)


def test_who_squats_keeps_the_feet_as_they_were(body):
    sampler = standing_sampler(body, 0.0)
    windows = sampler._states.reshape(20, 1, -1, 3, 3).expand(20, WINDOW, -1, 3, 3)[
        torch.zeros(400, dtype=torch.long)
    ]
    Omega = sampler.squats(windows, torch.ones(400, dtype=torch.bool))
    root = torch.rad2deg(torch.atan2(Omega[:, MIDDLE, 0, 2, 1], Omega[:, MIDDLE, 0, 1, 1]))
    hip, knee, ankle = (turns_about_x(Omega, body, joint) for joint in ("hip", "knee", "ankle"))
    squats = knee > 0.01
    assert squats.float().mean() == pytest.approx(augment.SQUAT_SHARE, abs=0.08)
    torch.testing.assert_close(root + hip + knee + ankle, torch.zeros(400), atol=0.01, rtol=0)
    assert (root[squats] >= 0).all()  # the trunk leans forward
    assert (hip[squats] < 0).all()  # and the thighs are ahead of it
    assert (ankle[squats] <= 0).all()
