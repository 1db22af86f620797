# SPDX-License-Identifier: GPL-3.0-or-later
"""What all keypoint networks share: channels, normalization, the set of keypoints, and the next
region.

Heatmap and SimCC networks on small graphs: coloured spots at known pixels, and maxima between
cells.

Each set's keypoints arrive at those of their names.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.perception.adapters.description import COCO_17, KEYPOINT_SETS
from scope.scope_addon.capture.perception.adapters.keypoint_network import KeypointNetwork
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.region import Region
from scope.solver.errors import ModelFileError

from ...small_graphs import fixed, heatmaps, simcc

pytestmark = pytest.mark.usefixtures("in_this_process")

# (x, y) of the red, green and blue spot in an image of odd size
SPOTS = np.array([[140.0, 77.0], [171.0, 201.0], [211.0, 133.0]])
REGIONS = {
    "larger": Region((170.3, 141.8), 301.0, 0.0),
    "enlarged": Region((176.0, 138.0), 190.0, 0.0),
    "turned": Region((170.3, 141.8), 340.0, 0.6),
    "over the edge": Region((160.0, 100.0), 330.0, 0.0),
}


def spots() -> np.ndarray:
    y, x = np.mgrid[:281, :357]
    near = [np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * 5.0**2)) for u, v in SPOTS]
    return np.round(255 * np.stack(near, axis=-1)).astype(np.uint8)


def unit_colours(path: Path, **more: object) -> None:
    """Write a JSON that scales pixels to 0..1, as the small graphs need."""
    path.with_suffix(".json").write_text(json.dumps({"mean": 0, "std": 255, **more}))


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


def upright() -> np.ndarray:
    """Create a standing person (33, 2), 200 pixels from nose to ankles."""
    height = {"nose": 0, "eye": -5, "ear": 0, "shoulder": 35, "elbow": 70, "wrist": 100}
    height |= {"hip": 100, "knee": 150, "ankle": 200}
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


@pytest.mark.parametrize(
    ("make", "size", "atol"), [(heatmaps, (192, 256), 1.0), (simcc, (288, 384), 0.8)]
)
def test_known_pixels_are_found(
    tmp_path: Path, make: Callable[..., Path], size: tuple[int, int], atol: float
) -> None:
    path = make(tmp_path / "m.onnx", 17, *size)
    unit_colours(path)
    network = KeypointNetwork(path, threads=1)
    assert network.keypoint_set.name == "coco17"
    ours = [KEYPOINT_NAMES.index(name) for name in COCO_17]
    for where, region in REGIONS.items():
        (seen,) = network.estimate(spots(), [region])
        np.testing.assert_allclose(
            seen.keypoints_px[ours], SPOTS[np.arange(17) % 3], atol=atol, err_msg=where
        )
        assert seen.keypoints_confidence[ours].min() > 0.4
        assert seen.presence == 1.0
        assert not seen.world_landmarks.any()
        assert seen.disagreement == 0.0


@pytest.mark.parametrize("how", ["dark", "quarter"])
@pytest.mark.parametrize("udp", [False, True])
def test_heatmap_peaks_between_cells(tmp_path: Path, how: str, udp: bool) -> None:
    """Gaussians with known sub-cell centres: DARK finds them exactly, the quarter offset
    roughly.
    """
    rng = np.random.default_rng(3)
    middle = rng.uniform([6, 6], [41, 57], (17, 2))
    y, x = np.mgrid[:64, :48]
    maps = [np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * 2.0**2)) for u, v in middle]
    path = fixed(
        tmp_path / "m.onnx", 192, 256, {"heatmaps": np.stack(maps)[None].astype(np.float32)}
    )
    path.with_suffix(".json").write_text(json.dumps({"decode": how, "udp": udp}))
    network = KeypointNetwork(path, threads=1)
    points, scores = network._format.decode(
        network._graph.trial_outputs, network._graph, network._description
    )
    pixels = middle * ([191 / 47, 255 / 63] if udp else 4.0)
    assert np.abs(points - pixels).max() < (0.05 if how == "dark" else 1.1)
    assert scores.min() > 0.9


def numbered(count: int) -> tuple[np.ndarray, np.ndarray]:
    return np.stack([np.arange(count), 1000 - np.arange(count)], axis=1).astype(float), np.linspace(
        0.5, 1, count
    )


@pytest.mark.parametrize("name", KEYPOINT_SETS)
def test_keypoint_orders(name: str) -> None:
    points, scores = numbered(KEYPOINT_SETS[name].count)
    ours, confidence = KEYPOINT_SETS[name].to_blazepose(points, scores)
    at = dict(zip(KEYPOINT_NAMES, ours[:, 0], strict=True))
    known = dict(zip(KEYPOINT_NAMES, confidence, strict=True))
    assert at["nose"] == 0
    assert (at["left_shoulder"], at["right_shoulder"], at["right_ankle"]) == (5, 6, 16)
    assert known["right_ankle"] == scores[16]
    if name == "coco17":
        assert {n for n, c in known.items() if c > 0} == set(COCO_17)
    if name == "halpe26":
        assert (at["left_heel"], at["right_heel"]) == (24, 25)
        assert at["right_foot_index"] == pytest.approx(0.85 * 21 + 0.15 * 23)
        assert known["left_thumb"] == 0
    if name == "wholebody133":
        assert (at["left_heel"], at["right_heel"]) == (19, 22)
        assert at["left_foot_index"] == pytest.approx(0.85 * 17 + 0.15 * 18)
        assert (at["right_eye_outer"], at["left_eye_outer"], at["mouth_left"]) == (59, 68, 77)
        assert (at["left_index"], at["right_pinky"], at["right_thumb"]) == (96, 129, 115)
        assert min(known.values()) > 0
