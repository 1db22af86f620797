# SPDX-License-Identifier: GPL-3.0-or-later
"""The real worker process without Blender: search path, messages, and its end when the parent
ends.
"""

import inspect
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from scope.scope_addon.capture import pipeline
from scope.scope_addon.capture.perception.lifter import LIFTER_FILE
from scope.scope_addon.capture.perception.sessions import LANDMARK_NETWORK_OF_QUALITY, network_path
from scope.scope_addon.errors import SetupError, UsageError
from scope.scope_addon.job.process import START_SCRIPT, WorkerFailedError, WorkerProcess
from scope.scope_addon.job.request import JobRequest, code_version
from scope.scope_addon.motion import Motion
from scope.scope_addon.parent import STOPPED
from scope.solver import learned_prior
from scope.solver.body_file import BUILT_IN, GROWTH

from .long_clip import played_again_and_again
from .processes import runs, wait_for

ROOT = START_SCRIPT.parents[2]
OTHER_NETWORKS = ("pose_detection", "palm_detection", "hand_landmark")
SAMPLE = str(ROOT / "assets" / "sample" / "sample.mp4")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "job").mkdir()
    return tmp_path / "job"


@pytest.mark.slow
def test_an_isolated_worker_starts_and_reports(folder, tmp_path):
    """-I ignores PYTHONPATH, the script's folder and the current folder, as inside Blender."""
    request = JobRequest(played_again_and_again(tmp_path / "long.mp4"), quality="fast", threads=1)
    worker = WorkerProcess(request, folder, None, [sys.executable, "-I"])
    messages = []
    wait_for(
        lambda: (
            messages.extend(worker.poll())
            or {"progress", "preview"} <= {m["event"] for m in messages}
        )
    )
    assert all(m["event"] in {"progress", "preview"} for m in messages)
    assert worker.alive
    worker.close()
    wait_for(lambda: not worker.alive)  # it has a low priority, also while it ends
    assert not folder.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="looks at /proc")
def test_the_worker_ends_when_its_parent_is_killed(folder, tmp_path):
    footage = played_again_and_again(tmp_path / "long.mp4")
    code = (
        "import sys, time\nfrom pathlib import Path\n"
        "from scope.scope_addon.job.process import WorkerProcess, JobRequest\n"
        f"worker = WorkerProcess(JobRequest({footage!r}), Path({str(folder)!r}), None)\n"
        "while not worker.poll(): time.sleep(0.01)\n"
        "print(worker.pid, flush=True); time.sleep(600)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    pid = int(parent.stdout.readline())
    assert runs(pid)
    parent.send_signal(signal.SIGKILL)
    parent.communicate()
    wait_for(lambda: not runs(pid))
    wait_for(lambda: not folder.exists())


def test_a_worker_without_a_request_leaves_nothing_behind(folder):
    command = [
        sys.executable,
        str(START_SCRIPT),
        str(ROOT),
        str(folder),
        *(p for p in sys.path if p),
    ]
    assert subprocess.run(command, stdin=subprocess.DEVNULL, check=False).returncode == 1
    assert not folder.exists()


def test_a_worker_that_keeps_writing_without_a_parent_leaves_nothing_behind(tmp_path):
    folder = tmp_path / "jobs" / "job-1"
    folder.mkdir(parents=True)
    code = (
        "import sys\n"
        "from pathlib import Path\n"
        "from scope.scope_addon.job.worker import _remove\n"
        "from scope.scope_addon.parent import end_with_parent\n"
        f"folder, number = Path({str(folder)!r}), 0\n"
        "end_with_parent(lambda: _remove(folder))\n"
        "while True:\n"
        "    number += 1\n"
        "    try:\n"
        "        (folder / str(number % 500)).write_text('half of something')\n"
        "    except OSError:\n"
        "        pass\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE)
    wait_for(lambda: len(list(folder.iterdir())) > 100)
    process.stdin.close()
    assert process.wait(300) == STOPPED
    assert list((tmp_path / "jobs").iterdir()) == []


def test_a_missing_library_is_reported(folder, tmp_path, monkeypatch):
    (tmp_path / "cv2").mkdir()
    (tmp_path / "cv2" / "__init__.py").write_text("raise ImportError('wrong platform')")
    monkeypatch.syspath_prepend(str(tmp_path))
    worker = WorkerProcess(JobRequest(SAMPLE), folder, None, [sys.executable, "-I"])
    with pytest.raises(WorkerFailedError, match=r"wrong platform.*disable Scope"):
        wait_for(lambda: worker.poll() and False)
    worker.close()


def test_a_missing_interpreter_is_an_error(folder):
    with pytest.raises(SetupError, match="nowhere"):
        WorkerProcess(JobRequest(SAMPLE), folder, None, ["/nowhere/python"])
    assert not folder.exists()


def test_requests_are_sent_as_one_line():
    request = JobRequest(
        "a\nb.mp4", quality="fast", fov_deg=60.0, heights_m=(1.8, 1.7), calibration="lens.json"
    )
    assert "\n" not in request.to_json()
    assert JobRequest.from_json(request.to_json()).to_json() == request.to_json()


@pytest.mark.parametrize("text", ["[]", "{}", '{"footage": "a", "footage": '])
def test_an_invalid_request_is_an_error(text):
    with pytest.raises(UsageError, match="not a capture request"):
        JobRequest.from_json(text)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"colour": 1}, "no option 'colour'"),
        ({"quality": "superb"}, "quality must be one of fast, balanced, best, not 'superb'"),
        ({"people": 1.5}, "people must be int or str, not 1.5"),
        ({"threads": True}, "threads must be int, not True"),
        ({"heights_m": 1.8}, "heights_m must be a list, not 1.8"),
        ({"heights_m": [1.8, "tall"]}, "heights_m must be float or int, not 'tall'"),
    ],
)
def test_an_invalid_value_of_a_request_is_an_error_that_names_it(values, message):
    with pytest.raises(UsageError, match=message):
        JobRequest.from_json(json.dumps({"footage": "a", **values}))


