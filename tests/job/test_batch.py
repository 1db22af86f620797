# SPDX-License-Identifier: GPL-3.0-or-later
"""A folder of footage: no clip is captured twice, and no failure affects other clips."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import av
import pytest
from scope.scope_addon import cli
from scope.scope_addon.cli import SAMPLE, main
from scope.scope_addon.command_line import signals
from scope.scope_addon.errors import UsageError
from scope.scope_addon.job.batch import LOCK_NAME, REPORT_NAME, Batch
from scope.scope_addon.job.clip_runner import LocalRunner
from scope.scope_addon.motion import Motion
from scope.solver.errors import InputError

from .processes import runs, wait_for

RECORD = r"\.[ab]\.finished-[0-9a-f]{16}\.json"  # of a clip's results
FRAMES = 10  # of the sample clip up to --end 0.3, both ends included

# Replaces the capture: the clip's text decides the outcome, and every call is logged in the folder
# of the clips. What "hangs" runs until its standard input ends, what "lingers" also does after it
# has written its results.
PROGRAM = """
import json, sys, pathlib
clip = pathlib.Path(sys.argv[2])
with open(clip.parent / "calls.log", "a") as log:
    log.write(json.dumps(sys.argv[1:]) + "\\n")
text = clip.read_text("utf-8") if clip.is_file() else "ok"
warnings = ["too dark"] if text == "dark" else []
outputs = [sys.argv[i + 1] for i, a in enumerate(sys.argv) if a == "-o"]
if text == "nobody":
    print("scope: no person found", file=sys.stderr); sys.exit(3)
if text == "broken":
    print("scope: warning: slow\\nscope: it is not a video", file=sys.stderr); sys.exit(1)
if text == "crash":
    import os; os.abort()
if text == "hangs":
    sys.stdin.read(); sys.exit(130)
print("Blender says something")
for path in outputs:
    pathlib.Path(path).write_text("result of " + text)
if text == "lingers":
    sys.stdin.read()
