# SPDX-License-Identifier: GPL-3.0-or-later
"""The packages to download, and the networks in them with the names of their outputs."""

from dataclasses import dataclass

from .to_onnx import Outputs


@dataclass(frozen=True)
class Package:
    """One pinned archive: ``file_name`` in the download cache, ``sha256`` of its bytes, ``source`` for messages."""

    file_name: str
    sha256: str
    source: str


@dataclass(frozen=True)
class Network:
    """One TFLite file and the graph outputs to keep, as (position in the TFLite outputs, new name, NHWC shape).

    Those of ``on_request`` are computed only when asked for, see `convert_model`.
    """

    name: str
    package: Package
    member: str
    input_shape: tuple[int, ...]
    outputs: Outputs
    on_request: Outputs = ()


WHEEL = Package(
    "mediapipe-0.10.14-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl",
    "a807328339e7356fda0bb14df12fedbf1d33bdf81649c5f8666b0026b1cc30b4",
    "mediapipe==0.10.14 on PyPI",
)
TARBALL = Package(
    "mediapipe-pose-0.5.1675469404.tgz",
    "8bb349a7b3a3ba699df23be804ddd3b3eab810b50b15406894be257859388a84",
    "@mediapipe/pose@0.5.1675469404 on npm",
)
LICENSE_MEMBER = "mediapipe-0.10.14.dist-info/LICENSE"

_LANDMARK_OUTPUTS = (
    (0, "landmarks", (1, 195)),
    (1, "presence", (1, 1)),
    (3, "heatmap", (1, 64, 64, 39)),
    (4, "world", (1, 117)),
)
_MASK = ((2, "mask", (1, 256, 256, 1)),)  # logits of the region's person; it costs more than the lite network itself

NETWORKS = (
    Network(
        "pose_detection",
        WHEEL,
        "mediapipe/modules/pose_detection/pose_detection.tflite",
        (1, 224, 224, 3),
        ((0, "boxes", (1, 2254, 12)), (1, "scores", (1, 2254, 1))),
    ),
    *(
        Network(
            f"pose_landmark_{size}",
            TARBALL,
            f"package/pose_landmark_{size}.tflite",
            (1, 256, 256, 3),
            _LANDMARK_OUTPUTS,
            _MASK,
        )
        for size in ("lite", "full", "heavy")
    ),
    Network(
        "palm_detection",
        WHEEL,
        "mediapipe/modules/palm_detection/palm_detection_full.tflite",
        (1, 192, 192, 3),
        ((0, "boxes", (1, 2016, 18)), (1, "scores", (1, 2016, 1))),
    ),
    Network(
        "hand_landmark",
        WHEEL,
        "mediapipe/modules/hand_landmark/hand_landmark_full.tflite",
        (1, 224, 224, 3),
        ((0, "landmarks", (1, 63)), (1, "presence", (1, 1)), (2, "handedness", (1, 1)), (3, "world", (1, 63))),
    ),
)
