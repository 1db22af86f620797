# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's ONNX graph: one picture in, arrays out. Tried once when it is opened, so that what is wrong is told then."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .....solver.errors import ModelFileError
from ..execution import Execution
from ..sessions import open_session
from .description import Description, description_path
from .onnx_file import check_onnx_file

_TYPES = {"tensor(float)": np.float32, "tensor(float16)": np.float16, "tensor(uint8)": np.uint8}
_LARGEST_SIDE = 4096


@dataclass(frozen=True)
class Normalization:
    """input = (pixel − mean) / std, pixels 0..255, channels in ``channel_order`` (rgb or bgr)."""

    mean: tuple[float, ...] = (0.0,)
    std: tuple[float, ...] = (1.0,)
    channel_order: str = "rgb"

    def given(self, said: Description) -> Normalization:
        """This, but where the JSON says otherwise. Its numbers are in its order of channels; ours follow that order."""
        order = said.channel_order or self.channel_order
        step = 1 if order == self.channel_order else -1
        return Normalization(said.mean or self.mean[::step], said.std or self.std[::step], order)


UNIT = Normalization(std=(255.0,))
PIXELS_BGR = Normalization(channel_order="bgr")
IMAGENET = Normalization((123.675, 116.28, 103.53), (58.395, 57.12, 57.375))


class Graph:
    """``width``, ``height`` of the picture it takes; ``names``, ``shapes`` ``trial`` of its outputs for a grey one.

    :raises ModelFileError: not one picture in, or it cannot be run.
    """

    def __init__(self, path: Path, said: Description, threads: int, execution: Execution | None = None) -> None:
        check_onnx_file(path)
        self.path = path
        self._session = open_session(path, threads, execution)
        inputs = self._session.get_inputs()
        try:
            names, shapes = [i.name for i in inputs], [i.shape for i in inputs]
            self.names = [output.name for output in self._session.get_outputs()]
        except UnicodeDecodeError as error:
            raise ModelFileError(f"{path} has a name that is not UTF-8 text ({error}); export it again") from error
        if len(inputs) != 1:
            raise ModelFileError(
                f"{path} takes {len(inputs)} inputs ({', '.join(names)}); only graphs that take one picture do"
            )
        self._name = names[0]
        if inputs[0].type not in _TYPES:
            raise ModelFileError(f"{path} takes {inputs[0].type}; only pictures of {', '.join(_TYPES)} can be given")
        self._type = _TYPES[inputs[0].type]
        self._channels_last, self.width, self.height = self._input_layout(shapes[0], said)
        self.trial = self.run(np.full((self.height, self.width, 3), 114, np.uint8), UNIT)

    @property
    def shapes(self) -> list[tuple[int, ...]]:
        """Of the outputs."""
        return [output.shape for output in self.trial]

    def run(self, picture_rgb: np.ndarray, normalization: Normalization) -> list[np.ndarray]:
        """The outputs for a (height, width, 3) uint8 picture, floats as float32.

        :raises ModelFileError: the graph fails.
        """
        picture = picture_rgb if normalization.channel_order == "rgb" else picture_rgb[..., ::-1]
        if self._type is not np.uint8:
            mean, std = (np.asarray(v, np.float32) for v in (normalization.mean, normalization.std))
            picture = (picture.astype(np.float32) - mean) / std
        blob = picture[None] if self._channels_last else picture.transpose(2, 0, 1)[None]
        try:
            outputs = self._session.run(None, {self._name: np.ascontiguousarray(blob, self._type)})
        except Exception as error:  # onnxruntime's exceptions share no base of their own
            raise ModelFileError(
                f"{self.path} cannot be run on a picture of {self.width} x {self.height} "
                f"({' '.join(str(error).split())}); export it again, or correct {description_path(self.path).name}"
            ) from error
        if not all(isinstance(output, np.ndarray) for output in outputs):
            raise ModelFileError(f"{self.path} gives other things than arrays; export it without them")
        return [o.astype(np.float32) if o.dtype.kind == "f" else o for o in outputs]

    def _input_layout(self, shape: list, said: Description) -> tuple[bool, int, int]:
        """Whether the channels come last, width and height."""
        wanted = f"{self.path} must take one colour picture, shape (1, 3, height, width), but takes {shape}"
        if len(shape) != 4 or (isinstance(shape[0], int) and shape[0] != 1):
            raise ModelFileError(f"{wanted}; export it with batch size 1")
        channels_last = shape[1] != 3 and shape[3] == 3
        if shape[3 if channels_last else 1] != 3 and isinstance(shape[3 if channels_last else 1], int):
            raise ModelFileError(f"{wanted}; choose a network for colour pictures")
        height, width = shape[1:3] if channels_last else shape[2:]
        if said.input_size is not None:
            asked_width, asked_height = said.input_size
            for mine, asked in ((width, asked_width), (height, asked_height)):
                if isinstance(mine, int) and mine != asked:
                    raise ModelFileError(
                        f"{description_path(self.path)} says input_size {list(said.input_size)}, but {self.path.name} "
                        f"takes pictures of {width} x {height}; correct it"
                    )
            width, height = asked_width, asked_height
        if not (isinstance(width, int) and isinstance(height, int)):
            raise ModelFileError(
                f"{self.path} takes pictures of any size; write the size it was trained for into "
                f'{description_path(self.path)}, such as {{"input_size": [640, 640]}}'
            )
        if not (16 <= width <= _LARGEST_SIDE and 16 <= height <= _LARGEST_SIDE):
            raise ModelFileError(f"{wanted}; pictures of 16 to {_LARGEST_SIDE} pixels can be given")
        return channels_last, width, height

    def unrecognised(
        self, what: str, types: tuple[str, ...], why: str = "its outputs do not tell what it is"
    ) -> ModelFileError:
        """The error for a graph that cannot be told: what it gives, and which JSON to write."""
        gives = ", ".join(f"{name} {list(shape)}" for name, shape in zip(self.names, self.shapes, strict=True))
        return ModelFileError(
            f"{self.path} cannot be used as {what}: {why}. It gives {gives}. If it is one of {', '.join(types)}, write "
            f'{description_path(self.path)} with {{"type": "{types[0]}"}} or the type it is'
        )


def sound(values: np.ndarray) -> np.ndarray:
    """The values with everything that is not finite as 0: a score of nothing, a place nobody asks for."""
    return np.nan_to_num(values.astype(float), nan=0.0, posinf=0.0, neginf=0.0)