def test_keys_differ_if_the_result_may_differ(tmp_path):
    clip = tmp_path / "clip.mp4"
    clip.write_bytes(b"x" * 100)
    request = JobRequest(str(clip))
    assert request.key("1") == JobRequest(str(clip), threads=3).key("1")
    assert request.key("1") != JobRequest(str(clip), provider="cuda").key("1")
    assert request.key("1") != request.key("2")
    assert request.key("1") != JobRequest(str(clip), quality="fast").key("1")
    assert request.key("1") != JobRequest(str(clip), hands="on").key("1")
    assert request.key("1") != JobRequest(str(clip), heights_m=(1.8,)).key("1")
    key = request.key("1")
    status = clip.stat()
    clip.write_bytes(b"x" * 99 + b"y")
    os.utime(clip, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert request.key("1") != key


def test_the_code_version_changes_with_every_file_that_decides_the_result(tmp_path):
    networks = [
        network_path(name) for name in (*LANDMARK_NETWORK_OF_QUALITY.values(), *OTHER_NETWORKS)
    ]
    deciding = [*networks, *set(BUILT_IN.values()), GROWTH, LIFTER_FILE, learned_prior.BUILT_IN]
    deciding += [Path(inspect.getfile(part)) for part in (learned_prior, pipeline, Motion)]
    # which cannot be imported without Blender
    deciding.append(ROOT / "scope_addon" / "scene" / "export" / "export.py")
    others = [SAMPLE, ROOT / "README.md", ROOT / "scope_addon" / "ui" / "panel.py"]
    copies = [tmp_path / Path(file).relative_to(ROOT) for file in (*deciding, *others)]
    for copy in copies:
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(b"before")
    versions = [code_version(tmp_path)]
    for copy in copies:
        copy.write_bytes(b"after!")
        os.utime(copy, ns=(1, 1))  # same size, another modification time
        versions.append(code_version(tmp_path))
    assert len(set(versions)) == 1 + len(deciding)
    assert len(set(versions[len(deciding) :])) == 1


def test_compiled_code_is_stored_in_the_given_folder(folder, tmp_path):
    script = tmp_path / "script.py"
    result = (
        "{'event': 'result', 'motions': ['a.npz'], 'report': {}, 'at': "
        "os.environ['NUMBA_CACHE_DIR']}"
    )
    script.write_text(f"import json, os; print(json.dumps({result}))")
    worker = WorkerProcess(
        JobRequest(SAMPLE), folder, tmp_path / "kernels", [sys.executable, "-I"], script
    )
    messages = []
    wait_for(lambda: messages.extend(worker.poll()) or worker.finished)
    worker.wait()
    assert messages[0]["at"] == str(tmp_path / "kernels")
    assert list(folder.iterdir()) == []
    worker.close()


@pytest.mark.skipif(sys.platform != "linux", reason="file names are Unicode on this system")
def test_a_request_for_footage_whose_name_is_not_utf8(folder, tmp_path):
    path = tmp_path / os.fsdecode(b"caf\xe9.mp4")
    path.write_text("no video")
    request = JobRequest(str(path))
    assert JobRequest.from_json(request.to_json()).footage == request.footage
    assert request.key("1") != JobRequest(SAMPLE).key("1")
    worker = WorkerProcess(request, folder, None, [sys.executable, "-I"])
    with pytest.raises(WorkerFailedError, match="cannot|is not") as failed:
        wait_for(lambda: worker.poll() and False)
    worker.close()
    str(failed.value).encode()
