# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of the networks: custom networks and execution providers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from .record import Argument, Choice, Place, Property, declared, options_of

_NETWORKS = Place.COMMAND_LINE | Place.WORKER | Place.PREFERENCES

PROVIDERS = (
    Choice("auto", "Automatic", "A supported GPU if there is one, otherwise the CPU", 0),
    Choice("cpu", "CPU", "The processor", 1),
    Choice("cuda", "CUDA", "An NVIDIA GPU", 2),
    Choice(
        "tensorrt",
        "TensorRT",
        "An NVIDIA GPU with TensorRT, which takes minutes to compile each network on first use",
        3,
    ),
    Choice("directml", "DirectML", "Any GPU on Windows", 4),
    Choice("coreml", "Core ML", "Apple silicon", 5),
)


@dataclass(frozen=True)
class NetworkDeclaration:
    """What the networks are, and where they run."""

    detector: Path | None = declared(
        None,
        _NETWORKS,
        "custom person detector, an .onnx file",
        argument=Argument(metavar="FILE"),
        blender=Property(
            "detector_file",
            "Person Detector",
            "Custom detector (.onnx): YOLOX, YOLOv4, YOLOv8 and similar; built-in if empty",
        ),
    )
    keypoints: Path | None = declared(
        None,
        _NETWORKS,
        "custom keypoint network, an .onnx file",
        argument=Argument(metavar="FILE"),
        blender=Property(
            "keypoints_file",
            "Keypoint Network",
            "Custom keypoint network (.onnx): RTMPose, HRNet, ViTPose and similar; built-in if "
            "empty",
        ),
    )
    provider: str = declared(
        "auto",
        _NETWORKS | Place.LIVE | Place.LIVE_WORKER,
        "execution provider for the networks",
        choices=PROVIDERS,
        decides_result=False,
        argument=Argument(default_text="auto, the fastest available"),
        blender=Property(
            label="Execution Provider",
            description="Execution provider for the networks; if unavailable, the CPU is used and "
            "the result shows a"
            " warning",
        ),
    )
    threads: int = declared(
        0,
        _NETWORKS | Place.LIVE | Place.LIVE_WORKER,
        "CPU threads for the networks; 0: all cores",
        minimum=0,
        decides_result=False,
        argument=Argument(
            metavar="N", help="CPU threads for the networks", default_text="all cores"
        ),
        blender=Property(maximum=256),
    )


NETWORK_OPTIONS = options_of(NetworkDeclaration)
