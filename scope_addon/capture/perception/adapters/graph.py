# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's ONNX graph, from one image to arrays. It is run once when it is opened, so that errors
are reported then.

Its session has a process of its own, which ends where the network takes too much time or memory. A
file from somewhere may loop without end, ask for any memory, or crash onnxruntime; and it may do so
for one image alone, so that a trial before the capture would prove nothing. It costs a third of a
second at the start, and a few milliseconds an image to pass arrays through a pipe. The built-in
networks are opened in the capture's own process and pay nothing.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
import weakref
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .....solver.errors import ModelFileError
from ....arrays import Float64Array, Uint8Array
from ....errors import SetupError
from ....untrusted.onnx_file import check_onnx_file
from ..sessions import Execution, open_session, session_options_of
from .description import Description, description_path
from .network_server import LARGEST_ARRAYS, OUT_OF_MEMORY, receive, send

SERVER = Path(__file__).with_name("network_server.py")
OPENING_S = {"tensorrt": 1800.0}  # TensorRT compiles the network
DEFAULT_OPENING_S = 120.0
RUN_S = 60.0
# Memory beside the weights, which onnxruntime copies while it rearranges them.
BASE_BYTES = 4 << 30
WEIGHT_COPIES = 4
_FLAGS = getattr(subprocess, "CREATE_NO_WINDOW", 0)


class NetworkProcess:
    """A session of onnxruntime, with what `Graph` needs of its interface, in another process;
    thread-safe.
    """

    def __init__(self, provider: str, path: Path, threads: int) -> None:
        """Start the process and open the network.

        :param provider: our name of the execution provider.
        :raises ModelFileError: this takes too much time or memory.
        :raises RuntimeError: onnxruntime cannot open it, or its process crashed.
        :raises SetupError: the process cannot be started.
        """
        self._path = path
        self._lock = threading.Lock()
        self._limit_bytes = BASE_BYTES + WEIGHT_COPIES * _bytes_of_weights(path)
        self._limit_s = OPENING_S.get(provider, DEFAULT_OPENING_S)
        self._process = _start(str(path.resolve().parent) if provider == "cpu" else "")
        self._end = weakref.finalize(self, _end, self._process)
        providers, mem_pattern = session_options_of(provider)
        opened = self._ask(
            {
                "path": str(path),
                "threads": threads,
                "providers": providers,
                "mem_pattern": mem_pattern,
                "limit_bytes": self._limit_bytes,
            }
        )
        self._providers: list[str] = opened["providers"]
        self._inputs = [SimpleNamespace(name=n, type=t, shape=s) for n, t, s in opened["inputs"]]
        self._outputs = [SimpleNamespace(name=name) for name in opened["outputs"]]

    def get_providers(self) -> list[str]:
        """Return onnxruntime's names of the providers in use."""
        return self._providers

    def get_inputs(self) -> list[SimpleNamespace]:
        """Return the inputs, each with ``name``, ``type`` and ``shape``."""
        return self._inputs

    def get_outputs(self) -> list[SimpleNamespace]:
        """Return the outputs, each with its ``name``."""
        return self._outputs

    def run(self, _: None, inputs: dict[str, Any]) -> list[Any]:
        """Run the network on its only input.

        :return: arrays of numbers.
        :raises ModelFileError: it takes too much time or memory.
        :raises RuntimeError: it fails, or its process has ended.
        """
        ((name, array),) = inputs.items()
        with self._lock:
            answer = self._ask({"input": name}, [array])
            self._limit_s = RUN_S  # the first run may still compile
        return answer["arrays"]

    def _ask(self, request: dict[str, Any], arrays: list[Any] | None = None) -> dict[str, Any]:
        if not self._end.alive:
            raise RuntimeError("its process has ended")
        began = time.monotonic()
        try:
            assert self._process.stdin is not None
            assert self._process.stdout is not None
            send(self._process.stdin, {**request, "limit_s": self._limit_s}, arrays or [])
            answer = receive(self._process.stdout, LARGEST_ARRAYS)
        except (EOFError, OSError):
            raise self._ended(time.monotonic() - began) from None
        except ValueError as error:
            self._end()
            raise RuntimeError(f"its process sent no valid answer: {error}") from error
        except BaseException:
            self._end()  # an interrupted exchange cannot be resumed
            raise
        if "error" in answer:
            raise RuntimeError(answer["error"])
        return answer

    def _ended(self, elapsed_s: float) -> Exception:
        """Return the error for a process that ended instead of answering."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(5.0)
        status = self._process.returncode
        self._end()
        if status == OUT_OF_MEMORY:
            return ModelFileError(
                f"{self._path} was stopped because it took more than {self._limit_bytes / 1e9:.1f} "
                "GB of memory; choose a smaller network"
            )
        if elapsed_s >= self._limit_s:
            return ModelFileError(
                f"{self._path} was stopped because it gave no result within {self._limit_s:g} s; "
                "choose a faster network, or export this one again"
            )
        return RuntimeError(f"onnxruntime crashed in its process, which ended with status {status}")


def _start(folder: str) -> subprocess.Popen[bytes]:
    # An empty entry means the current folder, which isolated Python omits on purpose.
    parent = str(os.getpid())
    command = [sys.executable, "-I", "-S", str(SERVER), parent, folder, *(p for p in sys.path if p)]
    try:
        return subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            creationflags=_FLAGS,
        )
    except OSError as error:
        raise SetupError(
            f"the process for your network cannot be started ({error}); free some memory"
        ) from error


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    for stream in (process.stdin, process.stdout):
        with suppress(OSError):
            if stream is not None:
                stream.close()
    with suppress(subprocess.TimeoutExpired):
        process.wait(5.0)


def _bytes_of_weights(path: Path) -> int:
    """Return the size of an ONNX file and of what may be its external data: the files whose names
    begin with its own.

    The check of the file has confined external data to its folder.
    """
    with suppress(OSError):
        return sum(
            p.stat().st_size
            for p in path.parent.iterdir()
            if p.name.startswith(path.stem) and p.is_file()
        )
    return 0


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