print(json.dumps({"frames": 3, "outputs": outputs, "warnings": warnings}))
"""


@pytest.fixture
def folder(tmp_path):
    clips = tmp_path / "clips"
    clips.mkdir()
    for name, text in {
        "a.mp4": "ok",
        "b.mov": "broken",
        "c.png": "nobody",
        "d.avi": "crash",
        "e.webm": "fine",
    }.items():
        (clips / name).write_text(text)
    (clips / "notes.txt").write_text("not footage")
    return clips


def calls_so_far(folder):
    log = folder / "calls.log"
    lines = log.read_text("utf-8").splitlines() if log.exists() else []
    return sorted(Path(json.loads(line)[1]).name for line in lines)


def calls(folder):
    found = calls_so_far(folder)
    (folder / "calls.log").unlink(missing_ok=True)
    return found


def literal(path):
    """Return a pattern of a path, which has backslashes on Windows."""
    return re.escape(str(path))


def batch(folder, out, options=None, suffixes=(".npz", ".glb")):
    program = [sys.executable, "-c", PROGRAM]
    return Batch(folder, out, program, options or {}, suffixes)


def test_every_clip_has_its_own_outcome(folder, tmp_path):
    (folder / "a.mp4").write_text("dark")
    out = tmp_path / "out"
    said = []
    report = batch(folder, out).run(3, say=said.append)
    statuses = {e["file"]: e["status"] for e in report["files"]}
    assert statuses == {
        "a.mp4": "done",
        "b.mov": "failed",
        "c.png": "no_person",
        "d.avi": "failed",
        "e.webm": "done",
    }
    assert report["exit_status"] == 1
    assert report["counts"] == {"done": 2, "skipped": 0, "no_person": 1, "failed": 2}
    assert json.loads((out / REPORT_NAME).read_text("utf-8")) == report
    messages = {e["file"]: e.get("message") for e in report["files"]}
    assert messages["b.mov"] == "it is not a video"
    assert "status" in messages["d.avi"]
    (place,) = (k for k, text in enumerate(said) if text.endswith("/5 a.mp4 done"))
    assert said[place + 1] == "warning: too dark"
    assert sorted(p.name for p in out.iterdir()) == [
        "a.glb",
        "a.npz",
        "e.glb",
        "e.npz",
        REPORT_NAME,
    ]


def test_finished_clips_are_skipped_and_changed_ones_captured(folder, tmp_path):
    out = tmp_path / "out"
    batch(folder, out).run(1)
    assert len(calls(folder)) == 5
    report = batch(folder, out).run(1)
    assert calls(folder) == ["b.mov", "d.avi"]  # failed clips are captured again
    assert report["counts"] == {"done": 0, "skipped": 2, "no_person": 1, "failed": 2}

    (folder / "b.mov").write_text("mended")
    (folder / "d.avi").unlink()
    (out / "e.glb").unlink()
    report = batch(folder, out).run(1)
    assert calls(folder) == ["b.mov", "e.webm"]
    assert report["exit_status"] == 3  # only the picture without a person is left

    (folder / "a.mp4").touch()  # newer, with the same content
    batch(folder, out).run(1)
    assert calls(folder) == []
    batch(folder, out, {"--quality": "fast"}).run(1)
    assert calls(folder) == ["a.mp4", "b.mov", "c.png", "e.webm"]


@pytest.mark.parametrize("again", [False, True])
def test_a_folder_with_the_results_of_another_is_refused(tmp_path, again):
    """The cameras' cards name their clips alike. A folder that was renamed can continue."""
    day, other = tmp_path / "day", tmp_path / "other"
    for each in (day, other):
        each.mkdir()
        (each / "a.mp4").write_text(each.name)
    out = tmp_path / "out"
    batch(day, out).run(1)
    (day / "b.mp4").write_text("broken")
    batch(day, out, {"--quality": "fast"}).run(1)
    refused = f"{literal(day)}; give another for those of {literal(other)}, .* {REPORT_NAME}"
    with pytest.raises(UsageError, match=refused):
        batch(other, out).run(1, again=again)
    assert (out / "a.npz").read_text() == "result of day"
    assert calls_so_far(other) == []

    renamed = day.rename(tmp_path / "renamed")
    calls(renamed)
    with pytest.raises(UsageError, match=f"{literal(day)}; .* {literal(renamed)}, "):
        batch(renamed, out).run(1)
    report = (out / REPORT_NAME).read_text("utf-8")
    (out / REPORT_NAME).write_text(
        report.replace(json.dumps(str(day)), json.dumps(str(renamed))), "utf-8"
    )
    assert batch(renamed, out, {"--quality": "fast"}).run(1)["counts"]["skipped"] == 1
    assert calls(renamed) == ["b.mp4"]


def test_of_two_batches_at_once_in_one_folder_the_second_is_refused(tmp_path):
    """Each would replace results of the other, and know nothing of them afterwards."""
    day, other = tmp_path / "day", tmp_path / "other"
    for each in (day, other):
        each.mkdir()
        (each / "a.mp4").write_text(each.name)
    out = tmp_path / "out"

    def run_other(stage, done, total):
        with pytest.raises(
            UsageError, match=f"another batch writes to {literal(out)}, as .* --out"
        ):
            batch(other, out).run(1)

    report = batch(day, out).run(1, progress=run_other)
    assert report["counts"]["done"] == 1
    assert (out / "a.npz").read_text() == "result of day"
    assert calls_so_far(other) == []
    assert sorted(path.name for path in out.iterdir()) == ["a.glb", "a.npz", REPORT_NAME]


@pytest.mark.skipif(os.name == "nt", reason="Windows reports no owner")
def test_a_batch_runs_where_all_files_are_another_users(folder, tmp_path, monkeypatch):
    """As on a server's disk; then nothing says whether another batch runs."""
    monkeypatch.setattr(os, "geteuid", lambda: os.stat(tmp_path).st_uid + 1)
    out = tmp_path / "out"
    assert batch(folder, out).run(1)["counts"]["done"] == 2
    assert not (out / LOCK_NAME).exists()


class StoreRunner(LocalRunner):
    """Captures footage of a store, which the batch has the names of."""

    def __init__(self, store, url):
        super().__init__([sys.executable, "-c", PROGRAM], 1)
        self.store = store
        self.url = url

    def outcomes(self, tasks):
        return super().outcomes(
            task._replace(footage=str(self.store / task.file)) for task in tasks
        )

    def report(self):
        return {"folder": self.url}


