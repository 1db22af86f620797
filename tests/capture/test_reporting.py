# SPDX-License-Identifier: GPL-3.0-or-later
"""What the report says of a face, counted by hand, and of the up direction.

What a report says of feet that are not on the floor, for motions whose heights are known.
"""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture import reporting
from scope.scope_addon.capture.camera.background_record import CameraMotion
from scope.scope_addon.capture.camera.intrinsics import assumed_camera
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.options import capture_options
from scope.scope_addon.capture.reporting import (
    camera_warnings,
    face_frames,
    freeze_warnings,
    repetition_warnings,
    unused_option_warnings,
    up_warnings,
)
from scope.scope_addon.capture.tracking.scene_cuts import SceneCuts
from scope.scope_addon.capture.world.travel_scale import FLOOR
from scope.scope_addon.capture.world.world_frame import BODIES, LINES
from scope.scope_addon.options import Place, options_at
from scope.solver import load_body, rotations

from ..made_motion import made_face, made_motion

T = 300


RATE = 30.0


@pytest.fixture(scope="module")
def motion():
    body = load_body("scope")
    return made_motion(body, np.zeros((T, 3 * (body.K + 1))), np.zeros((T, 3)), RATE)


def test_a_motion_without_a_face_says_nothing_of_one(motion):
    assert face_frames(motion) == {}


def test_blinks_are_counted_and_related_to_the_time_in_which_the_face_was_seen(motion):
    lids = np.zeros(T)
    jaw = np.zeros(T)
    lids[10:14] = lids[100:103] = lids[200:210] = 0.9  # the last one while the face is not seen
    jaw[:20] = 0.8  # a tenth of the frames, so the 95th percentile is there
    motion.face = made_face(T, eyeBlinkLeft=lids, eyeBlinkRight=lids, jawOpen=jaw)
    motion.face["expression_confidence"][180:] = 0.0
    # Seen for 6 s: two blinks are twenty a minute.
    assert face_frames(motion) == {
        "face_frames": 180,
        "blinks": 2,
        "blinks_per_minute": 20.0,
        "jaw_open": 0.8,
    }


def test_blinks_are_related_to_the_times_of_frames_whose_rate_varies(motion):
    lids = np.zeros(T)
    lids[10:14] = lids[100:103] = 0.9
    times_s = np.cumsum(np.where(np.arange(T) < 90, 1.0, 2.0)) / RATE
    varying = replace(motion, timestamps=times_s)
    varying.face = made_face(T, eyeBlinkLeft=lids, eyeBlinkRight=lids)
    varying.face["expression_confidence"][180:] = 0.0
    # Seen for 3 s and 6 s, in as many frames.
    assert face_frames(varying)["blinks_per_minute"] == pytest.approx(2 / 9 * 60, abs=0.05)


def test_one_eye_alone_is_a_wink(motion):
    motion.face = made_face(T, eyeBlinkLeft=np.ones(T))
    assert face_frames(motion)["blinks"] == 0


def test_a_face_that_was_never_seen_has_no_rate(motion):
    motion.face = made_face(T)
    motion.face["expression_confidence"][:] = 0.0
    assert face_frames(motion) == {"face_frames": 0, "blinks": 0}


def test_a_still_without_edges_says_that_up_is_a_guess():
    """And how far it may be off; clips, and pictures with edges, say nothing."""
    (warning,) = map(str, up_warnings("a.jpg", BODIES, is_still=True))
    assert "a.jpg" in warning
    assert "11 degrees" in warning
    assert up_warnings("a.jpg", LINES, is_still=True) == []
    assert up_warnings("a.mp4", BODIES, is_still=False) == []


def standing(body, height, raw=None):
    """Three seconds of a person at rest, the lowest vertex at ``height`` (90,) metres, contact
    certain.
    """
    poses = np.zeros((90, body.K + 1, 3))
    poses[:, 0] = [np.pi / 2, 0, 0]
    R, t = body.forward_kinematics(rotations.exp(poses[0]), np.zeros(3))
    on_floor = np.array([0.0, 0.0, -body.skin(R, t)[:, 2].min()])
    trans, trans_raw = (
        on_floor + np.asarray(h)[:, None] * [0, 0, 1]
        for h in (height, height if raw is None else raw)
    )
    before = poses if raw is None else poses + 1e-3 * np.array([0.0, 0, 1])
    given = {
        "poses_raw": before.reshape(90, -1),
        "trans_raw": trans_raw,
        "foot_contact": np.full((90, 4), 0.95),
    }
    return made_motion(body, poses, trans, **given)


