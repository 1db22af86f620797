# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures of two real cameras, and footage that several cameras cannot use."""

import re
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.observe import given_camera
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.perception.region import parse_crop
from scope.scope_addon.capture.pipeline import capture
from scope.scope_addon.capture.several_views import capture_views as several
from scope.scope_addon.capture.several_views.bundle import CameraPlace, Given
from scope.scope_addon.capture.several_views.calibrate import Clock, Match
from scope.scope_addon.capture.several_views.capture_views import capture_views
from scope.scope_addon.capture.tracking.chosen_person import ChosenPerson
from scope.scope_addon.errors import CancelledError, UsageError
from scope.scope_addon.footage_view import FootageView
from scope.scope_addon.notices import notice
from scope.solver import load_body, rotations

BODY = load_body("scope")
# Of the ground truth's names, those of our joints.
LIMBS = {
    f"{side}_{name}": f"{side[0].upper()}{name.capitalize()}"
    for side in ("left", "right")
    for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
}


@pytest.fixture
def videos(shared):
    return [shared / "data" / "pose2sim" / f"cam{k}.mp4" for k in (1, 4)]


def true_place(first, second):
    """Return the rotation and translation between two cameras' ground truths of the same joints."""
    a = first["joints"].reshape(-1, 3)
    b = second["joints"].reshape(-1, 3)
    both = np.isfinite(a).all(1) & np.isfinite(b).all(1)
    a, b = a[both], b[both]
    R = rotations.nearest_rotation((b - b.mean(0)).T @ (a - a.mean(0)))
    return R, b.mean(0) - R @ a.mean(0)


@pytest.mark.slow
def test_two_cameras_halve_the_error_of_one(videos):
    options = CaptureOptions(wanted=VideoRange(end_s=1.1))
    captured = capture_views(videos, BODY, options)
    first, second = (np.load(path.with_name(f"truth_{path.stem}.npz")) for path in videos)
    (motion,) = captured.motions
    place = captured.report.views[1]
    lens = captured.report.camera
    assert re.fullmatch(r"estimated, \d+ degrees ± \d+ %, adjusted to the other cameras", lens)
    assert captured.report.focal_deviation == captured.report.views[0]["focal_deviation"] > 0
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
    ours = motion.joints_cam[rows[within]][:, [BODY.joint_names.index(name) for name in known]]
    error = ours - truth[within]
    hips = [known.index("left_hip"), known.index("right_hip")]
    error = error - error[:, hips].mean(axis=1, keepdims=True)
    assert 1000 * np.nanmean(np.linalg.norm(error, axis=-1)) < 45.0
    assert not [each for each in captured.report.warnings if "view" in each.code]


def test_everybody_in_the_further_videos_may_be_the_person_of_the_first(videos, monkeypatch):
    """Somebody else may be nearer there."""
    part = parse_crop("0,0,800,1900")
    asked = []

    def observed(path, body, options, *_):
        asked.append((path.name, options.people, options.part))
        if len(asked) == 2:
            raise CancelledError

    monkeypatch.setattr(several, "_observe_view", observed)
    with pytest.raises(CancelledError):
        capture_views(videos, BODY, CaptureOptions(part=part))
    assert asked == [("cam1.mp4", "largest", part), ("cam4.mp4", "all", None)]


def test_warnings_about_every_video_are_said_once():
    damaged = notice("decoding_stopped", footage="b.mp4", decoded=40, total=100)
    slower = notice("execution", text="slow")
    views = [
        SimpleNamespace(
            footage=SimpleNamespace(
                warnings=warnings,
                picture_changes=np.array(changes),
                timestamps=np.arange(40) / 30,
                cuts_s=[],
            ),
            video=SimpleNamespace(path=f"{name}.mp4", recorded_speed=speed, fps=30),
        )
        for name, warnings, speed, changes in (
            ("b", [damaged, slower], 1.0, [0.0, 90.0] * 20),
            ("c", [slower], 8.0, [90.0] * 20 + [1.0] * 15 + [90.0] * 5),
        )
    ]
    found = several._about_footage(views, CaptureOptions(), [slower])
    codes = ["decoding_stopped", "repeated_frames", "frozen_frames", "slow_motion"]
    assert [each.code for each in found] == codes
    assert several._about_footage(views, CaptureOptions(speed=1.0), [slower]) == found[:3]


