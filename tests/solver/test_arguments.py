# SPDX-License-Identifier: GPL-3.0-or-later
"""Every public function of the solver, with every wrong kind of value for each of its arguments in
turn.

What cannot be used is refused by an error of the solver's own, in a sentence; nothing fails inside
of numpy or Python. Some values can be used: a list for an array, or True for a switch.
"""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scope import solver
from scope.solver import (
    Fit,
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
    Status,
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


WRONG: dict[str, Any] = {
    "None": None,
    "a text": "text",
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
    "an array without axes": np.array(1.0),
    "an array of texts": np.array(["a", "b"]),
    "an array of NaN": np.full((2, 3), NAN),
    "another shape": np.ones((2, 2, 2, 2)),
    "a dict": {},
    "a generator": (k for k in ""),
    "a list of None": [None],
    "a list of text": ["a"],
}


NAMED = solver.load_body()
TREE = solver.make_tree(BODY)
PRIOR = solver.load_joint_prior()
REST = State.rest(K, P)
R, t = NAMED.forward_kinematics(np.tile(TURN, (NAMED.K + 1, 1, 1)), np.zeros(3))
FITTED = Fit(REST, Status.CONVERGED, 1.0, 1, R, t, np.eye(P), M)


def _used_prior(**arguments: Any) -> Any:
    prior = solver.JointPrior(**arguments)
    return prior.of(prior.names[0]) if len(prior.names) else prior


def _fit(**arguments: Any) -> Any:
    """Fit a frame, shortly unless told otherwise."""
    given = {"body": BODY, "measurements": SEEN, "priors": PRIORS, "options": SHORT} | arguments
    return solver.fit(given.pop("body"), given.pop("measurements"), **given)


def _seen(name: str, kind: Callable[..., Any]) -> Callable[..., Any]:
    """Return what fits a frame of 3D keypoints and another kind of measurement."""
    return lambda **a: _fit(measurements=replace(SEEN, intrinsics=INTRINSICS, **{name: kind(**a)}))


def _moved(**arguments: Any) -> Any:
    given: dict[str, Any] = {"body": BODY, "frames": [SEEN, SEEN], "times": [0.0, 1.0]}
    given |= {"priors": PRIORS, "options": SHORT} | arguments
    return solver.fit_motion(given.pop("body"), given.pop("frames"), given.pop("times"), **given)


def _evaluated(part: Any, ints: Any, floats: Any) -> Any:
    return part.t[ints[0]] - floats


def _checked(**arguments: Any) -> Any:
    solver.register_residual("test_arguments", ints=1, floats=3, function=_evaluated)
    return solver.check_residual(**({"body": BODY, "name": "test_arguments"} | arguments))


HOW: dict[str, Any] = {"priors": PRIORS, "options": SHORT}
CLIPS = {"body": BODY, "focal": False, "focal_weight": 1.0} | HOW
PIXELS = {"indices": np.arange(M), "pixels": project(POINTS), "confidence": np.ones(M)}
STATE = {"R_camera_root": TURN, "t_camera_root": np.ones(3)}
STATE |= {"Omega": np.tile(TURN, (K, 1, 1)), "beta": np.zeros(P)}
POSED = {"R": R, "t": t, "betas": np.zeros(NAMED.P)}
VECTORS = {"phi": np.ones(3)}
MATRICES = {"rotation": TURN}
# By name a function, and arguments that it takes.
CALLS: dict[str, tuple[Callable[..., Any], Mapping[str, Any]]] = {
    "load_body": (solver.load_body, {"which": "scope"}),
    "load_joint_prior": (solver.load_joint_prior, {"path": BUILT_IN}),
    "fit": (solver.fit, {"body": BODY, "measurements": SEEN, "init": REST} | HOW),
    "fit, 2D keypoints": (_seen("keypoints2d", Keypoints2D), PIXELS),
    "fit, intrinsics": (
        lambda K: _fit(measurements=Measurements(K, Keypoints2D(**PIXELS))),
        {"K": INTRINSICS},
    ),
    "fit, 3D keypoints": (_seen("keypoints3d", Keypoints3D), vars(KEYPOINTS)),
    "fit, directions": (
        _seen("orientation_field", OrientationField),
        {"starts": [M], "ends": [M + 1], "directions": [[0.0, 1.0, 0.0]], "confidence": [1.0]},
    ),
    "fit, pose priors": (
        _seen("pose_priors", PosePriors),
        {
            "parts": [0],
            "R_camera_part": [TURN],
            "t_camera_part": [[0.0, 0.0, 4.0]],
            "weight_rotation": [1.0],
            "weight_translation": [1.0],
        },
    ),
    "fit, contacts": (
        _seen("foot_contacts", FootContacts),
        {"indices": [0], "points": [[0.0, 0.0, 4.0]], "probability": [1.0]},
    ),
    "fit, floor": (
        _seen("floor", Floor),
        {"indices": [0], "normal": UP, "offset": -2.0, "contact": [1.0], "below": [1.0]},
    ),
    "fit, tables": (
        lambda rows: _fit(measurements=replace(SEEN, tables={"joint_limits": rows})),
        {"rows": ([[1]], np.ones((1, 8)))},
    ),
    "fit, priors": (
        lambda **a: _fit(priors=Priors(**a)),
        {
            "joint_mean": np.tile(TURN, (K, 1, 1)),
            "joint_weights": np.ones(K),
            "shape_mean": np.zeros(P),
            "shape_information": np.eye(P),
            "limits": None,
            "flow": None,
        },
    ),
    "fit, state": (lambda **a: _fit(init=State(**a)), STATE),
    "fit, body": (lambda **a: _fit(body=replace(BODY, **a)), vars(BODY)),
    "Measurements": (Measurements, vars(SEEN)),
    "Weights": (Weights, vars(Weights())),
    "Stage": (Stage, vars(Stage())),
    "Options": (lambda **a: _moved(options=Options(**a)), vars(SHORT)),
    "FrameSolver": (FrameSolver, {"body": BODY} | HOW),
    "FrameSolver.fit": (FrameSolver(BODY, **HOW).fit, {"measurements": SEEN, "init": REST} | HOW),
    "fit_tree": (solver.fit_tree, {"tree": TREE, "measurements": SEEN, "init": REST} | HOW),
    "fit_batch": (
        solver.fit_batch,
        {"body": BODY, "measurements": [SEEN], "init": [REST], "threads": 1} | HOW,
    ),
    "fit_clip": (
        solver.fit_clip,
        CLIPS | {"measurements": [SEEN, SEEN], "init": [REST, REST], "shape_frames": 500},
    ),
    "fit_motion": (
        solver.fit_motion,
        {
            "body": BODY,
            "frames": [SEEN, SEEN],
            "times": np.arange(2) / 30.0,
            "init": [REST, REST],
            "motion": MotionPrior(),
            "stands": StandingPoints(),
            "shape": np.zeros(P),
            "focal": False,
            "focal_weight": 1.0,
            "covariance": False,
            "window": 10.0,
            "overlap": 2.0,
        }
        | HOW,
    ),
    "fit_motion, view": (
        lambda **a: _moved(frames=[[View(**a)]], times=[0.0]),
        {"measurements": SEEN, "R_camera_world": TURN, "t_camera_world": np.zeros(3)},
    ),
    "fit_motion, motion": (lambda **a: _moved(motion=MotionPrior(**a)), vars(MotionPrior())),
    "fit_motion, stands": (
        lambda **a: _moved(stands=StandingPoints(**a)),
        {"indices": [0], "probability": [[1.0], [1.0]]},
    ),
    "carry": (solver.carry, {"priors": PRIORS, "fitted": FITTED, "shape_weight": 100.0}),
    "make_tree": (solver.make_tree, {"body": BODY, "focal": True}),
    "default_priors": (solver.default_priors, {"body": BODY}),
    "register_residual": (
        solver.register_residual,
        {
            "name": "test_arguments",
            "ints": 1,
            "floats": 1,
            "indexes": "parts",
            "kernel": None,
            "function": _evaluated,
        },
    ),
    "check_residual": (
        _checked,
        {"body": BODY, "name": "test_arguments", "ints": [[1]], "floats": np.ones((1, 3))},
    ),
    "check_residual, seed": (
        lambda seed: _checked(ints=[[1]], floats=np.ones((1, 3)), seed=seed),
        {"seed": 0},
    ),
    "State.rest": (State.rest, {"K": K, "P": P, "distance": 3.0}),
    "State.pose": (REST.pose, {"tree": TREE}),
    "JointPrior": (
        _used_prior,
        {"names": ("pelvis", "neck"), "parameters": PRIOR.parameters[:2]},
    ),
    "JointPrior.of": (PRIOR.of, {"joint": "neck"}),
    "JointPrior.tables": (PRIOR.tables, {"joint_names": ["pelvis", "neck"], "weights": {}}),
    "JointPrior.sample": (
        PRIOR.sample,
        {"joint": "neck", "count": 2, "rng": np.random.default_rng(0)},
    ),
    "JointPrior.log_density": (PRIOR.log_density, {"joint": "neck", "Omega": TURN}),
    "Body.keypoint_set": (NAMED.keypoint_set, {"prefix": "coco"}),
    "Body.rest_joints": (NAMED.rest_joints, {"betas": None}),
    "Body.rest_vertices": (NAMED.rest_vertices, {"betas": None}),
    "Body.stature": (NAMED.stature, {"betas": None}),
    "Body.forward_kinematics": (
        NAMED.forward_kinematics,
        {"rotations": R, "trans": np.zeros(3), "betas": np.zeros(NAMED.P)},
    ),
    "Body.skin": (NAMED.skin, POSED),
    "Body.keypoints": (NAMED.keypoints, POSED | {"which": [0, 1]}),
    "rotations.hat": (rotations.hat, VECTORS),
    "rotations.exp": (rotations.exp, VECTORS),
    "rotations.log": (rotations.log, MATRICES),
    "rotations.quaternion_from_rotation_vector": (
        rotations.quaternion_from_rotation_vector,
        VECTORS,
    ),
    "rotations.quaternion_from_matrix": (rotations.quaternion_from_matrix, MATRICES),
    "rotations.matrix_from_quaternion": (
        rotations.matrix_from_quaternion,
        {"quaternion": [1.0, 0.0, 0.0, 0.0]},
    ),
    "rotations.nearest_rotation": (rotations.nearest_rotation, {"matrix": TURN}),
    "rotations.shortest_turn": (rotations.shortest_turn, {"a": UP, "b": -UP}),
}


@pytest.fixture(autouse=True)
def own_residuals(monkeypatch):
    """Put back what other tests have registered, of which there may be no more."""
    monkeypatch.setattr(external, "_external", {})


@pytest.mark.parametrize("name", CALLS)
def test_a_wrong_argument_is_refused_in_a_sentence_of_the_solvers_own(name):
    function, arguments = CALLS[name]
    function(**arguments)
    bare = []
    for argument in arguments:
        for kind, value in WRONG.items():
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                try:
                    function(**{**arguments, argument: value})
                except ScopeError as error:
                    if len(str(error)) < 25:
                        bare.append(f"{argument}, {kind}: too short: {error}")
                except Exception as error:
                    bare.append(f"{argument}, {kind}: {type(error).__name__}: {error}")
    assert not bare, "\n".join(["", *bare])


def test_one_confidence_for_all_may_be_any_number():
    def fitted(confidence: Any) -> Any:
        return _fit(
            measurements=Measurements(keypoints3d=replace(KEYPOINTS, confidence=confidence))
        )

    for one in (0.5, np.float32(0.5), np.array(0.5), np.int64(1), np.ma.array(0.5)):
        expected = fitted(np.full(M, float(one)))
        np.testing.assert_array_equal(fitted(one).t_camera_part, expected.t_camera_part)
    assert fitted(np.ma.masked).measurements == 0
