# SPDX-License-Identifier: GPL-3.0-or-later
"""Run one ONNX network in a process of its own, within limits of time and memory.

    python -I -S network_server.py PARENT FOLDER SEARCH_PATH...

A script: of Scope it loads only the modules that end it with its parent, the process PARENT, and
that confine it to reading a network in FOLDER, so that it starts fast and a network finds little in
its process. FOLDER is empty where a GPU's driver needs more. Requests come on standard input,
answers leave on standard output: the length of a JSON text as four bytes, the text, and the
contents of the arrays that it describes.

The limits hold on every system, whatever the network does: the time is kept by a thread of the
interpreter's own, which needs no lock. Memory is limited by the system itself on Linux, and watched
by a thread elsewhere and on a GPU, whose drivers reserve addresses without end.
"""

import contextlib
import faulthandler
import importlib.util
import json
import os
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import IO, Any

OUT_OF_MEMORY = 77  # exit status
LARGEST_MESSAGE = 1 << 20  # bytes of the JSON text
LARGEST_ARRAYS = 1 << 28  # bytes of all arrays of an answer
_LENGTH_BYTES = 4
_INTERVAL_S = 0.05  # at which memory is watched
_CPU_PROVIDER = "CPUExecutionProvider"

Arrays = Sequence[Any]


def load_runtime() -> ModuleType:
    """Import onnxruntime without its telemetry.

    From version 1.29 on, which a user may install for a graphics card, the library in its wheels
    reports its start and every session to a server of Microsoft's, and keeps an identifier of the
    computer, unless this variable is set when the library is loaded.

    :raises ImportError: it is not installed, or cannot be loaded.
    """
    os.environ["ORT_DISABLE_TELEMETRY"] = "1"
    import onnxruntime

    return onnxruntime


def make_session(
    runtime: ModuleType, path: str, threads: int, providers: list[str], mem_pattern: bool
) -> Any:
    """Open an onnxruntime session, with the options of all our sessions.

    :param providers: onnxruntime's names.
    """
    options = runtime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    # Threads of one network that spin while waiting would take the cores from the next one.
    options.add_session_config_entry("session.force_spinning_stop", "1")
    options.log_severity_level = 4  # errors are raised as exceptions, with our messages
    options.enable_mem_pattern = mem_pattern
    return runtime.InferenceSession(path, options, providers=providers)


def send(stream: IO[bytes], message: Mapping[str, Any], arrays: Arrays = ()) -> None:
    """Write a message; ``arrays`` are described in it.

    :raises OSError: the other end is closed.
    """
    described = [{"dtype": array.dtype.str, "shape": array.shape} for array in arrays]
    text = json.dumps({**message, "arrays": described}).encode()
    stream.write(len(text).to_bytes(_LENGTH_BYTES, "little") + text)
    for array in arrays:
        stream.write(memoryview(array.reshape(-1)).cast("B") if array.size else b"")
    stream.flush()


def receive(stream: IO[bytes], largest_arrays: int) -> dict[str, Any]:
    """Read a message, with its ``arrays``.

    :param largest_arrays: bytes of all arrays together.
    :raises EOFError: the other end is closed.
    :raises ValueError: this is no message, or it is too large.
    """
    size = int.from_bytes(_read(stream, _LENGTH_BYTES), "little")
    if size > LARGEST_MESSAGE:
        raise ValueError("a message is too long")
    text = _read(stream, size)
    try:
        return _with_arrays(text, stream, largest_arrays)
    # The last of these errors is np.dtype's.
    except (KeyError, TypeError, OverflowError, RecursionError, SyntaxError) as error:
        raise ValueError(str(error)) from error


def _with_arrays(text: bytes, stream: IO[bytes], largest_arrays: int) -> dict[str, Any]:
    """Parse a message, and read its arrays."""
    import numpy as np

    message = json.loads(text)
    if not isinstance(message, dict):
        raise ValueError("a message is no object")
    arrays = []
    for described in message["arrays"]:
        dtype = np.dtype(described["dtype"])
        shape = [int(n) for n in described["shape"]]
        number = 1
        for n in shape:
            number *= n
        largest_arrays -= number * dtype.itemsize
        if dtype.kind not in "fiub" or min(shape, default=0) < 0 or largest_arrays < 0:
            raise ValueError("its arrays are too large, or not of numbers")
        arrays.append(np.frombuffer(_read(stream, number * dtype.itemsize), dtype).reshape(shape))
    return {**message, "arrays": arrays}


def _read(stream: IO[bytes], size: int) -> bytes:
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return data


