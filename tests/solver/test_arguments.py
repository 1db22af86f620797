# SPDX-License-Identifier: GPL-3.0-or-later
"""Every public function of the solver, with every wrong kind of value for each of its arguments in
turn.

What cannot be used is refused by an error of the solver's own, in a sentence; nothing fails inside
of numpy or Python. Some values can be used: a list for an array, or True for a switch.
"""

import warnings
from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scope import solver
from scope.solver import (
    Floor,
    FootContacts,
    FrameSolver,
    Keypoints2D,
    Keypoints3D,
    Measurements,
    MotionPrior,
    Options,
    OrientationField,
    PosePriors,
    Priors,
    ScopeError,
    Stage,
    StandingPoints,
    State,
    Temporal,
    View,
    Weights,
    rotations,
)
from scope.solver.learned_prior import BUILT_IN
from scope.solver.residuals import external

from .small_problem import BODY, KEYPOINTS, POINTS, SEEN, K, M, P
from .synthetic import INTRINSICS, project

NAN = float("nan")
SHORT = Options(stages=[Stage(max_iterations=1)])
PRIORS = Priors()
UP = np.array([0.0, -1.0, 0.0])
TURN = np.eye(3)


class _Odd:
    """An object of no kind that any argument takes."""


WRONG: dict[str, Any] = {
    "None": None,
    "a text": "text",
    "bytes": b"text",
    "an empty text": "",
    "a long text": 5000 * "a",
    "a text with NUL": "a\0b",
    "a ragged list": [[1.0], [1.0, 2.0]],
    "NaN": NAN,
    "infinity": float("inf"),
    "negative": -1,
    "zero": 0,
    "True": True,
    "a fraction": 1.5,
    "a huge number": 10**400,
    "complex": 1j,
    "an empty list": [],
    "an empty array": np.zeros(0),
    "an array without axes": np.array(1.0),
    "one number in a list": [1.0],
    "an array of texts": np.array(["a", "b"]),
    "an array of None": np.array([None, None]),
    "an array of NaN": np.full((2, 3), NAN),
    "another shape": np.ones((2, 2, 2, 2)),
    "complex numbers": np.ones((3, 3), complex),
    "a dict": {},
    "a dict of text": {"a": "b"},
    "a set": {1},
    "a generator": (k for k in ""),
    "a class": int,
    "an object": _Odd(),
    "a list of None": [None],
    "a list of text": ["a"],
}


@cache
def _built_in() -> Any:
    return solver.load_body()


@cache
def _fitted() -> Any:
    return solver.fit(BODY, SEEN, priors=PRIORS, options=SHORT)


@cache
def _tree() -> Any:
    return solver.make_tree(BODY)


def _rest() -> tuple[Any, Any]:
    """Return part poses (2, K+1, 3, 3), (2, K+1, 3) of two frames of the built-in body."""
    parts = _built_in().K + 1
    return _built_in().forward_kinematics(np.tile(np.eye(3), (2, parts, 1, 1)), np.zeros((2, 3)))


def _posed() -> dict[str, Any]:
    """Return the part poses of one frame of the built-in body, and its shape."""
    R, t = _rest()
    return {"R": R[0], "t": t[0], "betas": np.zeros(_built_in().P)}


def _chain() -> dict[str, Any]:
    parts = _built_in().K + 1
    return {
        "rotations": np.tile(TURN, (parts, 1, 1)),
        "trans": np.zeros(3),
        "betas": np.zeros(_built_in().P),
    }


@cache
def _joint_prior() -> Any:
    return solver.load_joint_prior()


def _used_prior(**arguments: Any) -> Any:
    prior = solver.JointPrior(**arguments)
    return prior.of(prior.names[0]) if len(prior.names) else prior


def _seen(**kinds: Any) -> Any:
    """Fit a frame of 3D keypoints and other measurements."""
    return solver.fit(BODY, replace(SEEN, **kinds), priors=PRIORS, options=SHORT)


def _known(**kinds: Any) -> Any:
    return solver.fit(BODY, SEEN, priors=Priors(**kinds), options=SHORT)


