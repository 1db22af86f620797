# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures of two real cameras, and footage that several cameras cannot use."""

import numpy as np
import pytest
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.pipeline import capture
from scope.scope_addon.capture.several_views.capture_views import capture_views
from scope.scope_addon.capture.tracking.chosen_person import ChosenPerson
from scope.scope_addon.errors import UsageError
from scope.scope_addon.footage_view import FootageView
from scope.solver import load_body, rotations
from scope.solver.errors import InputError

# Of the ground truth's names, those of our joints.
LIMBS = {
    f"{side}_{name}": f"{side[0].upper()}{short}"
    for side in ("left", "right")
    for name, short in (
        ("shoulder", "Shoulder"),
        ("elbow", "Elbow"),
        ("wrist", "Wrist"),
        ("hip", "Hip"),
        ("knee", "Knee"),
        ("ankle", "Ankle"),
    )
}


def true_place(first, second):
    """Return the rotation and translation between two cameras' ground truths of the same joints."""
    a = first["joints"].reshape(-1, 3)
    b = second["joints"].reshape(-1, 3)
    both = np.isfinite(a).all(1) & np.isfinite(b).all(1)
    a, b = a[both], b[both]
    R = rotations.nearest_rotation((b - b.mean(0)).T @ (a - a.mean(0)))
    return R, b.mean(0) - R @ a.mean(0)


def test_two_cameras_halve_the_error_of_one(shared):
    folder = shared / "data" / "pose2sim"
    body = load_body("scope")
    options = CaptureOptions(wanted=VideoRange(end_s=1.3))
    captured = capture_views([folder / "cam1.mp4", folder / "cam4.mp4"], body, options)
    first, second = (np.load(folder / f"truth_cam{k}.npz") for k in (1, 4))
    (motion,) = captured.motions
    place = captured.report.views[1]
    np.testing.assert_allclose(
        motion.views["view_from_camera"][0, :3, :3], place["R_camera_first"], atol=1e-5
    )
    assert motion.views["view_sources"].tolist() == ["cam4.mp4"]
    assert motion.views["view_frame_rates"] == pytest.approx([60.0])
    R, t = true_place(first, second)
    turned = np.linalg.norm(rotations.log(np.array(place["R_camera_first"]) @ R.T))
    assert np.degrees(turned) < 5.0
    assert abs(place["offset_s"]) < 0.016
    distance = np.linalg.norm(place["t_camera_first_m"]) / np.linalg.norm(t)
    assert distance == pytest.approx(1.0, abs=0.1)
    names = [str(name) for name in first["names"]]
    known = [ours for ours, name in LIMBS.items() if name in names]
    assert len(known) >= 8
    truth = first["joints"][:, [names.index(LIMBS[ours]) for ours in known]]
    rows = np.searchsorted(motion.frames, first["frame_index"])
    within = rows < len(motion)
    ours = motion.joints_cam[rows[within]][:, [body.joint_names.index(name) for name in known]]
    error = ours - truth[within]
    hips = [known.index("left_hip"), known.index("right_hip")]
    error = error - error[:, hips].mean(axis=1, keepdims=True)
    assert 1000 * np.nanmean(np.linalg.norm(error, axis=-1)) < 45.0
    assert not [each for each in captured.report.warnings if "view" in each.code]


def test_one_video_is_not_several(shared):
    folder = shared / "data" / "pose2sim"
    video = folder / "cam1.mp4"
    body = load_body("scope")
    with pytest.raises(UsageError, match="2 to 8 videos"):
        capture_views([video], body, CaptureOptions())
    with pytest.raises(UsageError, match="given twice"):
        capture_views(
            [video, video.parent / ".." / "pose2sim" / "cam1.mp4"], body, CaptureOptions()
        )


def test_a_place_of_a_person_in_several_videos_is_refused(shared):
    folder = shared / "data" / "pose2sim"
    videos = [folder / "cam1.mp4", folder / "cam4.mp4"]
    options = CaptureOptions(chosen=ChosenPerson(540.0, 960.0, None))
    with pytest.raises(UsageError, match="--person is a place in one video"):
        capture_views(videos, load_body("scope"), options)


def test_what_is_given_of_cameras_has_to_suit_the_videos(shared, tmp_path):
    folder = shared / "data" / "pose2sim"
    videos = [folder / "cam1.mp4", folder / "cam4.mp4"]
    body = load_body("scope")
    with pytest.raises(UsageError, match="gives 2 offsets, but there are 1 further videos"):
        capture_views(videos, body, CaptureOptions(offsets_s=(0.0, None)))
    with pytest.raises(UsageError, match="one video was given"):
        capture(videos[0], body, CaptureOptions(offsets_s=(0.0,)))
    lens = "matrix = [[1670.0, 0, 540.0], [0, 1670.0, 960.0], [0, 0, 1]]\nsize = [1080, 1920]"
    cameras = [
        f"[cam_{k}]\n{lens}\nrotation = [0, {k}, 0]\ntranslation = [0, 0, 4]" for k in (1, 4)
    ]
    file = tmp_path / "calib.toml"
    file.write_text("\n".join(cameras))
    mirrored = VideoRange(view=FootageView(is_mirrored=True))
    with pytest.raises(UsageError, match="--mirror contradicts"):
        capture_views(videos, body, CaptureOptions(calibration=file, wanted=mirrored))
    file.write_text("\n".join(cameras).replace("[0, 4, 0]", "[0, 4]"))
    with pytest.raises(InputError, match="rotation and translation of cam_4"):
        capture_views(videos, body, CaptureOptions(calibration=file))
