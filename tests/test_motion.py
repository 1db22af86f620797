# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion file: a saved motion loads unchanged, and damaged files are errors."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.errors import MotionFileError, OutputError
from scope.scope_addon.motion import FACE_KEYS, SIGMA_KEYS, VIEW_KEYS, Motion
from scope.scope_addon.scene_gaps import SCENE_GAP_S
from scope.solver.body_file import load_body

from .made_motion import made_face, made_motion, made_views


def make_motion():
    rng = np.random.default_rng(0)
    poses, trans, joints = (rng.normal(size=(4, *shape)) for shape in ((72,), (3,), (24, 3)))
    return made_motion(load_body("scope"), poses, trans, rate=30000 / 1001, joints_cam=joints)


def test_a_saved_motion_loads_the_same(tmp_path):
    motion = make_motion()
    motion.save(tmp_path / "a.npz")
    back = Motion.load(tmp_path / "a.npz")
    for name, value in vars(motion).items():
        got = getattr(back, name)
        assert np.array_equal(got, value, equal_nan=name in (*SIGMA_KEYS, "height_sigma_m")), name
        assert getattr(got, "dtype", None) == getattr(value, "dtype", None), name
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def test_the_file_contains_plain_arrays_with_the_documented_names_and_types(tmp_path):
    make_motion().save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz", allow_pickle=False) as file:
        types = {
            k: file[k].dtype.kind + str(file[k].dtype.itemsize)
            for k in file.files
            if file[k].dtype.kind != "U"
        }
    assert types["poses"] == types["trans"] == types["betas"] == types["joints_cam"] == "f4"
    assert types["frames"] == "i8"
    assert (
        types["timestamps"]
        == types["mocap_framerate"]
        == types["world_from_camera"]
        == types["intrinsics"]
        == "f8"
    )
    assert types["valid"] == "b1"


def test_a_wrong_shape_is_named():
    motion = make_motion()
    motion.trans = np.zeros((5, 3), np.float32)
    with pytest.raises(MotionFileError, match=r"trans must have shape \(4, 3\), but has \(5, 3\)"):
        motion.validate()


@pytest.mark.parametrize("wrong", [{"footage_rotation": 45}, {"footage_speed": 0.0}])
def test_a_turn_or_speed_that_no_footage_has_is_refused(wrong):
    with pytest.raises(MotionFileError, match="a multiple of 90, and footage_speed above 0"):
        replace(make_motion(), **wrong).validate()


def test_pickles_are_never_loaded(tmp_path):
    class Bomb:
        def __reduce__(self):
            return (open, (str(tmp_path / "boom"), "w"))

    np.savez(tmp_path / "evil.npz", poses=np.array([Bomb()], dtype=object))
    (tmp_path / "evil2.npz").write_bytes(pickle.dumps(Bomb()))
    for name in ("evil.npz", "evil2.npz"):
        with pytest.raises(MotionFileError):
            Motion.load(tmp_path / name)
    assert not (tmp_path / "boom").exists()


def test_a_missing_key_is_named(tmp_path):
    np.savez(tmp_path / "thin.npz", poses=np.zeros((1, 72)))
    with pytest.raises(MotionFileError, match="lacks .*trans"):
        Motion.load(tmp_path / "thin.npz")


def test_starts_of_scenes_are_saved_and_loaded_and_absent_where_there_is_no_cut(tmp_path):
    motion = make_motion()
    motion.save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as file:
        assert "scene_starts" not in file.files
    assert Motion.load(tmp_path / "a.npz").scenes == [slice(0, 4)]
    replace(motion, scene_starts=[1, 3]).save(tmp_path / "b.npz")
    back = Motion.load(tmp_path / "b.npz")
    assert back.scene_starts.tolist() == [1, 3]
    assert back.scenes == [slice(0, 1), slice(1, 3), slice(3, 4)]
    np.testing.assert_allclose(
        back.times_with_gaps - back.timestamps, SCENE_GAP_S * np.array([0, 1, 1, 2])
    )


@pytest.mark.parametrize("rows", [[0], [4], [2, 2]])
def test_starts_of_scenes_that_are_no_rows_in_order_are_refused(rows):
    with pytest.raises(MotionFileError, match="scene_starts must be rows from 1 to 3"):
        replace(make_motion(), scene_starts=rows)


def test_a_zoom_is_saved_and_loaded_and_absent_where_the_lens_does_not_zoom(tmp_path):
    motion = make_motion()
    motion.save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as file:
        assert "zoom" not in file.files
    np.testing.assert_array_equal(motion.intrinsics_of_frames[3], motion.intrinsics)
    replace(motion, zoom=[1.0, 1.5, 2.0, 2.0]).save(tmp_path / "b.npz")
    loaded = Motion.load(tmp_path / "b.npz")
    np.testing.assert_array_equal(loaded.zoom, [1.0, 1.5, 2.0, 2.0])
    K = loaded.intrinsics
    expected = [[2 * K[0, 0], 0, K[0, 2]], [0, 2 * K[1, 1], K[1, 2]], [0, 0, 1]]
    np.testing.assert_array_equal(loaded.intrinsics_of_frames[2], expected)
    for wrong in ([1.0, 2.0], *([1.0, z, 1.0, 1.0] for z in (np.nan, 1e30, 1e-30))):
        with pytest.raises(MotionFileError, match="zoom must have a ratio of focal lengths"):
            replace(motion, zoom=wrong)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("image_size", [640, -480]),
        ("intrinsics", np.zeros((3, 3))),
        ("intrinsics", np.full((3, 3), np.inf)),
    ],
)
def test_a_camera_that_none_can_be_is_an_error(tmp_path, key, value):
    make_motion().save(tmp_path / "a.npz")
    arrays = dict(np.load(tmp_path / "a.npz"))
    np.savez(tmp_path / "a.npz", **arrays | {key: np.asarray(value)})
    with pytest.raises(MotionFileError, match="focal lengths and sides above 0"):
        Motion.load(tmp_path / "a.npz")