def test_warnings_advise_only_what_several_cameras_can_have(videos, monkeypatch):
    image = SimpleNamespace(timestamps=np.zeros(1))
    image.warnings = [
        notice("left_out", footage="a.mp4", others=2, place="4,5@0.1"),
        notice("turned_footage", footage="a.mp4", degrees=90),
        notice("frame_size_changes", footage="a.mp4"),
    ]
    monkeypatch.setattr(several, "observe", lambda *_: (image, []))
    with pytest.raises(UsageError, match=r"cam1\.mp4 is a still image"):
        capture_views(videos, BODY, CaptureOptions())
    found = [str(each) for each in image.warnings]
    assert "at 4,5@0.1" in found[0]
    assert not [text for text in found if "--person" in text or "--rotate" in text]
    assert len(found) == 3


def test_offsets_are_given_in_the_times_of_the_videos_as_they_play():
    first, second = (
        SimpleNamespace(camera=SimpleNamespace(focal_deviation=0.1), speed=8.0) for _ in range(2)
    )
    given = several._given([first, second], CaptureOptions(offsets_s=(1.6,)), [None, None])
    assert given[1].offset_s == pytest.approx(0.2)


def test_videos_of_different_speeds_are_refused(monkeypatch):
    speeds = {"cam1.mp4": 1.0, "cam4.mp4": 8.0}
    monkeypatch.setattr(
        several,
        "open_video",
        lambda path, _: nullcontext(SimpleNamespace(recorded_speed=speeds[path.name])),
    )
    videos = [Path(name) for name in speeds]
    with pytest.raises(UsageError, match=r"cam4.mp4 was recorded 8 times as fast .* 1 times"):
        capture_views(videos, BODY, CaptureOptions())
    speeds |= {"cam1.mp4": 240 / 30.01, "cam4.mp4": 240 / 29.99}  # each right for its file
    several._check_paths(videos, CaptureOptions())


def test_one_video_is_not_several(videos):
    video = videos[0]
    with pytest.raises(UsageError, match="2 to 8 videos"):
        capture_views([video], BODY, CaptureOptions())
    with pytest.raises(UsageError, match="given twice"):
        capture_views(
            [video, video.parent / ".." / "pose2sim" / video.name], BODY, CaptureOptions()
        )
    options = CaptureOptions(chosen=ChosenPerson(540.0, 960.0, None))
    with pytest.raises(UsageError, match="--person is a place in one video"):
        capture_views(videos, BODY, options)


def test_cuts_of_further_cameras_are_told_by_the_first_ones_clock():
    def view(name, end_s, cuts_s):
        footage = SimpleNamespace(timestamps=np.linspace(0.0, end_s, 9), cuts_s=cuts_s)
        return SimpleNamespace(name=name, footage=footage, speed=2.0)

    def match(offset_s):
        place = replace(CameraPlace.first(), offset_s=offset_s, drift=0.01)
        return Match(place, 0.0, 0, Clock.MOTION)

    views = [
        view("first.mp4", 6.0, [1.0]),
        view("second.mp4", 9.0, [1.0, 6.0, 8.9]),  # before the first one, in it, after it
        view("third.mp4", 9.0, [5.0]),  # whose place is not known
        view("fourth.mp4", 9.0, [0.5]),
    ]
    matches = [match(0.0), match(1.0), None, match(2.0)]
    given = [Given(offset_s=0.0), Given(), Given(), Given(offset_s=-1.0, offset_sigma_s=0.01)]
    about = several._about_cameras(views, matches, given)
    said = [each for each in about if each.code == "cuts"]
    # 6 s play in slow motion: after 3 s, by a clock that is 1 s early and 1 % faster.
    times = [pytest.approx([2 * (3.0 - 1.0) / 1.01]), [5.0]]
    assert [(each.values["footage"], each.values["times"]) for each in said] == [
        ("second.mp4", times[0]),
        ("third.mp4", times[1]),
    ]
    # Times are those of videos that play at half speed.
    by_sound = notice("sound_contradicts", footage="fourth.mp4", offset_s=4.0, sound_s=-2.0)
    assert [each for each in about if each.code == "sound_contradicts"] == [by_sound]