def from_second(second, height):
    return np.where(np.arange(90) >= 30 * second, height, 0.0)


def floor_warnings(name, body, motions, *arguments) -> list[str]:
    times_s = motions[0].footage_times_s
    return list(map(str, reporting.floor_warnings(name, body, motions, times_s, *arguments)))


def test_nothing_is_said_of_somebody_on_the_floor(body):
    assert floor_warnings("a.mp4", body, [standing(body, np.full(90, -0.008))]) == []


@pytest.mark.parametrize(("height", "where"), [(-1.5, "1.5 m below"), (0.8, "0.8 m above")])
def test_another_floor(body, height, where):
    found = floor_warnings("a.mp4", body, [standing(body, from_second(2, height))])
    assert found == [
        f"a.mp4: the person stands up to {where} the floor at 2.0 s, so the clip has more than one "
        "floor: capture the "
        "part that matters, with a start and end time, or with uneven ground"
    ]


def test_times_are_those_of_the_footage_as_it_plays(body):
    """A motion's own times are those at which it was filmed, in slow motion earlier."""
    motion = standing(body, from_second(2, 0.8))
    (found,) = reporting.floor_warnings("a.mp4", body, [motion], 2 * motion.timestamps)
    assert "the floor at 4.0 s" in str(found)


@pytest.mark.parametrize(
    ("given", "cause"),
    [(0, "give everybody's height"), (1, "give everybody's height"), (2, "in another order")],
)
def test_somebody_off_the_floor_of_another_all_the_time_may_have_another_size(body, given, cause):
    low = standing(body, np.zeros(90))
    other = standing(body, np.full(90, 0.5))
    (found,) = floor_warnings("a.mp4", body, [low, other], given)
    assert found.startswith(
        "a.mp4: person 2 stands up to 0.5 m above the floor at 0.0 s, so either "
    )
    assert cause in found
    assert found.endswith(
        "or the clip has more than one floor: capture the part that matters, with a start and end "
        "time, or with uneven "
        "ground"
    )


def test_somebody_who_changes_floors_has_no_other_size(body):
    (found,) = floor_warnings(
        "a.mp4", body, [standing(body, np.zeros(90)), standing(body, from_second(2, -1.5))]
    )
    assert found.startswith(
        "a.mp4: person 2 stands up to 1.5 m below the floor at 2.0 s, so the clip has more than one"
    )


@pytest.mark.parametrize(("height", "where"), [(-0.18, "18 cm below"), (0.15, "15 cm above")])
def test_a_step_that_was_levelled(body, height, where):
    motion = standing(body, np.zeros(90), raw=from_second(1, height))
    motion.foot_contact[29] = 0.0
    found = floor_warnings("a.mp4", body, [standing(body, np.zeros(90)), motion])
    assert len(found) == 1
    assert f"the feet of person 2 rest {where} the floor at 1.0 s, as on a step" in found[0]


def test_feet_that_are_still_under_the_floor(body):
    height = np.zeros(90)
    height[10:17] = -0.05
    found = floor_warnings("a.mp4", body, [standing(body, height)])
    assert found == ["a.mp4: a foot of the person is up to 5 cm under the floor in 7 of 90 frames"]


def turning(degrees, lost=()):
    """A camera that pans by so much, followed in every third frame, but not in the lost ones."""
    known = np.arange(T) % 3 == 0
    known[list(lost)] = False
    angles = np.radians(degrees) * np.linspace(0.0, 1.0, T)
    return CameraMotion(rotations.exp(angles[:, None] * [0.0, 1.0, 0.0]), known)