def test_a_file_that_lacks_what_every_motion_has_is_an_error(tmp_path):
    make_motion().save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as file:
        arrays = dict(file)
    for name in arrays:
        np.savez(tmp_path / "b.npz", **{key: arrays[key] for key in arrays if key != name})
        with pytest.raises(MotionFileError, match=rf"b\.npz lacks {name}: "):
            Motion.load(tmp_path / "b.npz")


def test_an_unwritable_folder_is_an_output_error_and_keeps_the_earlier_file(tmp_path):
    with pytest.raises(OutputError, match="nowhere"):
        make_motion().save(tmp_path / "nowhere" / "a.npz")


def test_a_face_is_saved_and_loaded_and_absent_where_it_was_not_looked_for(tmp_path):
    motion = make_motion()
    motion.save(tmp_path / "without.npz")
    assert not set(np.load(tmp_path / "without.npz")) & set(FACE_KEYS)
    assert Motion.load(tmp_path / "without.npz").face == {}
    face = made_face(4, jawOpen=[0.0, 0.25, 0.5, 1.0])
    replace(motion, face=face).save(tmp_path / "with.npz")
    loaded = Motion.load(tmp_path / "with.npz")
    assert set(loaded.face) == set(FACE_KEYS)
    for key, value in face.items():
        np.testing.assert_array_equal(loaded.face[key], value)
    assert loaded.face["expressions"].dtype == np.float32


def test_further_cameras_are_saved_and_loaded_and_absent_where_there_was_one(tmp_path):
    make_motion().save(tmp_path / "one.npz")
    assert not set(np.load(tmp_path / "one.npz")) & set(VIEW_KEYS)
    views = made_views(0.5, -0.25)
    replace(make_motion(), views=views).save(tmp_path / "three.npz")
    loaded = Motion.load(tmp_path / "three.npz")
    assert loaded.view_count == 2
    for key, value in views.items():
        np.testing.assert_array_equal(loaded.views[key], value)


def test_a_further_camera_sees_the_same_people_at_its_own_time():
    motion = replace(
        make_motion(), joints_cam=np.full((4, 24, 3), [0.1, 0.2, 4.5]), views=made_views(0.5)
    )
    seen = motion.from_view(0)
    # The camera is on a circle about the point 4 m before the first one, and looks at it.
    c, s = np.cos(1.0), np.sin(1.0)
    np.testing.assert_allclose(
        seen.joints_cam[0, 0], [0.1 * c + 0.5 * s, 0.2, 4.0 - 0.1 * s + 0.5 * c], atol=1e-6
    )
    first = np.einsum("tij,tkj->tki", motion.world_from_camera[:, :3, :3], motion.joints_cam)
    other = np.einsum("tij,tkj->tki", seen.world_from_camera[:, :3, :3], seen.joints_cam)
    np.testing.assert_allclose(
        other + seen.world_from_camera[:, None, :3, 3],
        first + motion.world_from_camera[:, None, :3, 3],
        atol=1e-5,
    )
    np.testing.assert_allclose(seen.timestamps, motion.timestamps + 0.5)
    np.testing.assert_array_equal(seen.frames, np.round((motion.timestamps + 0.5) * 60))
    assert seen.source == "walk2.mp4"
    assert seen.view_count == 0


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("gaze", None, "lacks gaze"),
        ("expressions", np.zeros((3, 52)), "expressions must have shape \\(4, 52\\)"),
        ("expression_confidence", np.full(4, np.nan), "not finite"),
        ("expressions", np.array("x"), "wrong kind"),
        ("view_dist", None, "lacks view_dist"),
        ("view_offsets_s", np.zeros(3), "view_offsets_s must have shape \\(1,\\)"),
        ("view_offsets_s", np.array([np.nan]), "not finite"),
        ("view_from_camera", np.ones((1, 4, 4)), "rotations and translations"),
        ("view_from_camera", np.eye(4)[None] + 1e300 * np.eye(4, k=3), "below 1e"),
        ("view_frame_rates", np.zeros(1), "above 0"),
        ("view_offsets_s", np.array([-1e300]), "below 1e"),
        ("view_intrinsics", np.zeros((1, 3, 3)), "focal lengths and sides above 0"),
    ],
)
def test_a_damaged_face_or_further_camera_is_an_error_that_names_it(tmp_path, key, value, message):
    replace(make_motion(), face=made_face(4), views=made_views(0.5)).save(tmp_path / "a.npz")
    arrays = dict(np.load(tmp_path / "a.npz"))
    del arrays[key]
    np.savez(tmp_path / "a.npz", **arrays, **({} if value is None else {key: value}))
    with pytest.raises(MotionFileError, match=message):
        Motion.load(tmp_path / "a.npz")


def test_a_motion_of_more_cameras_than_anybody_has_is_refused():
    views = {name: np.repeat(value, 101, axis=0) for name, value in made_views(0.5).items()}
    with pytest.raises(MotionFileError, match="101 further cameras; at most 100"):
        replace(make_motion(), views=views)
