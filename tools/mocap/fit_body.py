# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit the default body to every take: ``python -m scope.tools.mocap.fit_body ARCHIVES -o
build/mocap/motions.npz``.

``--more SETS`` straightens the legs of CMU's takes, see ``straight_legs.py``, lets the body's knees
be straight, and appends the takes of ``position_sets.py``, so that the archives' takes keep their
numbers; ``--without`` leaves out a set, and ``--as-recorded`` leaves CMU's legs bent.

For each performer, one shape from the bone lengths; then, for each frame, the solver minimizes

    24000 Σ_j c_j |t_j − p̂_j|² + Σ_i w_i |log(R̂_iᵀ R_i)|² + joint limits + rest-pose prior

with p̂ and R̂ from ``retarget.py``. The offsets o_j are the performer's mean residual in a first
pass over some frames, in which rotations outweigh positions. The world has y up; poses and trans
follow SMPL's convention.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.atomic_write import atomic_path
from ...scope_addon.untrusted.body_file import load_body
from ...solver import (
    Keypoints3D,
    Measurements,
    Options,
    PosePriors,
    Priors,
    Stage,
    State,
    Weights,
    fit_tree,
    make_tree,
)
from ...solver.body import Body
from ...solver.residuals import joint_limits
from ...solver.rotations import log
from .kinds import kind_of
from .library import load_library
from .position_sets import LAYOUTS, load_sets
from .retarget import (
    SIDES,
    Correspondence,
    Follow,
    correspond,
    segment_rotations,
    shape_from_lengths,
    targets,
)
from .straight_legs import flexion, knee_flexions, straightened
from .take import Take

FPS = 30.0
CMU_ARCHIVES = ("cmu_asf_amc", "cmu_expmap")
CALIBRATION_FRAMES = 200  # per performer, for the offsets
EXTENDED_DEG = 30.0  # flexion of either knee in frames with straight legs
FEWEST_EXTENDED = 30  # of these frames, for the offsets
LEG = ("hip", "knee", "ankle")
ROUNDS = 2
FREE_JOINT_WEIGHT = 50.0  # per radian^2, towards rest: parts that the source does not have
FOLLOWING_JOINT_WEIGHT = 0.5
FLOOR_QUANTILE = 0.05  # of the frames, ordered by the height of the lowest point of the feet
LOWER = 3  # column of a hinge's lower limit
SOLES = ("heel", "foot_index")
# Largest plausible angle of a joint, degrees; beyond, the recording is broken (as a reversed left
# foot in 01_12).
MAX_DEGREES = {
    "ankle": 75.0,
    "foot": 70.0,
    "wrist": 85.0,
    "hand": 60.0,
    "head": 60.0,
    "neck": 75.0,
    "collar": 50.0,
}
MAX_DEGREES |= {"hip": 140.0, "knee": 155.0, "elbow": 160.0, "shoulder": 175.0}
MAX_DEGREES_PER_SECOND = 1700.0  # of a joint; kicks and flips reach 1400


@dataclass
class FittedTake:
    """The body's motion fitted to a take."""

    take: Take
    betas: NDArray[np.float64]  # (P,)
    R: NDArray[np.float64]  # (T, K+1, 3, 3) part to world
    t: NDArray[np.float64]  # (T, K+1, 3) joints, world, metres
    poses: NDArray[np.float64]  # (T, 3 (K+1)) axis-angle
    trans: NDArray[np.float64]  # (T, 3)
    error: NDArray[np.float64]  # (T, K+1) metres between joint and target, NaN without target
    valid: NDArray[np.bool_]  # (T,) bool, False where the recording is broken