@pytest.mark.parametrize("again", [False, True])
def test_results_of_another_folder_of_a_store_are_kept(tmp_path, again):
    out = tmp_path / "out"
    names = tmp_path / "names"
    store = tmp_path / "store"
    for each in (names, store):
        each.mkdir()
        (each / "a.mp4").touch()

    def run(url, text, again=False):
        (store / "a.mp4").write_text(text)
        runner = StoreRunner(store, f"memory://{url}")
        (entry,) = batch(names, out).run(1, again=again, runner=runner)["files"]
        return entry["status"]

    assert run("day", "day") == "done"
    with pytest.raises(UsageError, match=r"memory://day; give another for those of memory://other"):
        run("other", "another day", again)
    assert (out / "a.npz").read_text() == "result of day"
    assert run("day", "day") == "skipped"


NAMES = b"caf\xe8.mp4", b"caf\xe9.mp4", "caf\ufffd.mp4".encode(), b"a.mp4"


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_clips_whose_names_are_no_text_are_skipped_like_others(tmp_path):
    """Names that are shown alike are told apart, also in a folder of such a name."""
    clips = tmp_path / "clips"
    out = tmp_path / os.fsdecode(b"\xe9t\xe9")
    clips.mkdir()
    for number, name in enumerate(NAMES):
        (clips / os.fsdecode(name)).write_text(f"clip {number}")
    shown = "from scope.scope_addon.footage import json_text\nprint(json_text({"
    program = [sys.executable, "-c", PROGRAM.replace("print(json.dumps({", shown)]

    def statuses():
        report = Batch(clips, out, program, {}, [".npz"]).run(1)
        written = json.loads((out / REPORT_NAME).read_text("utf-8"))
        json.dumps(written, ensure_ascii=False).encode()  # no half characters
        assert len(written["files"]) == len(report["files"])
        return [entry["status"] for entry in report["files"]]

    assert statuses() == ["done"] * 4
    contents = {file.read_text("utf-8") for file in out.glob("*.npz")}
    assert contents == {f"result of clip {number}" for number in range(4)}
    assert statuses() == ["skipped"] * 4
    (clips / os.fsdecode(b"caf\xe9.mp4")).write_text("another one")
    (out / os.fsdecode(b"caf\xe8.npz")).write_text("damage")
    assert sorted(statuses()) == ["done", "done", "skipped", "skipped"]
    assert statuses() == ["skipped"] * 4


def test_clips_whose_results_were_damaged_are_captured_again(folder, tmp_path):
    """An emptied or replaced file is no result, whatever its name says."""
    out = tmp_path / "out"
    batch(folder, out).run(1)
    calls(folder)
    whole = (out / "a.npz").read_bytes()
    (out / "a.npz").write_text("")
    (out / "e.glb").write_text("longer than it was")
    report = batch(folder, out).run(1)
    assert sorted(calls(folder)) == ["a.mp4", "b.mov", "d.avi", "e.webm"]
    assert (out / "a.npz").read_bytes() == whole
    assert report["counts"]["done"] == 2
    assert report["counts"]["skipped"] == 0


@pytest.mark.skipif(os.name == "nt", reason="Windows needs a privilege for links")
def test_a_link_in_the_place_of_the_report_is_not_followed(tmp_path):
    (tmp_path / "clips").mkdir()
    (tmp_path / "clips" / "a.mp4").write_text("ok")
    out = tmp_path / "out"
    out.mkdir()
    (tmp_path / "other").write_text("somebody's")
    (out / REPORT_NAME).symlink_to(tmp_path / "other")
    assert batch(tmp_path / "clips", out).run(1)["counts"]["done"] == 1
    assert (tmp_path / "other").read_text() == "somebody's"
    assert not (out / REPORT_NAME).is_symlink()


def test_a_damaged_report_is_ignored(folder, tmp_path):
    for name in ("b.mov", "d.avi", "e.webm"):  # each is a process
        (folder / name).unlink()
    out = tmp_path / "out"
    batch(folder, out).run(1)
    outputs = {"a": ["x" * 300], "c": "c.npz"}
    unusable = [{"name": n, "status": "done", "outputs": o} for n, o in outputs.items()]
    texts = ("{", "[]", '{"a":' * 100_000)
    for text in (*texts, json.dumps({"folder": str(folder), "files": unusable})):
        calls(folder)
        (out / REPORT_NAME).write_text(text)
        batch(folder, out).run(1)
        assert calls(folder) == ["a.mp4", "c.png"]


