# SPDX-License-Identifier: GPL-3.0-or-later
"""One shape and every pose of a clip from 2D keypoints of a calibrated camera, with 2 pixels of
noise.
"""

from dataclasses import replace

import numpy as np

from .. import Keypoints2D, Measurements, fit_clip, load_body, rotations
from . import person

FRAMES = 12


def main() -> float:
    """Fit, print, and return the mean reprojection error in pixels, against the keypoints without
    noise.
    """
    body = load_body("scope")
    rng = np.random.default_rng(2)
    names = body.keypoint_set("coco")  # what most detectors give
    index = np.array(list(names.values()))
    first = person.pose(body, seed=3, bend=0.15)
    last = person.pose(body, seed=4, bend=0.15)
    clip = []
    seen = []
    turn = rotations.log(np.swapaxes(first.Omega, -1, -2) @ last.Omega)
    for k in range(FRAMES):
        now = replace(first, Omega=first.Omega @ rotations.exp(turn * k / FRAMES))
        R, t = person.place(body, now)
        pixels = person.project(body.keypoints(R, t, now.beta)[index])
        noisy = Keypoints2D(
            index, pixels + 2.0 * rng.standard_normal(pixels.shape), np.full(len(index), 0.9)
        )
        clip.append(Measurements(person.INTRINSICS, keypoints2d=noisy))
        seen.append(pixels)

    found = fit_clip(body, clip)

    fitted = [
        body.keypoints(f.R_camera_part, f.t_camera_part, found.beta)[index] for f in found.frames
    ]
    drawn = [person.project(points) for points in fitted]
    error = float(np.linalg.norm(np.array(drawn) - np.array(seen), axis=-1).mean())
    print(
        f"{found.status.name}: {FRAMES} frames, one shape, {error:.2f} pixels from where the "
        "keypoints really are"
    )
    return error


if __name__ == "__main__":
    main()