def _moved(**arguments: Any) -> Any:
    given: dict[str, Any] = {"body": BODY, "frames": [SEEN, SEEN], "times": [0.0, 1.0]}
    given |= {"priors": PRIORS, "options": SHORT} | arguments
    return solver.fit_motion(given.pop("body"), given.pop("frames"), given.pop("times"), **given)


def _evaluated(part: Any, ints: Any, floats: Any) -> Any:
    return part.t[ints[0]] - floats


def _checked(**arguments: Any) -> Any:
    solver.register_residual("test_arguments", ints=1, floats=3, function=_evaluated)
    return solver.check_residual(**({"body": BODY, "name": "test_arguments"} | arguments))


def _calls() -> dict[str, Callable[[], tuple[Callable[..., Any], dict[str, Any]]]]:
    """Return by name what makes a call: a function, and arguments that it takes. Nothing is loaded
    or fitted before.
    """
    rest = State.rest(K, P)
    motion = {
        "body": BODY,
        "frames": [SEEN, SEEN],
        "times": np.arange(2) / 30.0,
        "init": [rest, rest],
    }
    motion |= {
        "priors": PRIORS,
        "options": SHORT,
        "motion": MotionPrior(),
        "stands": StandingPoints(),
    }
    motion |= {"shape": np.zeros(P), "focal": False, "focal_weight": 1.0, "covariance": False}
    motion |= {"window": 10.0, "overlap": 2.0}
    clip = {
        "body": BODY,
        "measurements": [SEEN, SEEN],
        "init": [rest, rest],
        "priors": PRIORS,
        "options": SHORT,
    }
    clip |= {"temporal": Temporal(), "focal": False, "focal_weight": 1.0, "shape_frames": 500}
    clips = {
        name: value
        for name, value in clip.items()
        if name not in ("measurements", "init", "shape_frames")
    }
    pixels = {"indices": np.arange(M), "pixels": project(POINTS), "confidence": np.ones(M)}
    lines = {"starts": [M], "ends": [M + 1], "directions": [[0.0, 1.0, 0.0]], "confidence": [1.0]}
    poses = {"parts": [0], "R_camera_part": [TURN], "t_camera_part": [[0.0, 0.0, 4.0]]}
    poses |= {"weight_rotation": [1.0], "weight_translation": [1.0]}
    contacts = {"indices": [0], "points": [[0.0, 0.0, 4.0]], "probability": [1.0]}
    floor = {"indices": [0], "normal": UP, "offset": -2.0, "contact": [1.0], "below": [1.0]}
    state = {
        "R_camera_root": TURN,
        "t_camera_root": np.ones(3),
        "Omega": np.tile(TURN, (K, 1, 1)),
        "beta": np.zeros(P),
    }
    view = {"measurements": SEEN, "R_camera_world": TURN, "t_camera_world": np.zeros(3)}
    information = {"shape_mean": np.zeros(P), "shape_information": np.eye(P)}
    joints = {
        "joint_mean": np.tile(TURN, (K, 1, 1)),
        "joint_weights": np.ones(K),
        "limits": None,
        "flow": None,
    }
    smooth = {f.name: getattr(MotionPrior(), f.name) for f in fields(MotionPrior)}
    stand = {"indices": [0], "probability": [[1.0], [1.0]]}
    arrays = {f.name: getattr(BODY, f.name) for f in fields(BODY)}
    vectors = {"phi": np.ones(3)}
    matrices = {"rotation": TURN}
    own = {
        "name": "test_arguments",
        "ints": 1,
        "floats": 1,
        "indexes": "parts",
        "kernel": None,
        "function": _evaluated,
    }
    return {
        "load_body": lambda: (solver.load_body, {"which": "scope"}),
        "load_joint_prior": lambda: (solver.load_joint_prior, {"path": BUILT_IN}),
        "fit": lambda: (
            solver.fit,
            {"body": BODY, "measurements": SEEN, "init": rest, "priors": PRIORS, "options": SHORT},
        ),
        "fit, 2D keypoints": lambda: (
            lambda **a: _seen(intrinsics=INTRINSICS, keypoints2d=Keypoints2D(**a)),
            pixels,
        ),
        "fit, intrinsics": lambda: (
            lambda K: _seen(intrinsics=K, keypoints2d=Keypoints2D(**pixels)),
            {"K": INTRINSICS},
        ),
        "fit, 3D keypoints": lambda: (
            lambda **a: _seen(keypoints3d=Keypoints3D(**a)),
            vars(KEYPOINTS),
        ),
        "fit, directions": lambda: (
            lambda **a: _seen(orientation_field=OrientationField(**a)),
            lines,
        ),
        "fit, pose priors": lambda: (lambda **a: _seen(pose_priors=PosePriors(**a)), poses),
        "fit, contacts": lambda: (lambda **a: _seen(foot_contacts=FootContacts(**a)), contacts),
        "fit, floor": lambda: (lambda **a: _seen(floor=Floor(**a)), floor),
        "fit, tables": lambda: (
            lambda rows: _seen(tables={"joint_limits": rows}),
            {"rows": ([[1]], np.ones((1, 8)))},
        ),
        "fit, shape prior": lambda: (_known, information),
        "fit, joint prior": lambda: (_known, joints),
        "fit, state": lambda: (
            lambda **a: solver.fit(BODY, SEEN, init=State(**a), priors=PRIORS, options=SHORT),
            state,
        ),
        "fit, body": lambda: (
            lambda **a: solver.fit(replace(BODY, **a), SEEN, priors=PRIORS, options=SHORT),
            arrays,
        ),
        "Measurements": lambda: (
            Measurements,
            {f.name: getattr(SEEN, f.name) for f in fields(Measurements)},
        ),
        "Weights": lambda: (Weights, {f.name: getattr(Weights(), f.name) for f in fields(Weights)}),
        "Stage": lambda: (Stage, {f.name: getattr(Stage(), f.name) for f in fields(Stage)}),
        "Options": lambda: (
            lambda **a: _moved(options=Options(**a)),
            {f.name: getattr(SHORT, f.name) for f in fields(Options)},
        ),
        "Temporal": lambda: (Temporal, vars(Temporal())),
        "FrameSolver": lambda: (FrameSolver, {"body": BODY, "priors": PRIORS, "options": SHORT}),
        "FrameSolver.fit": lambda: (
            FrameSolver(BODY, PRIORS, SHORT).fit,
            {"measurements": SEEN, "init": rest, "priors": PRIORS, "options": SHORT},
        ),
        "fit_tree": lambda: (
            solver.fit_tree,
            {
                "tree": _tree(),
                "measurements": SEEN,
                "init": rest,
                "priors": PRIORS,
                "options": SHORT,
            },
        ),
        "fit_batch": lambda: (
            solver.fit_batch,
            {
                "body": BODY,
                "measurements": [SEEN],
                "init": [rest],
                "priors": PRIORS,
                "options": SHORT,
                "threads": 1,
            },
        ),
        "fit_clip": lambda: (solver.fit_clip, clip),
        "fit_clips": lambda: (solver.fit_clips, clips | {"clips": [[SEEN]], "threads": 1}),
        "fit_motion": lambda: (solver.fit_motion, motion),
        "fit_motion, view": lambda: (lambda **a: _moved(frames=[[View(**a)]], times=[0.0]), view),
        "fit_motion, motion": lambda: (lambda **a: _moved(motion=MotionPrior(**a)), smooth),
        "fit_motion, stands": lambda: (lambda **a: _moved(stands=StandingPoints(**a)), stand),
        "with_previous": lambda: (
            solver.with_previous,
            {"measurements": SEEN, "previous": rest, "temporal": Temporal()},
        ),
        "with_previous, state": lambda: (
            lambda **a: solver.with_previous(SEEN, State(**a), Temporal()),
            state,
        ),
        "carry": lambda: (
            solver.carry,
            {"priors": PRIORS, "fitted": _fitted(), "shape_weight": 100.0},
        ),
        "make_tree": lambda: (solver.make_tree, {"body": BODY, "focal": True}),
        "default_priors": lambda: (solver.default_priors, {"body": BODY}),
        "register_residual": lambda: (solver.register_residual, own),
        "check_residual": lambda: (
            _checked,
            {"body": BODY, "name": "test_arguments", "ints": [[1]], "floats": np.ones((1, 3))},
        ),
        "check_residual, seed": lambda: (
            lambda seed: _checked(ints=[[1]], floats=np.ones((1, 3)), seed=seed),
            {"seed": 0},
        ),
        "State.rest": lambda: (State.rest, {"K": K, "P": P, "distance": 3.0}),
        "State.pose": lambda: (lambda tree: rest.pose(tree), {"tree": _tree()}),
        "JointPrior": lambda: (
            _used_prior,
            {"names": ("pelvis", "neck"), "parameters": _joint_prior().parameters[:2]},
        ),
        "JointPrior.of": lambda: (_joint_prior().of, {"joint": "neck"}),
        "JointPrior.tables": lambda: (
            _joint_prior().tables,
            {"joint_names": ["pelvis", "neck"], "weights": {}},
        ),
        "JointPrior.sample": lambda: (
            _joint_prior().sample,
            {"joint": "neck", "count": 2, "rng": np.random.default_rng(0)},
        ),
        "JointPrior.log_density": lambda: (
            _joint_prior().log_density,
            {"joint": "neck", "Omega": TURN},
        ),
        "Body.keypoint_set": lambda: (_built_in().keypoint_set, {"prefix": "coco"}),
        "Body.rest_joints": lambda: (_built_in().rest_joints, {"betas": None}),
        "Body.rest_vertices": lambda: (_built_in().rest_vertices, {"betas": None}),
        "Body.stature": lambda: (_built_in().stature, {"betas": None}),
        "Body.forward_kinematics": lambda: (_built_in().forward_kinematics, _chain()),
        "Body.skin": lambda: (_built_in().skin, _posed()),
        "Body.keypoints": lambda: (_built_in().keypoints, _posed() | {"which": [0, 1]}),
        "rotations.hat": lambda: (rotations.hat, vectors),
        "rotations.exp": lambda: (rotations.exp, vectors),
        "rotations.log": lambda: (rotations.log, matrices),
        "rotations.left_jacobian": lambda: (rotations.left_jacobian, vectors),
        "rotations.left_jacobian_inverse": lambda: (rotations.left_jacobian_inverse, vectors),
        "rotations.quaternion_from_matrix": lambda: (rotations.quaternion_from_matrix, matrices),
        "rotations.matrix_from_quaternion": lambda: (
            rotations.matrix_from_quaternion,
            {"quaternion": [1.0, 0.0, 0.0, 0.0]},
        ),
        "rotations.nearest_rotation": lambda: (rotations.nearest_rotation, {"matrix": TURN}),
        "rotations.shortest_turn": lambda: (rotations.shortest_turn, {"a": UP, "b": -UP}),
    }


