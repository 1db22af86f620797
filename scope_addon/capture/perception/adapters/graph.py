# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's ONNX graph, from one image to arrays. It is run once when it is opened, so that errors
are reported then.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .....solver.errors import ModelFileError
from ....arrays import Float64Array, Uint8Array
from ....untrusted.onnx_file import check_onnx_file
from ..sessions import Execution, open_session
from .description import Description, description_path
from .network_process import NetworkProcess

Outputs = list[NDArray[Any]]

_TYPES = {"tensor(float)": np.float32, "tensor(float16)": np.float16, "tensor(uint8)": np.uint8}
_LARGEST_SIDE = 4096


@dataclass(frozen=True)
class Normalization:
    """input = (pixel − mean) / std, pixels 0..255, channels in ``channel_order`` (rgb or bgr)."""

    mean: tuple[float, ...] = (0.0,)
    std: tuple[float, ...] = (1.0,)
    channel_order: str = "rgb"

    def with_description(self, description: Description) -> Normalization:
        """Override with the JSON's values; default means and deviations are reordered to the JSON's
        channel order.
        """
        order = description.channel_order or self.channel_order
        step = 1 if order == self.channel_order else -1
        return Normalization(
            description.mean or self.mean[::step], description.std or self.std[::step], order
        )


UNIT = Normalization(std=(255.0,))
PIXELS_BGR = Normalization(channel_order="bgr")
IMAGENET = Normalization((123.675, 116.28, 103.53), (58.395, 57.12, 57.375))


class Graph:
    """An open graph.

    ``width``, ``height`` of its input in pixels; ``names``, ``shapes`` of its outputs;
    ``trial_outputs``: those of a grey image.

    :raises ModelFileError: its input is not one image, or it cannot be run.
    """

    def __init__(
        self, path: Path, description: Description, threads: int, execution: Execution | None = None
    ) -> None:
        check_onnx_file(path)
        self.path = path
        self._session = open_session(path, threads, execution, NetworkProcess)
        inputs = self._session.get_inputs()
        names = [i.name for i in inputs]
        shapes = [i.shape for i in inputs]
        self.names = [output.name for output in self._session.get_outputs()]
        if len(inputs) != 1:
            raise ModelFileError(
                f"{path} takes {len(inputs)} inputs ({', '.join(names)}); only graphs with one "
                "image input can be used"
            )
        self._name = names[0]
        if inputs[0].type not in _TYPES:
            raise ModelFileError(
                f"{path} takes {inputs[0].type}; only images of {', '.join(_TYPES)} can be given"
            )
        self._type = _TYPES[inputs[0].type]
        self._channels_last, self.width, self.height = self._input_layout(shapes[0], description)
        self.trial_outputs = self.run(np.full((self.height, self.width, 3), 114, np.uint8), UNIT)

    @property
    def shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the outputs."""
        return [output.shape for output in self.trial_outputs]

    def run(self, picture_rgb: Uint8Array, normalization: Normalization) -> Outputs:
        """Run the graph.

        :param picture_rgb: (H, W, 3) uint8, of the input's size.
        :return: the outputs, float16 and float64 converted to float32.
        :raises ModelFileError: the graph fails.
        """
        picture: NDArray[Any] = (
            picture_rgb if normalization.channel_order == "rgb" else picture_rgb[..., ::-1]
        )
        if self._type is not np.uint8:
            mean, std = (np.asarray(v, np.float32) for v in (normalization.mean, normalization.std))
            picture = (picture.astype(np.float32) - mean) / std
        blob = picture[None] if self._channels_last else picture.transpose(2, 0, 1)[None]
        try:
            outputs = self._session.run(None, {self._name: np.ascontiguousarray(blob, self._type)})
        except RuntimeError as error:
            raise ModelFileError(
                f"{self.path} cannot be run on an image of {self.width} x {self.height} "
                f"({' '.join(str(error).split())}); export it again, or correct "
                f"{description_path(self.path).name}"
            ) from error
        return [o.astype(np.float32) if o.dtype.kind == "f" else o for o in outputs]

    def _input_layout(self, shape: list[Any], description: Description) -> tuple[bool, int, int]:
        """Derive whether the channels come last, and the width and height."""
        required = (
            f"{self.path} must take one colour image, shape (1, 3, height, width), but takes "
            f"{shape}"
        )
        if len(shape) != 4 or (isinstance(shape[0], int) and shape[0] != 1):
            raise ModelFileError(f"{required}; export it with batch size 1")
        channels_last = shape[1] != 3 and shape[3] == 3
        if shape[3 if channels_last else 1] != 3 and isinstance(
            shape[3 if channels_last else 1], int
        ):
            raise ModelFileError(f"{required}; choose a network for colour images")
        height, width = shape[1:3] if channels_last else shape[2:]
        if description.input_size is not None:
            new_width, new_height = description.input_size
            for fixed, new in ((width, new_width), (height, new_height)):
                if isinstance(fixed, int) and fixed != new:
                    raise ModelFileError(
                        f"{description_path(self.path)} specifies input_size "
                        f"{list(description.input_size)}, but "
                        f"{self.path.name} takes images of {width} x {height}; correct it"
                    )
            width = new_width
            height = new_height
        if not (isinstance(width, int) and isinstance(height, int)):
            raise ModelFileError(
                f"{self.path} takes images of any size; put its training size in "
                f'{description_path(self.path)}, such as {{"input_size": [640, 640]}}'
            )
        if not (16 <= width <= _LARGEST_SIDE and 16 <= height <= _LARGEST_SIDE):
            raise ModelFileError(f"{required}; images of 16 to {_LARGEST_SIDE} pixels can be given")
        return channels_last, width, height

    def unrecognized(
        self, what: str, types: tuple[str, ...], why: str = "its outputs match no known type"
    ) -> ModelFileError:
        """Create the error for a graph of unknown type, with its outputs and the JSON to write."""
        outputs = ", ".join(
            f"{name} {list(shape)}" for name, shape in zip(self.names, self.shapes, strict=True)
        )
        return ModelFileError(
            f"{self.path} cannot be used as {what}: {why}. Its outputs are {outputs}. If it is one "
            "of "
            f"{', '.join(types)}, "
            f'create {description_path(self.path)} with {{"type": "{types[0]}"}}, or the correct '
            "type"
        )


def finite(values: NDArray[Any]) -> Float64Array:
    """Convert an array (...) to float64, with 0 in place of NaN and infinity: as a score, 0 means
    nothing was found.
    """
    return np.nan_to_num(values.astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0)
