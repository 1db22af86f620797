# SPDX-License-Identifier: GPL-3.0-or-later
"""The JSON file next to a model (``NAME.json`` for ``NAME.onnx``), with what its graph does not
specify; and the keypoint sets that it may name, with their conversion to the 33 keypoints of the
lifter and the solver.

A keypoint that a set lacks gets a rough position and confidence 0: the solver ignores it, and the
lifter gets the position together with the confidence.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from .....solver.errors import ModelFileError
from ....arrays import Float64Array
from ....json_file import read_json_object
from ..landmark_network import KEYPOINT_NAMES

COCO_17 = (
    *("nose", "left_eye", "right_eye", "left_ear", "right_ear"),
    *(
        f"{side}_{joint}"
        for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
        for side in ("left", "right")
    ),
)
_SIDES = ("left", "right")
# Weights of BlazePose's foot tip; see solver/smpl_family.py.
_TOES = {"big_toe": 0.85, "small_toe": 0.15}

# Our name: {index in the set: weight}.
Mixture = dict[str, dict[int, float]]
_COCO: Mixture = {name: {k: 1.0} for k, name in enumerate(COCO_17)}


def _feet(indices: dict[str, int]) -> Mixture:
    feet: Mixture = {f"{side}_heel": {indices[f"{side}_heel"]: 1.0} for side in _SIDES}
    for side in _SIDES:
        feet[f"{side}_foot_index"] = {
            indices[f"{side}_{toe}"]: weight for toe, weight in _TOES.items()
        }
    return feet


def _halpe() -> Mixture:
    # 17 top of the head, 18 neck, 19 hip
    points = (
        "left_big_toe",
        "right_big_toe",
        "left_small_toe",
        "right_small_toe",
        "left_heel",
        "right_heel",
    )
    return _COCO | _feet({name: 20 + k for k, name in enumerate(points)})


def _wholebody() -> Mixture:
    feet = _feet(
        {
            f"{s}_{p}": 17 + 3 * i + k
            for i, s in enumerate(_SIDES)
            for k, p in enumerate((*_TOES, "heel"))
        }
    )
    # 23 + the 68 points of the face, which begin at the person's right ear; eyes from 36, mouth
    # from 48
    face = {
        "right_eye_outer": 36,
        "right_eye_inner": 39,
        "left_eye_inner": 42,
        "left_eye_outer": 45,
    }
    face |= {"mouth_right": 48, "mouth_left": 54}
    # Hands of 21: wrist, then thumb, index, middle, ring, pinky, each from the base to the tip.
    hand = {"thumb": 3, "index": 5, "pinky": 17}
    fingers = {
        f"{s}_{f}": {91 + 21 * i + n: 1.0} for i, s in enumerate(_SIDES) for f, n in hand.items()
    }
    return _COCO | feet | {name: {23 + n: 1.0} for name, n in face.items()} | fingers


@dataclass(frozen=True)
class KeypointSet:
    """A set of ``count`` keypoints, and ``mixture``, the weights from which ours are calculated."""

    name: str
    count: int
    mixture: Mixture

    def to_blazepose(
        self, points: Float64Array, scores: Float64Array
    ) -> tuple[Float64Array, Float64Array]:
        """Convert to our keypoints; see the module for those that the set lacks.

        :param points: (count, 2) pixels.
        :param scores: (count,) 0..1.
        :return: (33, 2) pixels and (33,) confidence.
        """
        ours = np.zeros((len(KEYPOINT_NAMES), 2))
        confidence = np.zeros(len(KEYPOINT_NAMES))
        for k, name in enumerate(KEYPOINT_NAMES):
            if name in self.mixture:
                indices = list(self.mixture[name])
                weights = np.array(list(self.mixture[name].values()))
                ours[k] = weights @ points[indices]
                confidence[k] = scores[indices].min()
        at = {name: ours[k] for k, name in enumerate(KEYPOINT_NAMES)}
        for k, name in enumerate(KEYPOINT_NAMES):
            if name not in self.mixture:
                ours[k] = _approximate(name, at)
        return ours, confidence


def _approximate(name: str, at: dict[str, Float64Array]) -> Float64Array:
    """Estimate the rough position (2,) of a keypoint from those that every set has."""
    side = "left" if "left" in name else "right"
    if "eye" in name:
        return at[f"{side}_eye"]
    if "mouth" in name:
        neck = (at["left_shoulder"] + at["right_shoulder"]) / 2
        to_eye = (at[f"{side}_eye"] - at["nose"]) * np.array([1.0, 0.0])
        return at["nose"] + 0.2 * (neck - at["nose"]) + 0.3 * to_eye
    if "heel" in name or "foot" in name:
        lower_leg = at[f"{side}_ankle"] - at[f"{side}_knee"]
        return at[f"{side}_ankle"] + (0.12 if "heel" in name else 0.2) * lower_leg
    forearm = at[f"{side}_wrist"] - at[f"{side}_elbow"]
    return at[f"{side}_wrist"] + 0.3 * forearm


KEYPOINT_SETS = {
    "coco17": KeypointSet("coco17", 17, _COCO),
    "halpe26": KeypointSet("halpe26", 26, _halpe()),
    "wholebody133": KeypointSet("wholebody133", 133, _wholebody()),
}


_LARGEST = 1e30  # of a number: networks get single precision


@dataclass(frozen=True)
class Description:
    """The contents of the JSON; None: not specified, so that the graph or the usual value of its
    type applies.

    ``type``: see `DETECTOR_TYPES` and `KEYPOINT_TYPES`.  ``input_size``: [width, height].
    ``mean``, ``std``: one or three numbers on the scale 0..255, in the order of the channels; input
    = (pixel − mean) / std. ``channel_order``: rgb or bgr.  ``score_threshold``: least score of a
    person or of a visible keypoint. Detectors: ``decoded`` (yolox: boxes are in pixels already),
    ``person_class`` (index of the class). Keypoints: ``keypoints`` (a set's name), ``decode`` (dark
    or quarter), ``udp`` (the corner cells of a heatmap are centred on the corner pixels).
    """

    type: str | None = None
    input_size: tuple[int, int] | None = None
    mean: tuple[float, ...] | None = None
    std: tuple[float, ...] | None = None
    channel_order: str | None = None
    score_threshold: float | None = None
    decoded: bool | None = None
    person_class: int = 0
    keypoints: str | None = None
    decode: str = "dark"
    udp: bool = False


def description_path(model: Path) -> Path:
    """Derive the path of a model's JSON."""
    return model.with_suffix(".json")


