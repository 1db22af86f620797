# SPDX-License-Identifier: GPL-3.0-or-later
import bpy
import numpy as np
import pytest
from scope.scope_addon.errors import VideoError
from scope.scope_addon.scene import actions
from scope.scope_addon.scene.build import NEW_SCENE, BuildOptions, build_scene


@pytest.fixture
def doubtful(body, make_motion):
    """Sixty frames; 20-22 not seen, 40-44 far from the footage, with different confidences and
    contacts per joint.
    """
    motion = make_motion(body, 60)
    rng = np.random.default_rng(3)
    motion.joint_confidence[:] = rng.uniform(0.5, 1.0, motion.joint_confidence.shape)
    motion.foot_contact[:] = rng.uniform(0.0, 1.0, motion.foot_contact.shape)
    motion.valid[20:23] = False
    motion.residual_px[40:45] = 200.0
    return motion


def test_confidence_and_contact_follow_the_timeline(body, doubtful, blender):
    rig = build_scene([doubtful], body, options=NEW_SCENE).people[0].armature
    for t in (0, 17, 59):
        blender.go_to(t)
        posed = rig.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones
        seen = [posed[name]["confidence"] for name in body.joint_names]
        np.testing.assert_allclose(seen, doubtful.joint_confidence[t], atol=1e-6)
        ends = [
            posed[n]["contact"] for n in ("left_ankle", "left_foot", "right_ankle", "right_foot")
        ]
        np.testing.assert_allclose(ends, doubtful.foot_contact[t], atol=1e-6)
    assert "contact" not in rig.pose.bones["left_knee"]
    ui = rig.pose.bones["left_foot"].id_properties_ui("contact").as_dict()
    assert (ui["min"], ui["max"]) == (0.0, 1.0)


def test_deviations_follow_the_timeline_where_they_are_known(body, doubtful, blender):
    doubtful.joint_sigma_m[:] = np.random.default_rng(4).uniform(
        0.01, 0.2, doubtful.joint_sigma_m.shape
    )
    doubtful.joint_sigma_m[~doubtful.valid] = np.nan
    rig = build_scene([doubtful], body, options=NEW_SCENE).people[0].armature
    for t in (0, 17, 59):
        blender.go_to(t)
        posed = rig.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones
        shown = [posed[name]["sigma_cm"] for name in body.joint_names]
        np.testing.assert_allclose(shown, 100.0 * doubtful.joint_sigma_m[t], rtol=1e-5)
    (curve,) = [c for c in actions.fcurves(rig) if c.data_path == 'pose.bones["head"]["sigma_cm"]']
    assert len(curve.keyframe_points) == doubtful.valid.sum()
    assert curve.hide


def test_markers_at_review_spans(body, doubtful):
    scene = bpy.context.scene
    options = BuildOptions(frame_rate="set", start_frame=101)
    build_scene([doubtful], body, options=options)
    assert [(m.name, m.frame) for m in scene.timeline_markers] == [
        ("not seen 121-123", 121),
        ("check 141-145", 141),
    ]
    build_scene([doubtful], body, options=options)
    assert len(scene.timeline_markers) == 2
    build_scene([doubtful, doubtful], body, options=options)
    assert "person 2 check 141-145" in scene.timeline_markers


def test_no_markers_unless_requested_and_none_after_a_failure(body, doubtful, tmp_path):
    scene = bpy.context.scene
    scene.timeline_markers.new("mine", frame=7)
    build_scene([doubtful], body, options=BuildOptions(with_markers=False))
    with pytest.raises(VideoError):  # the camera comes after the markers
        build_scene([doubtful], body, footage=tmp_path / "gone.mp4")
    assert [m.name for m in scene.timeline_markers] == ["mine"]


def test_resampling_puts_a_key_on_every_frame_of_the_scene(body, make_motion, truth, blender):
    scene = bpy.context.scene
    scene.render.fps = 25
    scene.render.fps_base = 1.0
    motion = make_motion(body, 31, rate=30.0)
    result = build_scene([motion], body, options=BuildOptions(frame_rate="resample"))
    rig = result.people[0].armature
    path = actions.bone_path("left_hip", "rotation_quaternion")
    curve = next(c for c in actions.fcurves(rig) if c.data_path == path)
    np.testing.assert_array_equal(actions.read_keys(curve)[:, 0], np.arange(26))
    assert scene.render.fps == 25
    blender.go_to(20)  # 0.8 s: picture 24 of the footage
    joints = blender.joints(rig, body.joint_names)
    np.testing.assert_allclose(joints, truth(body, motion).joints[24], atol=1e-4)
