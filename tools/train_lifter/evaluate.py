# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure a lifting network: ``python -m scope.tools.train_lifter.evaluate MOTIONS PAIRS [--network lifter.onnx]``.

On held-out takes with simulated detector errors, and on renders processed by the landmark network:
the error of the limbs' keypoints compared with the world landmarks', and the calibration of the predicted deviations.
Needs neither PyTorch nor onnx.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.perception.lifter import HIPS, LIFTER_FILE, Lifter, virtual_camera
from ...scope_addon.capture.perception.lifter_window import MIDDLE
from ...solver.loaders.body_file import load_body
from .augment import load_motions
from .dataset import USUAL, WIDE, Dataset, Variety
from .pairs import load_pairs
from .split import held_out_frames

MEASURED = np.array([*range(11, 17), *range(25, 29)])  # shoulders, elbows, wrists, knees, ankles; hips are the origin


def measure_renders(lifter: Lifter, pairs: Path) -> dict[str, Any]:
    """Return millimetres on renders (world landmarks, network with and without them), and error over predicted σ."""
    points, rays, confidence, world = (a.astype(float) for a in load_pairs(pairs))
    truth = points - points[:, HIPS].mean(axis=1, keepdims=True)
    result = {"renders": len(points), "world_landmarks_mm": _limb_error(world - truth)}
    for name, given in (("with_world", world), ("without_world", None)):
        lifted = lifter.lift(rays, confidence, given)
        error = lifted.points - truth
        seen = np.einsum("tij,tkj->tki", virtual_camera(rays), error)
        result[f"{name}_mm"] = _limb_error(error)
        result[f"{name}_deviation_across"] = _deviation(seen[..., :2] / lifted.sigma_across[..., None])
        result[f"{name}_deviation_along"] = _deviation(seen[..., 2] / lifted.sigma_along)
    return result


def measure_takes(lifter: Lifter, motions: Path, variety: Variety = USUAL, n: int = 8192) -> dict[str, Any]:
    """Return millimetres on held-out takes with simulated errors: all samples, and those with world landmarks."""
    batch = Dataset(load_body("scope"), held_out_frames(load_motions(motions)), variety).batch((2, 0), n)
    points, _ = lifter.run(batch.input)
    error, known = points - batch.points, batch.input[:, MIDDLE, -2] > 0.5
    return {"takes": n, "with_world_mm": _limb_error(error[known]), "without_world_mm": _limb_error(error[~known])}


def _limb_error(error: NDArray[np.float64]) -> float:
    return round(1000 * float(np.linalg.norm(error[:, MEASURED], axis=-1).mean()), 1)


def _deviation(z: NDArray[np.float64]) -> float:
    """Return the root mean square of the 99 % smallest."""
    z = np.sort(np.abs(z[:, MEASURED]).ravel())
    return round(float(np.sqrt(np.square(z[: int(0.99 * len(z))]).mean())), 2)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Measure a lifting network.")
    parser.add_argument("motions", type=Path)
    parser.add_argument("pairs", type=Path)
    parser.add_argument("--network", type=Path, default=LIFTER_FILE)
    a = parser.parse_args()
    lifter = Lifter(a.network)
    result = measure_renders(lifter, a.pairs) | {
        name: measure_takes(lifter, a.motions, variety) for name, variety in (("imitated", USUAL), ("wide", WIDE))
    }
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