CALLS = _calls()


@pytest.fixture(autouse=True)
def own_residuals(monkeypatch):
    """Put back what other tests have registered, of which there may be no more."""
    monkeypatch.setattr(external, "_external", {})


@pytest.mark.parametrize("name", CALLS)
def test_a_wrong_argument_is_refused_in_a_sentence_of_the_solvers_own(name):
    function, arguments = CALLS[name]()
    function(**arguments)
    bare = []
    for argument in arguments:
        for kind, value in WRONG.items():
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                try:
                    function(**(arguments | {argument: value}))
                except ScopeError as error:
                    if len(str(error)) < 25:
                        bare.append(f"{argument}, {kind}: too short: {error}")
                except Exception as error:
                    bare.append(f"{argument}, {kind}: {type(error).__name__}: {error}")
    assert not bare, "\n".join(["", *bare])


@pytest.mark.parametrize("one", [np.float32(0.5), np.array(0.5), np.int64(1), np.ma.array(0.5)])
def test_one_confidence_for_all_may_be_any_number_of_numpys(one):
    seen = replace(SEEN, keypoints3d=replace(KEYPOINTS, confidence=one))
    each = replace(SEEN, keypoints3d=replace(KEYPOINTS, confidence=np.full(M, float(one))))
    found, expected = (solver.fit(BODY, m) for m in (seen, each))
    np.testing.assert_array_equal(found.t_camera_part, expected.t_camera_part)
    nothing = replace(SEEN, keypoints3d=replace(KEYPOINTS, confidence=np.ma.masked))
    assert solver.fit(BODY, nothing).measurements == 0
