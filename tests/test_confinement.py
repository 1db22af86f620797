# SPDX-License-Identifier: GPL-3.0-or-later
"""The processes that decode other people's files are confined: a hostile decoder is played by code
that attempts what they must not do.
"""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from scope.scope_addon.capture.perception.adapters import graph
from scope.scope_addon.capture.perception.adapters.graph import SERVER, NetworkProcess
from scope.scope_addon.confinement import limits_files
from scope.scope_addon.job.process import START_SCRIPT, WorkerFailedError, WorkerProcess
from scope.scope_addon.job.request import JobRequest
from scope.scope_addon.temporary import TEMPORARY_VARIABLES

from .capture.small_graphs import simcc
from .forbidden import what_succeeds
from .job.processes import wait_for

pytestmark = pytest.mark.skipif(not limits_files(), reason="this system cannot limit files")

ROOT = Path(__file__).resolve().parents[1]
SAMPLE = str(ROOT / "assets" / "sample" / "sample.mp4")
OF_CALLS = ["start a program", "connect", "use a local socket"]
# Of a hostile decoder, with the folder and the port of `outside`.
ATTEMPT = "from scope.tests.forbidden import what_succeeds\nfrom pathlib import Path\n"


@pytest.fixture
def port() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    folder = tmp_path / "outside"
    (folder / "empty").mkdir(parents=True)
    (folder / "old").write_bytes(b"old")
    (folder / "lost").write_bytes(b"lost")
    return folder


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The system's temporary folder, which may be written to, and has pytest's."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    for variable in TEMPORARY_VARIABLES:
        monkeypatch.setenv(variable, str(folder))
    return folder


def python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=600
    )


def confined(arguments: str, outside: Path, port: int, first: str = "") -> list[str]:
    """What succeeds in a process of its own that is confined with these arguments."""
    code = (
        f"{ATTEMPT}import json\n"
        "from scope.scope_addon import confinement\n"
        f"{first}\n"
        f"confinement.confine({arguments})\n"
        f"print(json.dumps(what_succeeds(Path({str(outside)!r}), {port})))"
    )
    ended = python(code)
    assert ended.returncode == 0, ended.stderr
    return list(json.loads(ended.stdout))


def test_without_it_everything_succeeds(outside: Path, port: int) -> None:
    assert len(what_succeeds(outside, port)) == 11


def test_nothing_is_written_started_or_connected_to(outside: Path, port: int) -> None:
    assert confined("[]", outside, port) == []
    assert (outside / "old").read_bytes() == b"old"
    assert confined("[], connects=True", outside, port) == OF_CALLS[1:]
    assert confined("[], starts_programs=True", outside, port) == OF_CALLS[:1]


def test_what_the_system_cannot_limit_is_as_before(outside: Path, port: int) -> None:
    assert confined("[]", outside, port, "confinement.platform.machine = str") == OF_CALLS
    files = confined("[]", outside, port, "confinement._OLDEST_VERSION = 1000")
    assert "create" in files
    assert not set(files) & set(OF_CALLS)


def test_a_folder_of_results_is_written_to_as_before(outside: Path, port: int) -> None:
    found = confined(f"[Path({str(outside)!r})]", outside, port)
    assert len(found) == 11 - len(OF_CALLS)


def test_threads_that_run_already_do_not_connect_either() -> None:
    ended = python(
        "import socket, threading\n"
        "from scope.scope_addon.confinement import confine\n"
        "is_confined = threading.Event()\n"
        "def connect():\n"
        "    is_confined.wait()\n"
        "    socket.socket()\n"
        "thread = threading.Thread(target=connect); thread.start()\n"
        "confine([]); is_confined.set(); thread.join()"
    )
    assert "PermissionError" in ended.stderr


