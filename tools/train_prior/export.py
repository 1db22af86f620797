# SPDX-License-Identifier: GPL-3.0-or-later
"""Write trained flows to assets/prior/joint_prior.npz: one row of parameters for each of SMPL's
joints.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.atomic_write import atomic_path
from ...solver.residuals import joint_flow as jf
from ...solver.rotations import nearest_rotation
from .data import MIRROR, PAIRED, TRUNK, WITHOUT_DATA, Samples

# radians about each axis, for joints without data: a Gaussian in the chart about rest
HAND_DEVIATION = 0.4
LICENSE = (
    "Learned from motion capture. The data used in this project was obtained from "
    "mocap.cs.cmu.edu. The database was "
    "created with funding from NSF EIA-0196217. Also from the motions of DeepMimic (MIT, (c) 2018 "
    "Xue Bin Peng)."
)


def flat(
    parameters: Mapping[str, NDArray[np.float64]], rotations: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return a flow's parameters (SIZE,) from those of ``Flow.row``; rotations (n, 3, 3) give the
    bound B.
    """
    out = np.zeros(jf.SIZE)
    out[jf.MEAN : jf.MEAN + 9] = nearest_rotation(parameters["mean"]).ravel()
    for k in range(jf.LAYERS):
        values = [
            np.reshape(parameters[name][k], shape).ravel()
            for name, shape in jf.LAYER_SHAPES.items()
        ]
        at = jf.FIRST_LAYER + k * jf.LAYER_SIZE
        out[at : at + jf.LAYER_SIZE] = np.concatenate(values)
    out[jf.LAST : jf.LAST + 12] = np.append(parameters["A_last"].ravel(), parameters["b_last"])
    log_det = (
        np.linalg.slogdet(parameters["A"])[1].sum() + np.linalg.slogdet(parameters["A_last"])[1]
    )
    out[jf.CONSTANT] = log_det - np.log(2.0 / np.pi**2)
    out[jf.BOUND] = jf.transform(out, rotations)[2].max()
    return out


def fixed(deviation: float) -> NDArray[np.float64]:
    """Return the parameters (SIZE,) of a Gaussian of y / (deviation / 2) about rest: y is half the
    angle near it.
    """
    A = np.eye(3)
    parameters = {name: np.zeros((jf.LAYERS, *shape)) for name, shape in jf.LAYER_SHAPES.items()}
    parameters |= {
        "mean": A,
        "A": np.tile(A, (jf.LAYERS, 1, 1)),
        "A_last": 2.0 / deviation * A,
        "b_last": np.zeros(3),
    }
    return flat(parameters, A[None])


def mirrored(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the parameters of the mirror image, z(Omega) = z_left(S Omega S)."""
    out = parameters.copy()
    M = out[jf.MEAN : jf.MEAN + 9].reshape(3, 3)
    out[jf.MEAN : jf.MEAN + 9] = (MIRROR @ M @ MIRROR).ravel()
    at = jf.FIRST_LAYER  # y is an axial vector: (y_1, -y_2, -y_3), into the first layer's A
    out[at : at + 9] = (out[at : at + 9].reshape(3, 3) * [1.0, -1.0, -1.0]).ravel()
    return out


def by_joint(
    models: Mapping[str, Mapping[str, NDArray[np.float64]]], samples: Mapping[str, Samples]
) -> dict[str, NDArray[np.float64]]:
    """Return the parameters (SIZE,) of every joint by name."""
    rows = {m: flat(p, samples[m].rotations[samples[m].is_training]) for m, p in models.items()}
    rows |= {name: fixed(HAND_DEVIATION) for name in WITHOUT_DATA}
    out = {name: rows[name] for name in TRUNK}
    for name in (*PAIRED, *WITHOUT_DATA):
        out |= {f"left_{name}": rows[name], f"right_{name}": mirrored(rows[name])}
    return out


def save(path: Path, joints: Mapping[str, NDArray[np.float64]], joint_names: Sequence[str]) -> None:
    """Write the parameters by joint, in the order of a body's ``joint_names`` (K+1,)."""
    names = [name for name in joint_names if name in joints]
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary:
        np.savez_compressed(
            temporary,
            joint_names=np.array(names),
            parameters=np.array([joints[name] for name in names]),
            layers=jf.LAYERS,
            hidden=jf.HIDDEN,
            license=LICENSE,
        )
