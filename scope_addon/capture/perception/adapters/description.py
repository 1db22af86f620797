# SPDX-License-Identifier: GPL-3.0-or-later
"""The JSON file next to a model (``NAME.json`` for ``NAME.onnx``), with what its graph does not
specify.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from .....solver.errors import ModelFileError
from ....json_file import read_json_object
from .keypoint_sets import KEYPOINT_SETS

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