def about_turns(motion, camera_motion, deviation=0.25, cuts_s=()):
    """The codes and sentences of warnings of a camera that does not travel."""
    camera = replace(assumed_camera(1280, 720, (1280, 720)), focal_deviation=deviation)
    footage = SimpleNamespace(
        zoom=None,
        timestamps=motion.timestamps,
        cuts_s=list(cuts_s),
        world_from_camera=None,
        camera=camera,
        camera_motion=camera_motion,
    )
    solved = SimpleNamespace(travel_source=None, motions=[motion], contradictions=[None])
    return {each.code: str(each) for each in camera_warnings("made.mp4", footage, solved)}


def test_a_camera_that_turns_much_behind_a_lens_that_is_assumed_is_told(motion):
    said = about_turns(motion, turning(50.0))
    assert list(said) == ["turn_by_lens"]
    assert "turns by 50 degrees" in said["turn_by_lens"]
    assert not about_turns(motion, turning(50.0), deviation=0.05)
    assert not about_turns(motion, turning(10.0))
    assert not about_turns(motion, turning(0.0))


def test_when_the_rotation_of_a_turning_camera_is_lost_is_told(motion):
    """Frames 60 and 63 are lost, at 2.0 s; of a camera on a tripod, nothing is."""
    said = about_turns(motion, turning(10.0, lost=(60, 63)))
    assert list(said) == ["lost_turn"]
    assert "unknown at 1.9 s, because" in said["lost_turn"]
    assert not about_turns(motion, turning(0.0, lost=(60, 63)))
    assert not about_turns(motion, turning(10.0, lost=(60, 63)), cuts_s=[2.0])
    until_the_end = about_turns(motion, turning(10.0, lost=range(240, T)))
    assert "unknown at 7.9 s, because" in until_the_end["lost_turn"]


def test_frames_that_the_footage_leaves_out_are_no_lost_rotation(motion):
    """Of a rotation that is followed in every third frame, and of one that is known in all."""
    followed = turning(10.0)
    gap_s = np.where(np.arange(T) >= 63, 3 / RATE, 0.0)  # three are left out
    later = replace(motion, timestamps=motion.timestamps + gap_s)
    assert not about_turns(later, followed)
    assert not about_turns(later, replace(followed, known=np.ones(T, bool)))


@pytest.mark.parametrize(("is_certain", "codes"), [(True, []), (False, ["zoom"])])
def test_a_zoom_of_which_some_may_be_missing_is_told(motion, is_certain, codes):
    footage = SimpleNamespace(
        zoom=SimpleNamespace(is_certain=is_certain),
        timestamps=motion.timestamps,
        world_from_camera=None,
        camera_motion=turning(0.0),
    )
    solved = SimpleNamespace(travel_source=None, motions=[motion], contradictions=[None])
    warnings = camera_warnings("made.mp4", footage, solved)
    assert [warning.code for warning in warnings] == codes


@pytest.mark.parametrize(
    ("size", "told"),
    [((1280, 720), "paths may be wrong by 25 %;"), ((720, 1280), "paths may be wrong by 15 %;")],
)
def test_a_path_is_as_wrong_as_the_lens_that_is_assumed(motion, size, told):
    """An upright picture is a phone's, whose lens is known better than others."""
    footage = SimpleNamespace(
        zoom=None,
        timestamps=motion.timestamps,
        world_from_camera=None,
        camera=assumed_camera(*size, size),
    )
    solved = SimpleNamespace(travel_source=FLOOR, motions=[motion], contradictions=[None])
    (found,) = camera_warnings("made.mp4", footage, solved)
    assert found.code == "travel_by_lens"
    assert told in str(found)


VALUES = {each.name: each.default for each in options_at(Place.WORKER)}
TIMES = [
    {"start": "5"},
    {"start": "00:00:01:00"},
    {"fps": "9"},
    {"speed": 8.0},
    {"treadmill": True},
]


def unused(path, **given):
    options = capture_options(VALUES | given)
    with open_video(path, options.wanted) as video:
        return [each.code for each in unused_option_warnings(video, options)]