class _Fitter:
    """The solver set up for one performer."""

    def __init__(
        self,
        body: Body,
        betas: NDArray[np.float64],
        found: Correspondence,
        position_weight: float = 24000.0,
        straight_knees: bool = False,
    ) -> None:
        self.body = body
        self.betas = betas
        self.found = found
        self.tree = make_tree(body)
        names = list(body.joint_names)
        self.parts = np.array([names.index(p) for p in found.parts])
        self.joints = np.array([names.index(j) for j in found.points])
        self.indices = len(body.keypoint_part) + self.joints
        self.confidence = np.array([point.confidence for point in found.points.values()])
        self.weights = np.array([follow.weight for follow in found.parts.values()])
        followed = np.isin(np.arange(1, body.K + 1), self.parts)
        self.priors = Priors(
            joint_weights=np.where(followed, FOLLOWING_JOINT_WEIGHT, FREE_JOINT_WEIGHT),
            shape_mean=betas,
            limits=_straight_hinges(body, betas)
            if straight_knees
            else joint_limits.hinges_of(names),
        )
        weights = Weights(keypoints3d=position_weight, joint_prior=1.0, shape=1e8, pose_prior=1.0)
        stage = Stage(weights, tolerance=1e-4, max_iterations=20)
        self.options = Options(stages=(stage,), robust_keypoints3d=np.inf, damping=1e-3)

    def __call__(
        self, R_target: NDArray[np.float64], p_target: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return part poses R (T, K+1, 3, 3), t (T, K+1, 3) for targets (T, parts, 3, 3) and (T,
        points, 3).
        """
        T = len(R_target)
        n = self.body.K + 1
        R = np.empty((T, n, 3, 3))
        t = np.empty((T, n, 3))
        none = np.zeros((len(self.parts), 3))
        for k in range(T):
            fit = fit_tree(
                self.tree,
                Measurements(
                    keypoints3d=Keypoints3D(self.indices, p_target[k], self.confidence),
                    pose_priors=PosePriors(
                        self.parts, R_target[k], none, self.weights, np.zeros(len(self.parts))
                    ),
                ),
                self._start(R_target[k], p_target[k]),
                self.priors,
                self.options,
            )
            R[k] = fit.R_camera_part
            t[k] = fit.t_camera_part
        return R, t

    def _start(self, R_target: NDArray[np.float64], p_target: NDArray[np.float64]) -> State:
        """Return the state with every part at its target's rotation and the joints' centroid at
        their targets'.
        """
        R = np.empty((self.body.K + 1, 3, 3))
        Omega = np.tile(np.eye(3), (self.body.K + 1, 1, 1))
        for i, parent in enumerate(self.body.parents):
            row = np.flatnonzero(self.parts == i)
            R[i] = R_target[row[0]] if len(row) else R[parent]
            Omega[i] = R[i] if parent < 0 else R[parent].T @ R[i]
        _, t = self.body.forward_kinematics(Omega, np.zeros(3), self.betas)
        return State(R[0], t[0] + (p_target - t[self.joints]).mean(axis=0), Omega[1:], self.betas)


def _straight_hinges(
    body: Body, betas: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the limits of the hinges with each knee's lower limit counted from the straight leg.

    A body whose knees are bent at rest could not straighten its legs within the limits about rest.
    """
    joints, floats = joint_limits.hinges_of(list(body.joint_names))
    rest = body.rest_joints(betas)
    for row, joint in enumerate(joints[:, 0]):
        side, _, name = body.joint_names[joint].rpartition("_")
        if name == "knee":
            hip, knee, ankle = (
                rest[None, body.joint_names.index(f"{side}_{part}")] for part in LEG
            )
            floats[row, LOWER] -= np.radians(
                flexion(hip, knee, ankle, np.array([[1.0, 0.0, 0.0]]))[0]
            )
    return joints, floats


def fit_performer(body: Body, takes: list[Take], straight_knees: bool = False) -> list[FittedTake]:
    """Fit all takes of one performer; ``straight_knees`` counts the lower limits of the knees from
    the straight leg.
    """
    betas = shape_from_lengths(body, takes[0])
    found = correspond(body, betas, takes)
    calibrate_offsets(body, betas, found, takes, straight_knees)
    fitter = _Fitter(body, betas, found, straight_knees=straight_knees)
    return [_fitted(body, betas, take, fitter) for take in takes]


def calibrate_offsets(
    body: Body,
    betas: NDArray[np.float64],
    found: Correspondence,
    takes: list[Take],
    straight_knees: bool = False,
) -> None:
    """Set ``found.offset`` to the mean over frames of R_world_sᵀ (t_j − p_s), from fits on some
    frames of the takes.

    With ``straight_knees``, from frames with straight legs if there are enough: offsets decide
    there how far knees are bent, and those of people who sit differ, because the pelvis of a source
    does not turn about the body's hips.
    """
    if straight_knees:
        extended = [
            _selected(take, knee_flexions(_legs(take)).max(axis=0) < EXTENDED_DEG) for take in takes
        ]
        extended = [take for take in extended if len(take) > 0]
        takes = extended if sum(map(len, extended)) >= FEWEST_EXTENDED else takes
    step = max(1, sum(map(len, takes)) // CALIBRATION_FRAMES)
    some = [_selected(take, slice(None, None, step)) for take in takes]
    for k in range(ROUNDS):
        fitter = _Fitter(body, betas, found, 24.0 if k == 0 else 2400.0, straight_knees)
        left_over: dict[str, list[NDArray[np.float64]]] = {joint: [] for joint in found.points}
        for take in some:
            _, t = fitter(*targets(take, found))
            for joint, point in found.points.items():
                gap = t[:, body.joint_names.index(joint)] - take.joint(point.joint)
                R = segment_rotations(take, Follow(point.segment))
                left_over[joint].append(np.einsum("tji,tj->ti", R, gap))
        found.offset = {
            joint: np.concatenate(gaps).mean(axis=0) for joint, gaps in left_over.items()
        }


def _selected(take: Take, frames: slice | NDArray[np.bool_]) -> Take:
    R = None if take.orientations is None else take.orientations[frames]
    return replace(take, positions=take.positions[frames], orientations=R)


def _legs(take: Take) -> dict[str, NDArray[np.float64]]:
    joints = [f"{side}_{part}" for side in SIDES for part in LEG]
    return {joint: take.joint(joint) for joint in joints}


def _fitted(body: Body, betas: NDArray[np.float64], take: Take, fitter: _Fitter) -> FittedTake:
    R_target, p_target = targets(take, fitter.found)
    R, t = fitter(R_target, p_target)
    error = np.full(t.shape[:2], np.nan)
    error[:, fitter.joints] = np.linalg.norm(t[:, fitter.joints] - p_target, axis=2)
    # The floor goes to y = 0.
    soles = [i for n, i in body.keypoint_set("blazepose").items() if n.endswith(SOLES)]
    height = body.keypoints(R, t, betas)[:, soles, 1].min(axis=1)
    t = t - [0.0, np.quantile(height, FLOOR_QUANTILE), 0.0]
    Omega = R.copy()
    Omega[:, 1:] = np.swapaxes(R[:, body.parents[1:]], -1, -2) @ R[:, 1:]
    poses = log(Omega).reshape(len(R), -1)
    valid = plausible(body, Omega, take.fps)
    return FittedTake(take, betas, R, t, poses, t[:, 0] - body.rest_joints(betas)[0], error, valid)


def plausible(body: Body, Omega: NDArray[np.float64], fps: float) -> NDArray[np.bool_]:
    """Return (T,) bool: whether all joint states (T, K+1, 3, 3) are within their ranges and speed
    limit.
    """
    most = np.array([MAX_DEGREES.get(name.rpartition("_")[2], 180.0) for name in body.joint_names])
    inside = (np.degrees(np.linalg.norm(log(Omega[:, 1:]), axis=-1)) <= most[1:]).all(axis=1)
    turns = log(np.swapaxes(Omega[:-1, 1:], -1, -2) @ Omega[1:, 1:])
    slow = (np.degrees(np.linalg.norm(turns, axis=-1)) * fps <= MAX_DEGREES_PER_SECOND).all(axis=1)
    return inside & np.append(True, slow) & np.append(slow, True)


def fit_library(body: Body, takes: list[Take], straight_knees: bool = False) -> list[FittedTake]:
    """Fit every take but mirror images, performer by performer; see `fit_performer`."""
    chosen = sorted(
        (t for t in takes if not t.mirrored), key=lambda t: (t.source, t.subject, t.name)
    )
    performers = [list(group) for _, group in groupby(chosen, key=lambda t: t.subject)]
    return [f for group in performers for f in fit_performer(body, group, straight_knees)]


def save(path: Path, body: Body, fitted: list[FittedTake]) -> None:
    """Write all motions into one .npz.

    poses (F, 3(K+1)) f32, trans (F, 3) f32, joint_error (F, K+1) f32 metres or NaN, valid (F,) bool
    (False where the recording is broken). Take k has the frames take_start[k]:take_start[k+1],
    take_name, take_source, take_subject, take_fps, take_betas[k], take_set, the archive or set that
    it comes from, and take_kind, one of ``kinds.KINDS``; up is ``y``.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary:
        np.savez_compressed(
            temporary,
            poses=np.concatenate([f.poses for f in fitted]).astype(np.float32),
            trans=np.concatenate([f.trans for f in fitted]).astype(np.float32),
            joint_error=np.concatenate([f.error for f in fitted]).astype(np.float32),
            valid=np.concatenate([f.valid for f in fitted]),
            take_start=np.cumsum([0] + [len(f.take) for f in fitted]),
            take_name=np.array([f.take.name for f in fitted]),
            take_source=np.array([f.take.source for f in fitted]),
            take_subject=np.array([f.take.subject for f in fitted]),
            take_set=np.array([f.take.source for f in fitted]),
            take_kind=np.array([kind_of(f.take) for f in fitted]),
            take_fps=np.array([f.take.fps for f in fitted]),
            take_betas=np.array([f.betas for f in fitted]),
            body_model=body.name,
            up="y",
        )


def report(body: Body, fitted: list[FittedTake]) -> str:
    """Print minutes and joint errors (median / 95 %) for each source, and the errors of each
    joint.
    """
    lines = []
    for source, group in groupby(fitted, key=lambda f: f.take.source):
        of_source = list(group)
        error = np.concatenate([f.error for f in of_source]) * 1000
        minutes = sum(f.take.seconds for f in of_source) / 60
        known = error[np.isfinite(error)]
        lines.append(f"{source}: {len(of_source)} takes, {minutes:.1f} min, {len(error)} frames, "
                     "joint error "
                     f"{np.median(known):.1f} / {np.quantile(known, 0.95):.1f} mm, "
                     f"{sum(int((~f.valid).sum()) for f in of_source)} frames broken")  # fmt: skip
        for j, name in enumerate(body.joint_names):
            if np.isfinite(error[:, j]).all():
                lines.append(
                    f"    {name:15s} {np.median(error[:, j]):5.1f} / "
                    f"{np.quantile(error[:, j], 0.95):5.1f}"
                )
    return "\n".join(lines)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Fit the default body to the motion archives.")
    parser.add_argument("archives", type=Path, help="folder with the three .tar.xz")
    parser.add_argument(
        "--more",
        type=Path,
        help="folder with sets of joint positions, .npz; straightens CMU's legs",
    )
    parser.add_argument(
        "--without", action="append", default=[], choices=sorted(LAYOUTS), help="leave out a set"
    )
    parser.add_argument(
        "--as-recorded", action="store_true", help="leave CMU's legs as they are, also with --more"
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("build/mocap/motions.npz"))
    arguments = parser.parse_args()
    start = time.perf_counter()
    body = load_body("scope")
    archived = load_library(arguments.archives, FPS)
    more = []
    if arguments.more is not None:
        more = load_sets(arguments.more, tuple(arguments.without))
        if not arguments.as_recorded:
            archived = [straightened(t) if t.source in CMU_ARCHIVES else t for t in archived]
    straight_knees = arguments.more is not None
    fitted = fit_library(body, archived, straight_knees) + fit_library(body, more, straight_knees)
    save(arguments.output, body, fitted)
    print(report(body, fitted))
    print(f"{arguments.output}: {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