class Server:
    """Answer requests about one network."""

    def __init__(self) -> None:
        self._session: Any = None
        self._watched = False

    def answer(self, request: dict[str, Any]) -> tuple[dict[str, Any], Arrays]:
        """Open the network or run it, in the time that the request gives it."""
        try:
            with _time_limit(request["limit_s"]):
                if "path" in request:
                    return self._open(request), ()
                return {}, self._run(request["input"], request["arrays"][0])
        except UnicodeDecodeError as error:
            return {"error": f"it has a name that is not UTF-8 text: {error}"}, ()
        except MemoryError:
            return {"error": "out of memory"}, ()
        except Exception as error:  # onnxruntime's exceptions have no common base
            return {"error": str(error)[:2000] or type(error).__name__}, ()

    def _open(self, request: dict[str, Any]) -> dict[str, Any]:
        self._limit_memory(request["limit_bytes"], on_cpu=request["providers"] == [_CPU_PROVIDER])
        self._session = session = make_session(
            load_runtime(),
            request["path"],
            request["threads"],
            request["providers"],
            request["mem_pattern"],
        )
        return {
            "providers": session.get_providers(),
            "inputs": [[i.name, i.type, i.shape] for i in session.get_inputs()],
            "outputs": [o.name for o in session.get_outputs()],
        }

    def _run(self, name: str, array: Any) -> Arrays:
        import numpy as np

        outputs = self._session.run(None, {name: array})
        if not all(
            isinstance(output, np.ndarray) and output.dtype.kind in "fiub" for output in outputs
        ):
            raise ValueError(
                "it has outputs that are not arrays of numbers; export it without these"
            )
        if sum(output.nbytes for output in outputs) > LARGEST_ARRAYS:
            raise ValueError(f"its outputs are larger than {LARGEST_ARRAYS >> 20} MB")
        return [np.ascontiguousarray(output).reshape(output.shape) for output in outputs]

    def _limit_memory(self, limit_bytes: int, *, on_cpu: bool) -> None:
        if on_cpu and sys.platform == "linux":
            import resource

            hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
            limit = limit_bytes if hard == resource.RLIM_INFINITY else min(limit_bytes, hard)
            resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))
        elif not self._watched:
            self._watched = True
            threading.Thread(target=watch_memory, args=(limit_bytes,), daemon=True).start()


@contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    """End the process, even in the middle of a call of a library, when a block takes too long."""
    with open(os.devnull, "w") as nowhere:
        faulthandler.dump_traceback_later(seconds, exit=True, file=nowhere)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()


def watch_memory(limit_bytes: int) -> None:
    """End the process when it takes so much more memory than now."""
    limit_bytes += used_bytes()
    while used_bytes() <= limit_bytes:
        time.sleep(_INTERVAL_S)
    os._exit(OUT_OF_MEMORY)


def used_bytes() -> int:
    """Return the memory that this process takes, or the most that it has taken so far."""
    if sys.platform == "win32":
        return _peak_on_windows()
    if sys.platform == "linux":  # where the peak begins with that of the parent
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def _peak_on_windows() -> int:
    """Return PROCESS_MEMORY_COUNTERS.PeakPagefileUsage, or 0 where it cannot be had."""
    import ctypes

    class Counters(ctypes.Structure):
        _fields_ = [
            ("cb", ctypes.c_uint32),
            ("faults", ctypes.c_uint32),
            *((f"size{k}", ctypes.c_size_t) for k in range(7)),
            ("peak", ctypes.c_size_t),
        ]

    library: Any = getattr(ctypes, "windll").kernel32  # noqa: B009  # on Windows alone
    counters = Counters(cb=ctypes.sizeof(Counters))
    library.GetCurrentProcess.restype = ctypes.c_void_p
    library.K32GetProcessMemoryInfo.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint32]
    found = library.K32GetProcessMemoryInfo(
        library.GetCurrentProcess(), ctypes.byref(counters), counters.cb
    )
    return int(counters.peak) if found else 0


def main(parent: int, folder: str) -> None:
    """Answer requests until the parent closes the pipe, or ends, also in the middle of a run.

    :param parent: process id.
    :param folder: with the network; empty: the process is not confined.
    :raises ValueError: a message of the parent is damaged.
    """
    requests = os.fdopen(os.dup(0), "rb")
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever libraries print
    parents_end = _module("parent")
    if folder:
        _confine(folder)
    # In a thread, which is confined as well.
    parents_end.end_with_parent(receive=None, parent=parent)
    server = Server()
    with contextlib.suppress(EOFError, OSError, KeyboardInterrupt):
        while True:
            send(answers, *server.answer(receive(requests, sys.maxsize)))
    os._exit(0)  # without the exit handlers, which would wait for threads


def _module(name: str) -> ModuleType:
    """Load a module of Scope's that needs no other."""
    file = Path(__file__).resolve().parents[3] / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _confine(folder: str) -> None:
    """Let this process read the network, Python and the system, and write nothing."""
    # Threads of numpy's, which are not needed, would not be confined.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with contextlib.suppress(ImportError):  # which the first request meets again
        load_runtime()  # whose libraries may lie anywhere
    readable = [folder, sys.prefix, sys.base_prefix, *sys.path]
    _module("confinement").confine([], map(Path, readable))


if __name__ == "__main__":
    parent, folder, *search_path = sys.argv[1:]
    sys.path[:] = search_path + [p for p in sys.path if p not in search_path]
    main(int(parent), folder)
