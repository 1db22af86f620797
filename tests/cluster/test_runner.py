# SPDX-License-Identifier: GPL-3.0-or-later
"""A batch on a cluster of two worker processes: one good output per clip, whatever becomes of
workers and scheduler.
"""

import importlib
import json
import os
import signal
import subprocess
import sys
import threading
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest
from scope.scope_addon.cli import main
from scope.scope_addon.errors import ClusterError
from scope.scope_addon.job.batch import REPORT_NAME
from scope.scope_addon.job.clip_task import CaptureSettings, ClipTask

from ..job.processes import runs, wait_for
from ..required import package

pytestmark = pytest.mark.skipif(os.name == "nt", reason="sends signals to worker processes")

# Replaces the capture. The clip's text decides the outcome; every call is logged beside the clip.
# The first process of a clip "hangs" runs until its standard input ends, as it does when the worker
# dies or stops the process.
PROGRAM = """
import json, os, pathlib, sys
clip = pathlib.Path(sys.argv[2])
text = clip.read_text("utf-8")
with open(clip.with_suffix(".calls"), "a") as log:
    row = {"pid": os.getpid(), "parent": os.getppid(), "arguments": sys.argv[1:]}
    log.write(json.dumps(row) + "\\n")
if text == "nobody":
    print("scope: no person found", file=sys.stderr); sys.exit(3)
if text == "broken":
    print("scope: it is not a video", file=sys.stderr); sys.exit(1)
if text == "hangs" and len(clip.with_suffix(".calls").read_text("utf-8").splitlines()) == 1:
    sys.stdin.read(); sys.exit(130)
if text == "kills":
    os.kill(os.getppid(), 9); sys.stdin.read(); sys.exit(130)
outputs = [sys.argv[i + 1] for i, a in enumerate(sys.argv) if a == "-o"]
for path in outputs:
    pathlib.Path(path).write_text("result of " + text)
print(json.dumps({"frames": 3, "outputs": outputs, "warnings": []}))
"""