@pytest.mark.parametrize("given", TIMES)
def test_what_has_no_effect_on_a_picture_is_said(tmp_path, given):
    cv2.imwrite(str(tmp_path / "a.png"), np.full((48, 64, 3), 90, np.uint8))
    assert unused(tmp_path / "a.png", **given) == ["range_of_image"]
    assert unused(tmp_path / "a.png", rotate="90", mirror=True, uneven_ground=True) == []


def test_a_sequence_of_pictures_has_times(tmp_path):
    for k in range(30):
        cv2.imwrite(str(tmp_path / f"a_{k}.png"), np.full((48, 64, 3), 90, np.uint8))
    for given in TIMES[2:]:
        assert unused(tmp_path / "a_#.png", **given) == []


def test_a_preset_that_ones_own_network_ignores_is_said(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), np.full((48, 64, 3), 90, np.uint8))
    own = {"keypoints": str(tmp_path / "mine.onnx")}
    assert unused(tmp_path / "a.png", quality="fast", **own) == ["preset_of_own_network"]
    assert unused(tmp_path / "a.png", **own) == []
    assert unused(tmp_path / "a.png", quality="fast") == []


COARSE = np.random.default_rng(1).integers(0, 256, (9, 16, 3), dtype=np.uint8)
ROOM = cv2.resize(COARSE, (320, 180)).astype(float)


def changes_of(shown, noise=1.0):
    """The changes of pictures that show these moments of a man who walks through a room, after a
    compression that changes what stands still by the noise, of 255.
    """
    pictures = []
    for k, moment in enumerate(shown):
        picture = ROOM + noise * np.random.default_rng(k).normal(size=ROOM.shape)
        x = 40 + round(1.5 * moment)
        swing = round(12 * np.sin(0.2 * moment))
        picture[60:120, x : x + 20] = [200, 40, 40]
        picture[120:160, x + swing : x + swing + 10] = [30, 30, 90]
        pictures.append(picture)
    return changes_between(pictures)


def with_hand(lefts):
    """Pictures of the room with a hand before it, from these columns on; its edges are six pixels
    wide.
    """
    columns = np.arange(320)
    noise = np.random.default_rng(2).normal(size=(7, *ROOM.shape))
    pictures = ROOM + noise[np.arange(len(lefts)) % len(noise)]
    for picture, left in zip(pictures, lefts, strict=True):
        covers = np.clip(np.minimum(columns - left, left + 20 - columns) / 6 + 0.5, 0, 1)
        hand = picture[80:110]
        hand += covers[:, None] * ([200, 150, 120] - hand)
    return pictures


def changes_between(pictures):
    shown = [np.clip(picture, 0, 255).astype(np.uint8) for picture in pictures]
    cuts = SceneCuts(RATE)
    for picture, upcoming in zip(shown, [*shown[1:], None], strict=True):
        cuts.is_cut(picture, upcoming)
    return np.array(cuts.changes)


@pytest.mark.parametrize(
    ("fps", "shown_fps"),
    [(60.0, 30.0), (30.0, 10.0), (30.0, 24.0), (60.0, 50.0), (60.0, 40.0), (24.0, 20.0)]
    + [(29.97, 23.976), (59.94, 29.97), (60.0, 15.0), (60.0, 10.0)],
)
def test_frames_that_repeat_the_one_before_are_said(fps, shown_fps):
    """Of a video converted from a lower rate, usual or not; at the rate that is proposed, no frame
    repeats, and no lower one divides the frames so.
    """
    shown = np.floor(np.arange(120) / fps * shown_fps + 1e-6) * fps / shown_fps
    (warning,) = repetition_warnings("a.mp4", fps, changes_of(shown))
    assert warning.code == "repeated_frames"
    repeated = 100 * (1 - shown_fps / fps)
    assert warning.values["percent"] == pytest.approx(repeated, abs=6)
    every = round(fps / warning.values["rate"])
    assert warning.values["rate"] == pytest.approx(fps / every)
    assert (np.diff(shown[::every]) > 1e-6).all()
    assert every - 1 < fps / shown_fps + 1e-3


@pytest.mark.parametrize("shown", [np.arange(120), np.zeros(120), np.r_[:60, [59] * 15, 60:105]])
def test_somebody_who_moves_stands_or_pauses_repeats_no_frames(shown):
    assert repetition_warnings("a.mp4", 30.0, changes_of(shown)) == []