def test_clips_of_several_people_share_no_name_with_a_persons_result(tmp_path):
    for name in ("walk.mp4", "walk.person2.mp4"):
        (tmp_path / name).write_text("x")
    assert list(batch(tmp_path, tmp_path / "out").clips(recursive=False)) == [
        "walk",
        "walk.person2",
    ]
    several = batch(tmp_path, tmp_path / "out", {"--people": "all"})
    assert list(several.clips(recursive=False)) == ["walk", "walk.person2.mp4"]


def test_an_interrupt_stops_the_running_clips_and_keeps_the_finished(folder, tmp_path):
    (folder / "c.png").write_text("hangs")  # otherwise the third may end before the interrupt

    def interrupt(stage, done, total):
        if done == 2:
            wait_for(lambda: len(calls_so_far(folder)) == 3)
            raise KeyboardInterrupt

    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        batch(folder, out).run(1, progress=interrupt)
    report = json.loads((out / REPORT_NAME).read_text("utf-8"))
    assert [entry["file"] for entry in report["files"]] == ["a.mp4", "b.mov"]
    assert calls(folder) == ["a.mp4", "b.mov", "c.png"]
    (folder / "c.png").write_text("nobody")
    batch(folder, out).run(1)
    assert "a.mp4" not in calls(folder)


def test_overlays_and_pages_of_a_batch_lie_next_to_the_results(folder, tmp_path):
    for name in ("b.mov", "d.avi", "e.webm"):
        (folder / name).unlink()
    argv = ["batch", str(folder), "--out", str(tmp_path / "out"), "--formats", "npz"]
    main([*argv, "--overlays", "--reports"], program=[sys.executable, "-c", PROGRAM])
    passed = [json.loads(line) for line in (folder / "calls.log").read_text("utf-8").splitlines()]
    args = {Path(each[1]).name: cli.build_parser().parse_args(each) for each in passed}
    assert args["a.mp4"].report == tmp_path / "out" / "a.report.html"
    assert args["a.mp4"].overlay == tmp_path / "out" / "a.overlay.mp4"
    assert args["c.png"].report == tmp_path / "out" / "c.report.html"


KILLS_THE_BATCH = """
import os, sys
from scope.scope_addon import cli
cli._print_report = lambda *_: os.kill(os.getppid(), 9)
cli.run()
"""


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_a_clip_that_was_finished_when_the_batch_was_killed_is_not_captured_again(tmp_path, capfd):
    clips = tmp_path / "clips"
    out = tmp_path / "out"
    clips.mkdir()
    shutil.copy(SAMPLE, clips / "a.mp4")
    (tmp_path / "clip.py").write_text(KILLS_THE_BATCH)
    argv = ["batch", str(clips), "--out", str(out), "--formats", "npz"]
    argv += ["--quality", "fast", "--end", "0.3"]
    program = [sys.executable, str(tmp_path / "clip.py")]
    code = f"import sys\nfrom scope.scope_addon.cli import main\nmain({argv}, program={program})\n"
    killed = subprocess.run([sys.executable, "-c", code], check=False, stderr=subprocess.DEVNULL)
    assert killed.returncode == -signal.SIGKILL
    assert not (out / REPORT_NAME).exists()
    kept = shutil.copytree(out, tmp_path / "kept")
    refuses = [sys.executable, "-c", "raise SystemExit('captured again')"]

    assert main(argv, program=refuses) == 0
    (entry,) = json.loads((out / REPORT_NAME).read_text("utf-8"))["files"]
    assert (entry["status"], entry["outputs"], entry["report"]["frames"]) == (
        "skipped",
        ["a.npz"],
        FRAMES,
    )
    assert sorted(os.listdir(out)) == ["a.npz", REPORT_NAME]
    assert main(argv, program=refuses) == 0

    for more in ([], ["--again"], ["--fov", "50"]):
        shutil.rmtree(out)
        shutil.copytree(kept, out)  # with its times
        if not more:
            (out / "a.npz").write_bytes(bytes((out / "a.npz").stat().st_size))
        assert main([*argv, *more], program=refuses) == 1
        assert "captured again" in capfd.readouterr().err


