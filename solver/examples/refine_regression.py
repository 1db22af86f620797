# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine what a regression network estimates (HMR, SPIN and similar ones) with the keypoints of a
detector.

Such a network's file holds, for each picture, pose (24, 3, 3) rotations, betas (10,) and a
weak-perspective camera (s, t_x, t_y) of a square crop; its body is plausible but displaced from the
person. The fit starts there, and the network's joints are a prior of their own: they know the depth
that keypoints in the picture do not.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import Body, Keypoints2D, Keypoints3D, Measurements, State, fit_batch, load_body, rotations
from . import person

PICTURES = 8
CROP = 700.0  # pixels


def read_states(body: Body, file: Path) -> list[State]:
    """Return the network's states in the full picture's camera.

    A crop of b pixels about (c_x, c_y) sees s (x + t_x, y + t_y) in [-1, 1]; a camera of focal
    length f, principal point (u, v), sees the same with
        t = (t_x + 2 (c_x - u) / (s b), t_y + 2 (c_y - v) / (s b), 2 f / (s b)).
    """
    f = person.INTRINSICS[0, 0]
    u = person.INTRINSICS[0, 2]
    v = person.INTRINSICS[1, 2]
    with np.load(file) as data:
        s, tx, ty = data["camera"].T
        x, y, b = data["crop"].T
        trans = np.stack(
            [tx + 2 * (x - u) / (s * b), ty + 2 * (y - v) / (s * b), 2 * f / (s * b)], axis=1
        )
        return [
            State(R[0], body.rest_joints(beta)[0] + t, R[1:], beta)
            for R, beta, t in zip(data["pose"], data["betas"], trans, strict=True)
        ]


def write_network_output(file: Path, body: Body, truth: list[State]) -> None:
    """Write what a network might estimate: every joint some 10 degrees off, and half of the true
    shape.
    """
    rng = np.random.default_rng(9)
    rows: dict[str, list[Any]] = {"pose": [], "betas": [], "camera": [], "crop": []}
    f = person.INTRINSICS[0, 0]
    for state in truth:
        R = np.concatenate([state.R_camera_root[None], state.Omega])
        pelvis = person.project(state.t_camera_root[None])[0]
        trans = state.t_camera_root - body.rest_joints(state.beta)[0]
        s = 2 * f / (trans[2] * rng.normal(1.0, 0.03) * CROP)
        centre = (pelvis - person.INTRINSICS[:2, 2]) * 2 / (s * CROP)
        rows["pose"].append(R @ rotations.exp(0.1 * rng.standard_normal((len(R), 3))))
        rows["betas"].append(0.5 * state.beta)
        rows["camera"].append([s, *(trans[:2] - centre + 0.02 * rng.standard_normal(2))])
        rows["crop"].append([*pelvis, CROP])
    np.savez(file, **rows)


def main() -> tuple[float, float]:
    """Refine, print, and return the mean joint error before and after, in millimetres, pelvis
    aligned.
    """
    body = load_body("scope")
    truth = [person.pose(body, seed=20 + k) for k in range(PICTURES)]
    with tempfile.TemporaryDirectory() as folder:
        write_network_output(Path(folder) / "network.npz", body, truth)
        network = read_states(body, Path(folder) / "network.npz")

    rng = np.random.default_rng(10)
    index = np.array(list(body.keypoint_set("coco").values()))
    joints = len(body.keypoint_names) + np.arange(body.K + 1)
    pictures = []
    for state, guess in zip(truth, network, strict=True):
        pixels = person.project(body.keypoints(*person.place(body, state), state.beta)[index])
        pixels += 2.0 * rng.standard_normal(pixels.shape)
        pictures.append(
            Measurements(
                person.INTRINSICS,
                Keypoints2D(index, pixels, np.full(len(index), 0.9)),
                # a confidence of 0.02 here is a standard deviation of some 5 cm: see Weights
                Keypoints3D(joints, person.place(body, guess)[1], np.full(body.K + 1, 0.02)),
            )
        )
    fits = fit_batch(body, pictures, init=network)

    before = [
        _error(body, person.place(body, guess)[1], state)
        for guess, state in zip(network, truth, strict=True)
    ]
    after = [
        _error(body, found.t_camera_part, state) for found, state in zip(fits, truth, strict=True)
    ]
    print(
        f"{PICTURES} pictures: joints off by {np.mean(before):.1f} mm, refined "
        f"{np.mean(after):.1f} mm"
    )
    return float(np.mean(before)), float(np.mean(after))


def _error(body: Body, joints: NDArray[np.float64], truth: State) -> float:
    """Mean distance of the joints in millimetres, pelvis on pelvis."""
    right = person.place(body, truth)[1]
    return float(np.linalg.norm((joints - joints[0]) - (right - right[0]), axis=1).mean() * 1e3)


if __name__ == "__main__":
    main()
