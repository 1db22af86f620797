# SPDX-License-Identifier: GPL-3.0-or-later
"""The JSON beside a network: every entry with values it may have, and those that are refused by
their names.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from scope.scope_addon.capture.perception.adapters.description import (
    Description,
    description_path,
    read_description,
)
from scope.solver.errors import ModelFileError

TYPES = ("yolox", "simcc")


def read(folder: Path, text: str) -> Description:
    (folder / "m.json").write_text(text, "utf-8")
    return read_description(folder / "m.onnx", TYPES)


@pytest.mark.parametrize(
    ("key", "given", "expected"),
    [
        ("type", "simcc", "simcc"),
        ("input_size", [192, 256], (192, 256)),
        ("mean", 0, (0,)),
        ("mean", [1, 2.5, -3], (1, 2.5, -3)),
        ("std", [58.4, 57.1, 57.4], (58.4, 57.1, 57.4)),
        ("channel_order", "bgr", "bgr"),
        ("score_threshold", 0.25, 0.25),
        ("decoded", False, False),
        ("person_class", 3, 3),
        ("keypoints", "halpe26", "halpe26"),
        ("decode", "quarter", "quarter"),
        ("udp", True, True),
    ],
)
def test_an_entry_is_read(tmp_path: Path, key: str, given: object, expected: object) -> None:
    found = read(tmp_path, json.dumps({key: given}))
    assert vars(found) == vars(Description()) | {key: expected}


@pytest.mark.parametrize(
    ("key", "given", "expected"),
    [
        ("type", "yolov99", "one of yolox, simcc"),
        ("type", None, "one of yolox, simcc"),
        ("input_size", 256, "width, height"),
        ("input_size", [192.0, 256], "width, height"),
        ("input_size", [8, 256], "16 to 4096"),
        ("mean", [1, 2], "one number or three"),
        ("mean", [True], "one number or three"),
        ("mean", "0", "one number or three"),
        ("std", 0, "above 0"),
        ("std", [1, -1, 1], "above 0"),
        ("channel_order", "grb", "one of rgb, bgr"),
        ("score_threshold", 1, "between 0 and 1"),
        ("decoded", 1, "true or false"),
        ("person_class", -1, "at least 0"),
        ("person_class", True, "whole number"),
        ("keypoints", "coco", "one of coco17"),
        ("decode", "exact", "one of dark, quarter"),
        ("udp", "yes", "true or false"),
        ("colour", "rgb", "unknown entry 'colour'"),
    ],
)
def test_a_value_that_means_nothing_is_refused(
    tmp_path: Path, key: str, given: object, expected: str
) -> None:
    with pytest.raises(ModelFileError, match=r"m\.json") as caught:
        read(tmp_path, json.dumps({key: given}))
    assert key in str(caught.value)
    assert expected in str(caught.value)


@pytest.mark.parametrize(
    "text", ['{"std": NaN}', '{"mean": 1e400}', '{"mean": 1e31}', "[]", "{", "", "[" * 100_000]
)
def test_what_is_no_object_of_finite_numbers_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(ModelFileError, match=r"m\.json"):
        read(tmp_path, text)


def test_a_missing_file_says_nothing(tmp_path: Path) -> None:
    assert read_description(tmp_path / "m.onnx", TYPES) == Description()
    assert description_path(Path("a/b.c.onnx")) == Path("a/b.c.json")