@pytest.mark.skipif(os.name == "nt", reason="looks at /proc")
def test_the_clips_of_a_killed_batch_end_and_leave_no_partial_file(tmp_path):
    """It is killed while a result is being written."""
    clips = tmp_path / "clips"
    out = tmp_path / "out"
    clips.mkdir()
    for name in ("a.mp4", "b.mp4"):
        shutil.copy(SAMPLE, clips / name)
    (tmp_path / "clip.py").write_text(
        "import os, pathlib, sys, time\n"
        "from scope.scope_addon import cli\n"
        "from scope.scope_addon.command_line import terminal\n"
        "pid, parent = pathlib.Path(sys.argv[2] + '.pid'), os.getppid()\n"
        "def record(self, stage, done, total):\n"
        "    if stage == 'overlay' and done > 2 and not pid.exists():\n"
        "        pid.write_text(str(os.getpid()))\n"
        "        until = time.monotonic() + 300\n"  # for the kill, before which no clip may end
        "        while os.getppid() == parent and time.monotonic() < until: time.sleep(0.001)\n"
        "terminal.ProgressBar.__call__ = record\n"
        "cli.run()\n"
    )
    argv = ["batch", str(clips), "--out", str(out), "--jobs", "2", "--formats", "npz", "--overlays"]
    argv += ["--quality", "fast", "--end", "0.3", "--threads", "1"]
    code = (
        "import sys\n"
        "from scope.scope_addon.cli import main\n"
        f"main({argv}, program=[sys.executable, {str(tmp_path / 'clip.py')!r}])\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL)
    wait_for(
        lambda: (
            len([p for p in clips.glob("*.pid") if p.read_text("utf-8")]) == 2
            or process.poll() is not None
        )
    )
    assert process.poll() is None
    process.kill()
    process.wait()
    pids = [int(p.read_text("utf-8")) for p in clips.glob("*.pid")]
    wait_for(lambda: not any(runs(pid) for pid in pids))
    # Some of them, where a clip ended before it noticed that its parent is gone.
    results = {p.name for p in out.iterdir() if not re.fullmatch(RECORD, p.name)}
    results.discard(LOCK_NAME)  # which the next batch removes
    assert results <= {"a.npz", "b.npz", "a.overlay.mp4", "b.overlay.mp4"}
    for path in out.glob("*.npz"):
        assert len(Motion.load(path)) == FRAMES
    for path in out.glob("*.mp4"):
        with av.open(path) as video:
            assert sum(1 for _ in video.decode(video=0)) == FRAMES


def test_what_is_said_of_an_interrupted_batch_continues_it(folder, tmp_path, monkeypatch, capsys):
    command = ["batch", str(folder), "--out", str(tmp_path / "out"), "--formats", "npz"]
    program = [sys.executable, "-c", PROGRAM]

    def interrupt(self, stage, done, total):
        if done == 1:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("scope.scope_addon.cli.ProgressBar.__call__", interrupt)
        assert main([*command, "--again"], program=program) == 130
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.endswith("; run the same command without --again to continue")
    main(command, program=program)
    first, second = capsys.readouterr().err.splitlines()[:2]
    assert first.endswith(" skipped")
    assert not second.endswith(" skipped")


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_a_signal_ends_the_batch_and_its_clips_despite_an_earlier_handler(folder, tmp_path):
    """Blender handles Ctrl-C itself, and only sets a flag."""
    (tmp_path / "clip.py").write_text(
        "import os, pathlib, sys\npathlib.Path(sys.argv[2] + "
        "'.pid').write_text(str(os.getpid()))\nsys.stdin.read()\n"
    )
    code = (
        "import signal, sys\n"
        "from scope.scope_addon.cli import main\n"
        "signal.signal(signal.SIGTERM, lambda *_: None)\n"
        f"argv = ['batch', {str(folder)!r}, '--out', {str(tmp_path / 'out')!r}, '--jobs', '2', "
        "'--formats', 'npz']\n"
        f"sys.exit(main(argv, program=[sys.executable, {str(tmp_path / 'clip.py')!r}]))\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    wait_for(
        lambda: (
            len([p for p in folder.glob("*.pid") if p.read_text("utf-8")]) == 2
            or process.poll() is not None
        )
    )
    pids = [p.read_text("utf-8") for p in folder.glob("*.pid")]
    process.send_signal(signal.SIGTERM)  # and, other than a terminal, not its clips
    _, stderr = process.communicate(timeout=300)
    assert process.returncode == 130
    assert (
        stderr.splitlines()[-1]
        == "scope: stopped; finished clips are kept; run the same command again to continue"
    )
    assert not any(runs(int(pid)) for pid in pids)


def test_a_signal_whose_exception_is_lost_ends_the_batch_too(folder, tmp_path, monkeypatch, capsys):
    """The exception is lost while clips run, as in a callback of a weak reference."""

    def runs_on(runner, task):
        signals.received.append(signal.SIGINT)
        wait_for(lambda: runner._processes._stopped)
        return {"status": "failed", "file": task.name, "message": ""}

    monkeypatch.setattr(LocalRunner, "_capture", runs_on)
    argv = ["batch", str(folder), "--out", str(tmp_path / "out"), "--formats", "npz", "--jobs", "2"]
    assert main(argv) == 130
    assert "stopped; finished clips are kept" in capsys.readouterr().err


def test_a_folder_without_footage_is_an_error(tmp_path):
    with pytest.raises(InputError, match="nowhere"):
        batch(tmp_path / "nowhere", tmp_path / "out")
    (tmp_path / "empty").mkdir()
    with pytest.raises(UsageError, match="no footage"):
        batch(tmp_path / "empty", tmp_path / "out").run(1)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (["--formats", "xyz"], "xyz"),
        (["--formats", ","], "formats"),
        (["--jobs", "0"], "0"),
    ],
)
def test_bad_arguments(tmp_path, capsys, argv, says):
    assert main(["batch", str(tmp_path), "--out", str(tmp_path / "out"), *argv]) == 2
    err = capsys.readouterr().err
    assert says in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("argv", "status", "says"),
    [
        (["--people", "9" * 9999], 2, "--people must be all, largest or a number"),
        (["--calibration", "{tmp}/lens.json"], 1, "lens.json is not a calibration"),
        (["--detector", "{tmp}/net.onnx"], 1, "net.onnx is not an ONNX model"),
    ],
)
def test_invalid_options_are_reported_once_before_the_first_clip(
    folder, tmp_path, capsys, argv, status, says
):
    (tmp_path / "lens.json").write_text("{}")
    (tmp_path / "net.onnx").write_bytes(b"no network")
    command = ["batch", str(folder), "--out", str(tmp_path / "out"), "--formats", "npz"]
    command += [a.format(tmp=tmp_path) for a in argv]
    assert main(command, [sys.executable, "-c", PROGRAM]) == status
    err = capsys.readouterr().err
    assert says in err
    assert err.count("\n") == 1
    assert calls(folder) == []
    assert not (tmp_path / "out").exists()


def test_the_views_of_a_take_are_captured_together_and_once(tmp_path):
    take = tmp_path / "clips" / "walk"
    take.mkdir(parents=True)
    for name in ("right.mp4", "left.mp4"):
        (take / name).write_text("ok")
    program = [sys.executable, "-c", PROGRAM]
    for expected in ("done", "skipped"):
        batch = Batch(tmp_path / "clips", tmp_path / "out", program, {}, [".npz"])
        report = batch.run(1, views=True)
        (entry,) = report["files"]
        assert (entry["file"], entry["status"]) == ("walk", expected)
        assert entry["outputs"] == ["walk.npz"]
    (call,) = (take / "calls.log").read_text("utf-8").splitlines()
    assert json.loads(call)[1:3] == [str(take / "left.mp4"), str(take / "right.mp4")]
    for name in ("right.mp4", "third.mp4"):  # replaced, and added
        (take / name).write_text("another")
        batch = Batch(tmp_path / "clips", tmp_path / "out", program, {}, [".npz"])
        assert batch.run(1, views=True)["counts"]["done"] == 1
