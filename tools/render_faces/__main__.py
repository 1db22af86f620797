# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m scope.tools.render_faces SET ...``: write sets' pictures and truth to
build/faces/SET. Needs bpy.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.untrusted.body_file import load_body
from ...solver.body import Body
from .beard import bearded
from .identities import draw_identity, identity_targets
from .looks import draw_look, with_beard
from .sequences import FaceClip
from .sets import SETS, FaceSet
from .shaded import ShadedStage
from .truth import FOLDER, focal_px, head_vertices, to_camera, write_truth
from .worn import Worn, put_on

_SHUTTER = 0.5  # of a frame, for which it is open where motion blurs
_BODY = "body"
# vertices (N, 3) of the body and of what is worn, camera frame, metres
Places = dict[str, NDArray[np.float64]]


def main() -> int:
    """Render what is missing of a set."""
    parser = argparse.ArgumentParser(prog="render_faces", description=__doc__)
    parser.add_argument(
        "sets", nargs="+", choices=SETS, metavar="SET", help=f"one of {', '.join(SETS)}"
    )
    parser.add_argument(
        "-o", "--out", type=Path, default=FOLDER, help="folder of the sets' folders"
    )
    parser.add_argument("--frames", type=int, nargs="*", help="render only these frames")
    arguments = parser.parse_args()
    targets = identity_targets()
    for name in arguments.sets:
        (arguments.out / name).mkdir(parents=True, exist_ok=True)
        _render(SETS[name], targets, arguments.out / name, arguments.frames)
    return 0


def _render(
    faces: FaceSet, targets: NDArray[np.float64], folder: Path, frames: list[int] | None
) -> None:
    rng = np.random.default_rng(faces.seed)
    body = load_body("scope")
    clip = faces.change(faces.draw(rng, **faces.sizes))
    identities = np.array([draw_identity(targets, rng) for _ in range(faces.sizes["people"])])
    write_truth(folder / "truth.npz", body, clip, identities)
    stage = _stage(body, faces.cycles)
    dressed = -1
    worn = Worn({})
    for t in range(len(clip.weights)) if frames is None else frames:
        path = folder / f"{t:04d}.png"
        if path.is_file():
            continue
        if clip.person[t] != dressed:
            dressed = int(clip.person[t])
            worn = _dress(stage, body, faces, dressed, identities[dressed])
        places = _places(body, clip, identities, worn, t)
        stage.render(places.pop(_BODY), focal_px(float(clip.distance[t])), path, places)
        if faces.blurred:
            _blur(path, clip, t)
        print(f"{t + 1} / {len(clip.weights)}", file=sys.stderr, flush=True)


def _dress(
    stage: Any, body: Body, faces: FaceSet, person: int, identity: NDArray[np.float64]
) -> Worn:
    rng = np.random.default_rng([faces.seed, person])
    look = draw_look(body, rng)
    stage.dress(with_beard(look, bearded(body)) if faces.worn == "beard" else look, rng)
    worn = put_on(faces.worn, body, body.v_template + identity, np.random.default_rng(person))
    if worn.faces:
        stage.wear(worn.faces)
    return worn


def _places(
    body: Body, clip: FaceClip, identities: NDArray[np.float64], worn: Worn, t: int
) -> Places:
    face = head_vertices(body, clip.weights[t], identities[clip.person[t]])
    return {
        name: to_camera(clip, t, points)
        for name, points in ({_BODY: face} | worn.vertices(face)).items()
    }


def _blur(path: Path, clip: FaceClip, t: int) -> None:
    """Blur a picture along the way that the head's middle goes while the shutter is open."""
    before = clip.middle[max(t - 1, 0)]
    after = clip.middle[min(t + 1, len(clip.middle) - 1)]
    x, y = (
        _SHUTTER * (after - before)[:2] / 2 * focal_px(float(clip.distance[t])) / clip.distance[t]
    )
    size = 2 * int(np.ceil(max(abs(x), abs(y)) / 2)) + 3
    kernel = np.zeros((size, size), np.float32)
    middle = np.array([size // 2, size // 2])
    start, end = (
        np.round(16 * (middle + side * np.array([x, y]) / 2)).astype(int).tolist()
        for side in (-1, 1)
    )
    cv2.line(kernel, start, end, (1.0,), 1, cv2.LINE_AA, 4)
    cv2.imwrite(str(path), cv2.filter2D(cv2.imread(str(path)), -1, kernel / kernel.sum()))


def _stage(body: Body, cycles: bool) -> Any:
    if not cycles:
        return ShadedStage(body)
    from .stage import Stage

    return Stage(body)


if __name__ == "__main__":
    status = main()
    sys.stderr.flush()
    os._exit(status)  # Blender's module can hang at exit
