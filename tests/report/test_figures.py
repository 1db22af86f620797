# SPDX-License-Identifier: GPL-3.0-or-later
"""The version that the page says.

Figures of motions whose figures are known.

The pictures of the overlay: which frames, how large, and never too many bytes.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import cv2
import numpy as np
from scope.scope_addon import installed
from scope.scope_addon.capture.fitting.outline import spread
from scope.scope_addon.report.capture_page import height_text, motion_figures
from scope.scope_addon.report.page import Picture, bounded, small_picture
from scope.scope_addon.review_spans import find_review_spans

from ..made_motion import made_motion

ROOT = Path(__file__).resolve().parents[2]


def test_the_version_is_the_manifests_and_that_of_an_unknown_installation_unknown(
    tmp_path, monkeypatch
):
    # An extension has no metadata of a package.
    monkeypatch.setattr(
        installed,
        "version",
        lambda name: (_ for _ in ()).throw(installed.PackageNotFoundError(name)),
    )
    stated = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))["version"]
    assert installed.scope_version() == stated
    monkeypatch.setattr(installed, "_ROOT", tmp_path)
    assert installed.scope_version() == "of an unknown version"


def test_a_walk_of_known_length_and_speed(body):
    T = 61
    trans = np.zeros((T, 3))
    # 1.5 m in a second, then a second of standing
    trans[:, 0] = np.minimum(np.arange(T), 30) / 30 * 1.5
    trans[:, 2] = 0.9 - body.rest_joints()[0, 2]
    contact = np.zeros((T, 4))
    contact[30:, 1] = 1.0
    # In some frames, this camera does not see the person, nor anybody in the last one.
    residual = np.r_[np.full(20, 0.0), np.full(T - 21, 4.0), 100.0]
    valid = np.arange(T) < T - 1
    confidence = np.full((T, body.K + 1), 0.8)
    confidence[-1] = 0.0
    motion = made_motion(
        body,
        np.zeros((T, 3 * (body.K + 1))),
        trans,
        joint_confidence=confidence,
        foot_contact=contact,
        residual_px=residual,
        valid=valid,
        uneven_ground=True,  # so that joints that no camera has seen do not float above the floor
    )
    figures = motion_figures(motion, body)
    assert figures["Frames seen"] == "60 of 61"
    assert figures["Path over the floor"] == "1.50 m"
    assert figures["Highest speed"] == "1.50 m/s"
    assert figures["Pelvis height"] == "0.90 to 0.90 m"
    # of the frames in which this camera saw the person
    assert figures["Reprojection error, mean"] == "4.0 px"
    # in 30 of 60 frames in which the person was seen
    assert figures["Left foot in contact"] == "50 % of frames"
    assert figures["Confidence, mean"] == "0.80"
    assert figures["Right foot in contact"] == "0 % of frames"
    assert figures["Frames to review"] == "1"
    assert figures["Height"] == f"{100 * np.ptp(body.v_template[:, 1]):.0f} cm"


def test_two_people_who_stand_on_both_sides_of_a_cut_do_not_move(body):
    T = 60
    trans = np.zeros((T, 3))
    trans[:, 2] = 0.9 - body.rest_joints()[0, 2]
    trans[30:, 0] = 3.0
    motion = made_motion(
        body, np.zeros((T, 3 * (body.K + 1))), trans, scene_starts=[30], uneven_ground=True
    )
    figures = motion_figures(motion, body)
    assert figures["Path over the floor"] == "0.00 m"
    assert float(figures["Highest speed"].split()[0]) < 0.5


def test_where_nobody_was_seen_nobody_moves(body):
    """The person leaves the picture, and comes back at another place."""
    trans = np.zeros((60, 3))
    trans[:, 2] = 0.9 - body.rest_joints()[0, 2]
    trans[30:40] += np.linspace([0, 0, -2.0], [3.0, 0, -2.0], 10)
    trans[40:, 0] = 3.0
    valid = np.ones(60, bool)
    valid[30:40] = False
    motion = made_motion(body, np.zeros((60, 3 * (body.K + 1))), trans, valid=valid)
    figures = motion_figures(motion, body)
    assert figures["Path over the floor"] == "0.00 m"
    assert figures["Highest speed"] == "0.00 m/s"
    assert figures["Pelvis height"] == "0.90 to 0.90 m"


def test_each_frame_to_review_counts_once_whatever_the_reasons(body):
    """A person floats for two seconds, at first away from where the footage shows them, then stands
    under the floor for one.
    """
    T = 91
    standing = -body.rest_vertices(np.zeros(body.P))[:, 1].min() - body.rest_joints()[0, 1]
    trans = np.zeros((T, 3))
    trans[:, 2] = standing
    trans[60:, 2] -= 0.05
    upright = np.zeros((T, body.K + 1, 3))
    upright[:, 0, 0] = np.pi / 2  # from y up to z up
    joints = np.zeros((T, body.K + 1, 3))
    joints[60:, :, 1] = 0.9  # below a camera that is 1 m above the floor
    motion = made_motion(
        body,
        upright,
        trans,
        joints_cam=joints,
        residual_px=np.where(np.arange(T) < 20, 100.0, 0.0),
    )
    reasons = {span.reason for span in find_review_spans(motion)}
    assert reasons == {"far", "floating", "leap"}  # down, from one frame to the next
    assert motion_figures(motion, body)["Frames to review"] == "91"


def test_the_height_with_its_deviation():
    assert height_text(1.7449, 0.0882) == "174 ± 9 cm"
    assert height_text(1.7449, 0.005) == "174.5 ± 0.5 cm"
    assert height_text(1.7449, np.nan) == "174 cm"


def test_pictures_are_spread_from_the_first_to_the_last_and_become_fewer_where_they_are_too_large():
    assert spread(np.arange(101), 5).tolist() == [0, 25, 50, 75, 100]
    assert spread(np.arange(3), 40).tolist() == [0, 1, 2]
    assert spread(np.arange(1), 40).tolist() == [0]
    pictures = [Picture(row, b"x" * 100, 1, 1) for row in range(9)]
    assert [p.row for p in bounded(pictures, 300)] == [0, 4, 8]
    assert len(bounded(pictures, 900)) == 9
    assert len(bounded(pictures, 10)) == 1


def test_a_picture_is_a_small_webp_of_the_same_content():
    image = np.zeros((1000, 1600, 3), np.uint8)
    image[:, 800:] = (250, 60, 20)
    picture = small_picture(7, image)
    assert (picture.row, picture.width, picture.height) == (7, 800, 500)
    assert picture.url.startswith("data:image/webp;base64,")
    back = cv2.cvtColor(
        cv2.imdecode(np.frombuffer(picture.content, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB
    )
    assert back.shape == (500, 800, 3)
    assert np.abs(back[250, 600].astype(int) - (250, 60, 20)).max() < 12
    assert back[250, 200].max() < 12