def test_people_of_further_cameras_whom_the_first_one_does_not_show_are_counted():
    views = [SimpleNamespace(name=f"{k}.mp4", people=["?"] * k) for k in (2, 3, 1, 4)]
    places = [CameraPlace.first()] * 3 + [None]
    everyone = [[0, 2, None, None], [1, None, 0, None]]
    assert several._left_out(views, places, everyone) == [
        notice("only_in_view", footage="3.mp4", others=2)
    ]


@pytest.mark.parametrize(
    ("scale", "heights_m", "codes"),
    [
        (1.1, (), []),
        (0.6, (), ["calibration_scale"]),
        (0.6, (1.1,), []),  # a child's
        (1.0, (1.1,), ["calibration_scale"]),
    ],
)
def test_a_calibration_with_another_scale_is_warned_of(monkeypatch, scale, heights_m, codes):
    monkeypatch.setattr(several, "relative_distance", lambda *_: scale)
    monkeypatch.setattr(several, "contradicts", lambda *_: False)
    views = [SimpleNamespace(name=f"{k}.mp4", people=["person"]) for k in range(3)]
    given = [Given(T_camera_first=np.eye(4))] * 3
    matches = [Match(CameraPlace.first(), 0.0, 0, Clock.GIVEN)] * 3
    options = CaptureOptions(calibration=Path("calib.toml"), heights_m=heights_m)
    found = several._doubts_about_file(views, given, matches, BODY, options)
    assert [each.code for each in found] == codes


def test_a_calibration_that_is_written_again_between_two_videos_is_not_mixed(
    videos, tmp_path, monkeypatch
):
    file = tmp_path / "calib.toml"
    lens = "matrix = [[{f}, 0, 540.0], [0, {f}, 960.0], [0, 0, 1]]\nsize = [1080, 1920]\n"
    cameras = "\n".join(f"[cam_{k}]\n{lens}" for k in (1, 4))
    file.write_text(cameras.replace("{f}", "1670.0"))
    seen = []

    def observe_view(path, body, options, *_):
        video = SimpleNamespace(width=1080, height=1920, focal_35mm=None, wanted=options.wanted)
        seen.append(given_camera(video, options).intrinsics[0, 0])
        file.write_text(cameras.replace("{f}", "2000.0"))
        if len(seen) == 2:
            raise CancelledError

    monkeypatch.setattr(several, "_observe_view", observe_view)
    with pytest.raises(CancelledError):
        capture_views(videos, BODY, CaptureOptions(calibration=file))
    assert seen == [1670.0, 1670.0]


def test_what_is_given_of_cameras_has_to_suit_the_videos(videos, tmp_path):
    with pytest.raises(UsageError, match="gives 2 offsets, but there are 1 further videos"):
        capture_views(videos, BODY, CaptureOptions(offsets_s=(0.0, None)))
    with pytest.raises(UsageError, match="one video was given"):
        capture(videos[0], BODY, CaptureOptions(offsets_s=(0.0,)))
    lens = "matrix = [[1670.0, 0, 540.0], [0, 1670.0, 960.0], [0, 0, 1]]\nsize = [1080, 1920]"
    cameras = [
        f"[cam_{k}]\n{lens}\nrotation = [0, {k}, 0]\ntranslation = [0, 0, 4]" for k in (1, 4)
    ]
    file = tmp_path / "calib.toml"
    file.write_text("\n".join(cameras))
    mirrored = VideoRange(view=FootageView(is_mirrored=True))
    with pytest.raises(UsageError, match="--mirror contradicts"):
        capture_views(videos, BODY, CaptureOptions(calibration=file, wanted=mirrored))
    file.write_text("\n".join(cameras).replace("rotation = [0, 1, 0]", ""))
    with pytest.raises(UsageError, match="places of cameras, but none of cam1, the first video"):
        capture_views(videos, BODY, CaptureOptions(calibration=file))