DOWNLOADS = """
import os, signal
from scope.scope_addon.temporary import temporary_folder
with temporary_folder("footage") as folder:
    (folder / "clip.mp4").write_text("footage")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_footage_that_a_killed_worker_had_downloaded_is_removed_by_the_next(tmp_path, monkeypatch):
    """Before its first clip, whatever that is."""
    package("distributed")
    worker = importlib.import_module("scope.scope_addon.cluster.worker")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    subprocess.run([sys.executable, "-c", DOWNLOADS], check=False)
    assert len(list(tmp_path.rglob("clip.mp4"))) == 1
    monkeypatch.setattr(worker, "get_worker", MagicMock())
    worker.check_worker({"program": "another version"})
    assert list(tmp_path.iterdir()) == []


def calls(clip):
    log = clip.with_suffix(".calls")
    return (
        [json.loads(line) for line in log.read_text("utf-8").splitlines()] if log.exists() else []
    )


def run(cluster, folder, program=PROGRAM):
    """Run the command with a cluster or a scheduler file, and return its status and its report."""
    out = folder.parent / "out"
    argv = ["batch", str(folder), "--out", str(out), "--formats", "npz,csv", "--recursive"]
    address = str(getattr(cluster, "scheduler_address", cluster))
    argv += ["--scheduler", address]
    status = main(argv, program=[sys.executable, "-c", program])
    report = (
        json.loads((out / REPORT_NAME).read_text("utf-8")) if (out / REPORT_NAME).exists() else None
    )
    return status, report


def files(folder):
    return sorted(
        p.relative_to(folder.parent / "out").as_posix() for p in (folder.parent / "out").rglob("*")
    )


def is_json(file):
    try:
        return bool(json.loads(file.read_text("utf-8")))
    except ValueError:
        return False


def workers(cluster):
    """Process ids of the workers."""
    with package("distributed").Client(cluster.scheduler_address, set_as_default=False) as client:
        return client.run(os.getpid)


def test_every_clip_has_its_outcome_and_a_second_run_captures_what_has_changed(
    cluster, folder, capsys
):
    clips = {"a.mp4": "a", "b.mp4": "broken", "c.png": "nobody", "below/d.mp4": "d"}
    for name, text in clips.items():
        (folder / name).write_text(text)
    earlier = folder.parent / "out" / "below" / "d.person2.npz"
    earlier.parent.mkdir(parents=True)
    earlier.write_text("of a capture of two people")
    status, report = run(cluster, folder)
    assert status == 1
    found = {e["file"]: (e["status"], e.get("message")) for e in report["files"]}
    assert {name: each[0] for name, each in found.items()} == {
        "a.mp4": "done",
        "b.mp4": "failed",
        "below/d.mp4": "done",
        "c.png": "no_person",
    }
    assert found["b.mp4"][1] == "it is not a video"
    warnings = {e["file"]: e["report"]["warnings"] for e in report["files"] if "report" in e}
    assert warnings["a.mp4"] == []
    assert "not part of this result: 'd.person2.npz';" in warnings["below/d.mp4"][0]
    outputs = ["a.csv", "a.npz", "below", "below/d.csv", "below/d.npz", "below/d.person2.npz"]
    assert files(folder) == sorted([*outputs, REPORT_NAME])
    assert (folder.parent / "out" / "below" / "d.npz").read_text("utf-8") == "result of d"
    staged, shown = (calls(folder / "below" / "d.mp4")[0]["arguments"][k] for k in (6, -1))
    assert ".attempts-scope-" in staged
    assert f"-o {folder.parent}/out/below/d.npz" in shown  # what a page about the capture shows
    assert sum(row["clips"] for row in report["workers"]) == 4
    assert sum(row["frames"] for row in report["workers"]) == report["throughput"]["frames"] == 6
    assert {e["worker"] for e in report["files"]} <= {row["worker"] for row in report["workers"]}
    lines = capsys.readouterr().err.splitlines()
    said = [line for line in lines if "warning: " not in line]
    assert "scope: 4/4" in said[3]
    assert said[4].split()[1:5] == ["worker", "host", "threads", "state"]

    (folder / "a.mp4").write_text("changed")
    (folder.parent / "out" / "below" / "d.csv").unlink()
    status, report = run(cluster, folder)
    assert report["counts"] == {"done": 2, "skipped": 0, "no_person": 1, "failed": 1}
    assert [len(calls(folder / name)) for name in clips] == [2, 2, 1, 2]
    assert (folder.parent / "out" / "a.npz").read_text("utf-8") == "result of changed"


def test_a_clip_of_a_killed_worker_is_captured_by_another_and_its_process_ends(cluster, folder):
    for name in ("a", "b", "c"):
        (folder / f"{name}.mp4").write_text("hangs" if name == "b" else name)
    pids = set(workers(cluster).values())

    def kill():
        wait_for(lambda: calls(folder / "b.mp4"))
        parent = calls(folder / "b.mp4")[0]["parent"]
        assert parent in pids
        os.kill(parent, signal.SIGKILL)

    thread = threading.Thread(target=kill)
    thread.start()
    status, report = run(cluster, folder)
    thread.join()
    assert status == 0
    assert [e["status"] for e in report["files"]] == ["done"] * 3
    assert files(folder) == sorted(
        [*(f"{n}.{s}" for n in "abc" for s in ("npz", "csv")), REPORT_NAME]
    )
    first, second = calls(folder / "b.mp4")
    assert first["arguments"][6] != second["arguments"][6]  # a folder of its own for each attempt
    wait_for(lambda: not runs(first["pid"]))
    lost = [row for row in report["workers"] if row["attempts_lost"]]
    assert [row["state"] for row in lost] == ["left"]
    assert any("b.mp4 is captured again" in event["event"] for event in report["log"])


def test_a_clip_that_ends_its_workers_fails_and_the_others_are_captured(
    cluster, folder, monkeypatch
):
    monkeypatch.setattr("scope.scope_addon.cluster.runner.ATTEMPTS", 1)
    for name in ("a", "b", "c"):
        (folder / f"{name}.mp4").write_text("kills" if name == "a" else name)
    status, report = run(cluster, folder)
    assert status == 1
    assert [e["status"] for e in report["files"]] == ["failed", "done", "done"]
    assert "lost while they captured it" in report["files"][0]["message"]
    assert files(folder) == sorted(
        [*(f"{n}.{s}" for n in "bc" for s in ("npz", "csv")), REPORT_NAME]
    )


def test_an_interrupt_ends_the_captures_on_the_workers(cluster, folder, monkeypatch):
    (folder / "a.mp4").write_text("hangs")

    def interrupt(self, stage, done, total):
        if calls(folder / "a.mp4"):
            raise KeyboardInterrupt

    monkeypatch.setattr("scope.scope_addon.cli.ProgressBar.__call__", interrupt)
    status, report = run(cluster, folder)
    assert (status, report) == (130, None)
    wait_for(lambda: not runs(calls(folder / "a.mp4")[0]["pid"]))
    assert files(folder) == []


def test_workers_of_another_version_get_no_clips(cluster, folder, monkeypatch, capsys):
    (folder / "a.mp4").write_text("a")
    monkeypatch.setattr("scope.scope_addon.cluster.runner.program_version", lambda: "0" * 64)
    assert run(cluster, folder) == (1, None)
    said = capsys.readouterr().err.splitlines()
    assert said[-1].startswith(
        "scope: no worker of the cluster can capture: it runs another version of Scope ("
    )
    assert calls(folder / "a.mp4") == []
    assert files(folder) == []


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"folder": "/no/such/clips"}, "it has no folder /no/such/clips"),
        ({"token": "other"}, "it does not see the output"),
        ({"basis": "other"}, "or one to which it refers, is missing or different there"),
    ],
)
def test_workers_that_see_other_folders_or_files_get_no_clips(
    cluster, folder, monkeypatch, capsys, asked, says
):
    (folder / "a.mp4").write_text("a")
    from scope.scope_addon.cluster.runner import DaskRunner

    ask = DaskRunner._wanted
    monkeypatch.setattr(DaskRunner, "_wanted", lambda self, task: ask(self, task) | asked)
    assert run(cluster, folder) == (1, None)
    assert says in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize(
    ("suffixes", "needed"),
    [
        ((".npz", ".trc", ".c3d", ".vrma", ".mot", ".csv"), False),
        ((".npz", ".glb"), True),
    ],
)
def test_workers_need_blender_only_for_what_it_writes(tmp_path, suffixes, needed):
    package("distributed")
    from scope.scope_addon.cluster.runner import DaskRunner

    client = MagicMock(status="running")
    client.sync.return_value = {"workers": ["tcp://worker"]}
    runner = DaskRunner(client, str(tmp_path), str(tmp_path / "out"), 1, None, print)
    task = ClipTask("a", "a.mp4", "", "", "basis", CaptureSettings({}, suffixes))
    outcomes = runner.outcomes([task])
    next(outcomes)  # begun
    next(outcomes)
    runner.close()
    _, wanted = client.submit.call_args.args
    assert wanted["bpy"] is needed


def test_a_lost_scheduler_is_told_with_the_command_that_continues(tmp_path):
    package("distributed")
    from scope.scope_addon.cluster.runner import DaskRunner

    runner = DaskRunner(MagicMock(status="closed"), "clips", str(tmp_path), 1, None, print)
    task = ClipTask("a", "a.mp4", "", "", "", CaptureSettings({}, (".npz",)), again=True)
    outcomes = runner.outcomes([task])
    next(outcomes)  # begun
    with pytest.raises(ClusterError, match="run the same command without --again to continue"):
        next(outcomes)
    runner.close()


def test_workers_know_a_clip_by_the_files_to_which_a_rig_refers(
    cluster, folder, monkeypatch, capsys
):
    """A batch whose rig has a texture of its own could not run on a cluster."""
    (folder / "a.mp4").write_text("a")
    (folder.parent / "texture.png").write_text("red")
    monkeypatch.chdir(folder.parent)
    rig = SimpleNamespace(files=[Path("texture.png")])
    monkeypatch.setattr("scope.scope_addon.cli.checked_rigs", lambda *_: [rig])
    for count in (1, 1, 2):
        assert run(cluster, folder)[0] == 0, capsys.readouterr().err
        assert len(calls(folder / "a.mp4")) == count
        if capsys.readouterr().err.splitlines()[0].endswith(" skipped"):
            (folder.parent / "texture.png").write_text("blue")


@pytest.mark.slow
def test_a_lost_scheduler_is_a_sentence_and_finished_clips_are_kept(
    folder, tmp_path, monkeypatch, capsys
):
    class Impatient(package("distributed").Client):
        """Gives up a scheduler that is lost soon; connecting to it may take longer."""

        async def _reconnect(self):
            self._timeout = 0.3
            await super()._reconnect()

    monkeypatch.setattr("scope.scope_addon.cluster.workers.Client", Impatient)
    for name in ("a", "b"):
        (folder / f"{name}.mp4").write_text("hangs" if name == "b" else name)
    file = tmp_path / "scheduler.json"
    dask = [sys.executable, "-W", "ignore", "-m", "dask"]
    options = ["--scheduler-file", str(file), "--no-dashboard"]
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with ExitStack() as stack:
        scheduler = subprocess.Popen(
            [*dask, "scheduler", "--port", "0", "--host", "127.0.0.1", *options], **silent
        )
        stack.callback(scheduler.wait)
        stack.callback(scheduler.kill)
        worker = subprocess.Popen(
            [*dask, "worker", "--no-nanny", "--nthreads", "1", *options], **silent
        )
        stack.callback(worker.wait)
        stack.callback(worker.kill)
        wait_for(lambda: file.exists() and is_json(file))  # Dask does not write it at once

        def lose():
            wait_for(lambda: calls(folder / "b.mp4"))
            scheduler.kill()

        thread = threading.Thread(target=lose)
        thread.start()
        status, report = run(file, folder)
        thread.join()
        assert status == 1
        said = capsys.readouterr().err.splitlines()
        assert "the connection to the Dask scheduler was lost; finished clips are kept" in said[-1]
        assert [e["status"] for e in report["files"]] == ["done"]
        assert files(folder) == ["a.csv", "a.npz", REPORT_NAME]
        wait_for(lambda: not runs(calls(folder / "b.mp4")[0]["pid"]))