def read_description(model: Path, types: tuple[str, ...]) -> Description:
    """Read the JSON next to a model; a missing file is like an empty one.

    :raises ModelFileError: it is not JSON, or has an unknown key or an invalid value.
    """
    path = description_path(model)
    if not path.is_file():
        return Description()
    advice = f'write an object such as {{"type": "{types[0]}"}}, or remove the file'
    values = read_json_object(path, ModelFileError, "network's description", advice)
    known = {field.name for field in fields(Description)}
    for key, value in values.items():
        if key not in known:
            raise ModelFileError(
                f"{path}: unknown entry {key!r}; use any of {', '.join(sorted(known))}"
            )
        if expected := _violated(key, value, types):
            raise ModelFileError(
                f"{path}: {key} must be {expected}, but is {json.dumps(value)[:80]}"
            )
    for key in ("mean", "std", "input_size"):
        if key in values:
            values[key] = tuple(values[key] if isinstance(values[key], list) else [values[key]])
    return Description(**values)


def _violated(key: str, value: Any, types: tuple[str, ...]) -> str | None:
    """Describe what a value must be; None if it is valid."""
    choices = {
        "type": types,
        "channel_order": ("rgb", "bgr"),
        "keypoints": tuple(KEYPOINT_SETS),
        "decode": ("dark", "quarter"),
    }
    if key in choices:
        return None if value in choices[key] else f"one of {', '.join(choices[key])}"
    if key in ("decoded", "udp"):
        return None if isinstance(value, bool) else "true or false"
    if key == "score_threshold":
        return None if _is_number(value) and 0 < value < 1 else "a number between 0 and 1"
    if key == "person_class":
        return None if type(value) is int and value >= 0 else "a whole number of at least 0"
    if key == "input_size":
        valid = (
            isinstance(value, list)
            and len(value) == 2
            and all(type(v) is int and 16 <= v <= 4096 for v in value)
        )
        return None if valid else "[width, height] in pixels, 16 to 4096"
    numbers = value if isinstance(value, list) else [value]
    valid = len(numbers) in (1, 3) and all(_is_number(v) for v in numbers)
    if key == "std":
        valid = valid and all(v > 0 for v in numbers)
    return None if valid else "one number or three" + (" above 0" if key == "std" else "")


def _is_number(value: Any) -> bool:
    # The comparison excludes NaN.
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < _LARGEST