@pytest.mark.parametrize("fps", [5.0, 10.0, 15.0, 24.0, 60.0])
@pytest.mark.parametrize("still_s", [0.0, 0.1, 0.5, 2.0])
def test_somebody_who_stops_and_goes_on_is_no_frozen_picture(fps, still_s):
    """Within a sixth of a second, which is sudden."""
    ramp = np.linspace(1.0, 0.0, round(fps / 6))
    walk = np.ones(round(fps))
    speeds = np.r_[walk, ramp, np.zeros(round(fps * still_s)), ramp[::-1], walk]
    changes = changes_between(with_hand(60.0 + 40.0 * np.cumsum(speeds) / fps))
    assert freeze_warnings("a.mp4", changes, np.arange(len(changes)) / fps, []) == []


@pytest.mark.parametrize("goes_on", [60, 80])  # as it would have, or where it is by then
@pytest.mark.parametrize("fps", [24.0, 60.0])
def test_a_picture_that_freezes_amid_motion_is_said(fps, goes_on):
    count = round(0.5 * fps)
    changes = changes_of(np.r_[:60, [59] * count, goes_on : goes_on + 60])
    times_s = 2.0 + np.arange(len(changes)) / fps
    assert repetition_warnings("a.mp4", fps, changes) == []
    (warning,) = freeze_warnings("a.mp4", changes, times_s, [])
    assert warning.code == "frozen_frames"
    assert warning.values["times"] == [pytest.approx(2.0 + 59 / fps)]
    assert warning.values["longest_s"] == pytest.approx(0.5)


def test_a_title_between_two_scenes_is_no_frozen_picture():
    walk = with_hand(60 + 2.0 * np.arange(60))
    title = np.full((60, *ROOM.shape), 20.0)
    title[:, 60:100, 80:240] = 240.0
    changes = changes_between([*walk, *title, *(picture[:, ::-1] for picture in walk)])
    times_s = np.arange(len(changes)) / RATE
    assert freeze_warnings("a.mp4", changes, times_s, []) != []
    assert freeze_warnings("a.mp4", changes, times_s, times_s[[60, 120]].tolist()) == []


@pytest.mark.parametrize(("fps", "hz"), [(30.0, 1.5), (30.0, 2.5), (60.0, 5.0)])
@pytest.mark.parametrize("form", [np.sin, lambda turn: np.arcsin(np.sin(turn))])
@pytest.mark.parametrize("reach", [10.0, 30.0])
def test_a_hand_that_waves_before_a_room_repeats_no_frames(fps, hz, form, reach):
    """Though it stands still for a moment at the end of each stroke, or turns back between two
    frames.
    """
    turns = 2 * np.pi * hz * (np.arange(120) + 0.5) / fps
    changes = changes_between(with_hand(160 + reach * form(turns)))
    assert repetition_warnings("a.mp4", fps, changes) == []
    assert freeze_warnings("a.mp4", changes, np.arange(len(changes)) / fps, []) == []


def test_what_compression_does_to_somebody_who_stands_repeats_no_frames():
    """Of 255, in the first second of a squat that a phone filmed at 60 frames per second."""
    changes = [14, 10, 19, 12, 19, 12, 9, 9, 4, 8, 5, 4, 2, 2, 15, 15, 2, 2, 2, 2, 9, 9, 2, 2, 15]
    assert repetition_warnings("a.mp4", 60.0, np.array(4 * changes, float)) == []


@pytest.mark.parametrize(("fps", "shown_fps"), [(30.0, 24.0), (60.0, 15.0)])
def test_frames_repeat_too_where_somebody_stands_now_and_then(fps, shown_fps):
    moments = np.r_[:60, [59] * 60, 60:120]
    shown = moments[np.floor(np.arange(180) / fps * shown_fps).astype(int) * 2 % 180]
    (warning,) = repetition_warnings("a.mp4", fps, changes_of(shown))
    assert warning.values["percent"] == pytest.approx(100 * (1 - shown_fps / fps), abs=8)