@pytest.mark.slow
@pytest.mark.usefixtures("blender_module")
def test_a_command_is_confined_and_writes_its_results(
    outside: Path, port: int, tmp_path: Path, temporary: Path
) -> None:
    results = tmp_path / "results"
    elsewhere = tmp_path / "elsewhere"
    results.mkdir()
    elsewhere.mkdir()
    (results / "link.npz").symlink_to(elsewhere / "motion.npz")
    code = (
        f"{ATTEMPT}import sys\n"
        "from scope.scope_addon import cli\n"
        "from scope.scope_addon.capture import pipeline\n"
        "true_capture = pipeline.capture\n"
        "def capture(*arguments, **named):\n"
        f"    print('done:', what_succeeds(Path({str(outside)!r}), {port}), file=sys.stderr)\n"
        "    return true_capture(*arguments, **named)\n"
        "pipeline.capture = capture\n"
        "cli.run()"
    )
    paths = [str(results / name) for name in ("link.npz", "motion.csv", "body.blend")]
    outputs = [each for path in paths for each in ("-o", path)]
    ended = python(
        code, "capture", SAMPLE, "--end", "0.1", "--quality", "fast", "--quiet", *outputs
    )
    assert ended.returncode == 0, ended.stderr
    assert "done: []" in ended.stderr
    assert (results / "link.npz").is_symlink()
    assert all(Path(path).stat().st_size for path in paths)
    assert not list(temporary.iterdir())


def test_the_panels_worker_is_confined(
    outside: Path, port: int, tmp_path: Path, temporary: Path
) -> None:
    """With the thread that waits for the end of Blender."""
    attempt = (
        f"    sys.path.append({str(ROOT)!r})\n"
        "    from scope.scope_addon.job import worker\n"
        "    from tests.forbidden import what_succeeds\n"
        "    def run(request, folder, reporter, commands):\n"
        f"        done = what_succeeds(Path({str(outside)!r}), {port})\n"
        "        (folder / 'inside').write_bytes(b'1')\n"
        "        reporter.send('error', message=f'done: {done}')\n"
        "    worker.run = run\n"
        "    main(Path(job_folder))"
    )
    script = tmp_path / "start.py"
    main = "    main(Path(job_folder))"
    script.write_text(START_SCRIPT.read_text("utf-8").replace(main, attempt), "utf-8")
    job = tmp_path / "cache" / "jobs" / "job"
    job.mkdir(parents=True)
    worker = WorkerProcess(JobRequest(SAMPLE), job, None, [sys.executable, "-I"], script)
    said = []

    def has_said() -> bool:
        try:
            worker.poll()
        except WorkerFailedError as error:
            said.append(str(error))
        return bool(said)

    wait_for(has_said)
    worker.close()
    assert said == ["done: []"]


def test_the_process_of_a_network_reads_nothing_else(
    outside: Path, port: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = tmp_path / "server.py"
    script.write_text(
        "import sys\n"
        "from pathlib import Path\n"
        f"sys.path[:0] = [*sys.argv[3:], {str(SERVER.parent)!r}, {str(ROOT)!r}]\n"
        "import network_server\n"
        "from tests.forbidden import what_succeeds\n"
        "def attempt(server, request):\n"
        f"    outside = Path({str(outside)!r})\n"
        f"    done = what_succeeds(outside, {port})\n"
        "    for read in ((outside / 'old').read_bytes, lambda: list(outside.iterdir())):\n"
        "        try:\n"
        "            read()\n"
        "            done.append('read')\n"
        "        except PermissionError:\n"
        "            pass\n"
        "    raise ValueError(f'done: {done}')\n"
        "network_server.Server._open = attempt\n"
        "network_server.main(int(sys.argv[1]), sys.argv[2])\n",
        "utf-8",
    )
    monkeypatch.setattr(graph, "SERVER", script)
    (tmp_path / "networks").mkdir()
    path = simcc(tmp_path / "networks" / "m.onnx", 17, 32, 32)
    with pytest.raises(RuntimeError, match=r"^done: \[\]$"):
        NetworkProcess("cpu", path, 1)
