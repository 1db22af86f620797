# SPDX-License-Identifier: GPL-3.0-or-later
"""What all keypoint networks share: channels, normalization, the set of keypoints, and the next
region.
"""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.perception.adapters.keypoint_network import KeypointNetwork
from scope.scope_addon.capture.perception.adapters.keypoint_sets import COCO_17, KEYPOINT_SETS
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.region import Region
from scope.solver.errors import ModelFileError

from ...small_graphs import fixed, heatmaps, simcc
from .spots_in_picture import REGIONS, SPOTS, spots, unit_colours


def test_channel_order_and_square_inputs(tmp_path: Path) -> None:
    path = simcc(tmp_path / "m.onnx", 17, 256, 256)
    unit_colours(path, channel_order="bgr")
    (seen,) = KeypointNetwork(path, threads=1).estimate(spots(), [REGIONS["larger"]])
    np.testing.assert_allclose(seen.keypoints_px[KEYPOINT_NAMES.index("nose")], SPOTS[2], atol=1.0)


def test_normalization_is_that_of_imagenet(tmp_path: Path) -> None:
    """ImageNet's mean becomes 0, and the score of an image one standard deviation above it is 1."""
    path = simcc(tmp_path / "m.onnx", 17, 192, 256)
    above = np.array([123.675 + 58.395, 116.28 + 57.12, 103.53 + 57.375])
    image = np.full((100, 100, 3), np.round(above), np.uint8)
    network = KeypointNetwork(path, threads=1)
    resized = np.asarray(cv2.resize(image, (192, 256)), np.uint8)
    outputs = network._graph.run(resized, network._normalization)
    assert all(o.max() == pytest.approx(1.0, abs=0.02) and o.min() > 0.97 for o in outputs)


@pytest.mark.parametrize("name", ["halpe26", "wholebody133"])
def test_the_set_follows_from_the_count(tmp_path: Path, name: str) -> None:
    path = simcc(tmp_path / "m.onnx", KEYPOINT_SETS[name].count, 192, 256)
    assert KeypointNetwork(path, threads=1).keypoint_set.name == name


def test_an_unknown_count_asks_for_the_json(tmp_path: Path) -> None:
    path = heatmaps(tmp_path / "m.onnx", 21, 192, 256)
    with pytest.raises(ModelFileError, match=r"21 keypoints.*m\.json.*keypoints"):
        KeypointNetwork(path, threads=1)
    path.with_suffix(".json").write_text('{"keypoints": "coco17"}')
    assert KeypointNetwork(path, threads=1).keypoint_set.name == "coco17"


def test_a_detector_is_refused_as_a_keypoint_network(tmp_path: Path) -> None:
    path = fixed(tmp_path / "m.onnx", 640, 640, {"output0": np.zeros((1, 84, 8400), np.float32)})
    with pytest.raises(
        ModelFileError,
        match=r"as a keypoint network.*output0 \[1, 84, "
        r"8400\].*simcc, heatmap",
    ):
        KeypointNetwork(path, threads=1)


def upright(count: int = 17) -> np.ndarray:
    """Create a standing person (33, 2), 200 pixels from nose to ankles."""
    height = {
        "nose": 0,
        "eye": -5,
        "ear": 0,
        "shoulder": 35,
        "elbow": 70,
        "wrist": 100,
        "hip": 100,
        "knee": 150,
    }
    height |= {"ankle": 200}
    points = np.zeros((33, 2))
    for name in COCO_17:
        x = 20 if "left" in name else -20 if "right" in name else 0
        points[KEYPOINT_NAMES.index(name)] = x, next(h for key, h in height.items() if key in name)
    return points + [400, 300]


def test_the_next_region_contains_the_keypoints(tmp_path: Path) -> None:
    network = KeypointNetwork(simcc(tmp_path / "m.onnx", 17, 192, 256), threads=1)
    confidence = np.array([0.9 if name in COCO_17 else 0.0 for name in KEYPOINT_NAMES])
    seen = confidence > 0
    region = network._next_region(upright(), confidence, Region((400, 400), 250.0, 0.0))
    assert region.rotation == 0
    assert region.side_px == pytest.approx(1.4 * 205)  # more than what trunk and legs ask for
    np.testing.assert_allclose(region.center_px, (400, 397.5))
    # head down: turned, and just as large
    turn = np.array([[-1.0, 0.0], [0.0, -1.0]])
    over = network._next_region(upright() @ turn + [800, 800], confidence, region)
    assert abs(over.rotation) == pytest.approx(math.pi)
    assert over.side_px == pytest.approx(region.side_px)
    crop = over.crop_from_image((upright() @ turn + [800, 800])[seen])
    assert crop.min() > 0.1
    assert crop.max() < 0.9
    # arms wide: the picture is narrower than high
    wide = upright()
    for side, x in (("left", 700), ("right", 100)):
        wide[KEYPOINT_NAMES.index(f"{side}_wrist")] = x, 340
    assert network._next_region(wide, confidence, region).side_px == pytest.approx(
        1.4 * 600 * 256 / 192
    )
    # hardly anything seen: stay
    assert network._next_region(upright(), confidence * 0.05, region) is region
    # legs hidden: shrink slowly
    legs = np.array(["knee" in n or "ankle" in n or "hip" in n for n in KEYPOINT_NAMES])
    hidden = np.where(legs, 0.0, confidence)
    assert network._next_region(upright(), hidden, region).side_px == pytest.approx(
        0.97 * region.side_px
    )
    # crouching: the box stays as large as the person will be
    low = upright()
    ankles = [KEYPOINT_NAMES.index(f"{side}_ankle") for side in ("left", "right")]
    low[ankles] += [0, -90]
    assert (
        network._next_region(low, confidence, Region((400, 400), 100.0, 0.0)).side_px
        > 1.6 * (65 + 50 + 40) - 1
    )
