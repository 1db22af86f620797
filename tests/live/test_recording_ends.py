# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever ends a live capture, its recording is there, whole, and where the command says."""

import errno
import json
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon import private_folder
from scope.scope_addon.capture.camera.intrinsics import Camera, pinhole
from scope.scope_addon.cli import SAMPLE, main
from scope.scope_addon.command_line import live_command
from scope.scope_addon.errors import NoPersonError, OutputError, UsageError, VideoError
from scope.scope_addon.live import footage_recording, journal, run, unfinished
from scope.scope_addon.live.footage_recording import FootageRecording
from scope.scope_addon.live.journal import read_about, read_records
from scope.scope_addon.live.pose import Presence
from scope.scope_addon.live.recording import Keep, PeopleRecording, unfinished_recording
from scope.scope_addon.live.source import Picture
from scope.scope_addon.live.unfinished import lock_of
from scope.scope_addon.motion import Motion
from scope.scope_addon.temporary import release
from scope.solver.body_file import ASSETS, load_body
from scope.solver.errors import InputError
from scope.solver.rotations import exp

from .test_vmc import pose_of

POSES = 40
CAMERA = Camera(pinhole(640, 480, 600.0), np.zeros(5), "given")
SOURCE = SimpleNamespace(name="fake", fps=Fraction(30), speed=1.0)
SIZE = (640, 480)
EARLIER = b"an earlier take"


def literal(path):
    """Return a pattern of a path, which has backslashes on Windows."""
    return re.escape(str(path))


@pytest.fixture(autouse=True)
def other_places(tmp_path, monkeypatch):
    """Keep the user's own folders out of this."""
    monkeypatch.setattr(unfinished, "lasting_folder", lambda: tmp_path / "user")
    monkeypatch.setattr(unfinished, "system_folder", lambda: tmp_path / "tmp")
    (tmp_path / "tmp").mkdir()
    private_folder.private_folder.cache_clear()


def poses(body, people=1):
    """People who nod and walk, in every other frame, and are not seen for a moment."""
    rng = np.random.default_rng(0)
    for k in range(POSES):
        for person in range(people):
            R = exp(rng.normal(0, 0.1, (body.K + 1, 3)))
            pelvis = (0.02 * k + person, 0.0, 0.95)
            seen = Presence.HELD if k in (20, 21) else Presence.SEEN
            pose = pose_of(body, R, R[0], pelvis, seen)
            yield replace(pose, index=2 * k, timestamp_s=k / 15, person=person)


def people_of(number=1):
    return SimpleNamespace(sessions=[SimpleNamespace(camera=CAMERA)] * number)


def recorded(folder, body, people=1, say=lambda _: None, **options):
    """A recording with all poses, in the middle of its capture."""
    folder.mkdir(exist_ok=True)
    paths = [folder / f"take{number}.npz" for number in range(people)]
    keep = Keep(folder / "take.recording", "scope", say)
    recording = PeopleRecording(paths, body, SOURCE, keep=keep, **options)
    recording.begin(people_of(people), SIZE)
    for pose in poses(body, people):
        recording.send(pose, 0.0)
    return recording, paths


def assert_same(path, other):
    motion = Motion.load(path)
    truth = Motion.load(other)
    for name, value in truth._arrays().items():
        np.testing.assert_array_equal(motion._arrays()[name], value, err_msg=name)
    assert len(motion) > POSES - 3
    assert (~motion.valid).sum() == 2


@pytest.mark.parametrize(("people", "origin"), [(1, None), (2, (4, 0.1))])
def test_what_a_kill_leaves_is_finished_as_if_there_had_been_none(tmp_path, body, people, origin):
    recording, paths = recorded(tmp_path / "a", body, people, origin=origin)
    recording._journal.close()
    left = tmp_path / "left.recording"
    left.write_bytes(recording._journal.path.read_bytes())
    assert recording.save() == paths
    assert not list((tmp_path / "a").glob("*.recording"))
    again, about = unfinished_recording(
        left, lambda number: [tmp_path / f"again{k}.npz" for k in range(number)]
    )
    for path, other in zip(again.save(), paths, strict=True):
        assert_same(path, other)
    assert (about.people, about.source, about.size) == (people, "fake", SIZE)


def test_a_cut_or_damaged_file_gives_what_is_whole(tmp_path, body):
    recording, _ = recorded(tmp_path / "a", body)
    recording._journal.close()
    content = recording._journal.path.read_bytes()
    line = content.index(b"\n") + 1
    size = (len(content) - line - 2 * journal._BLOCK_BYTES) // (POSES - 2)
    unseen = line + 20 * size  # where the first of two frames without the person is
    file = tmp_path / "damaged.recording"
    about = read_about(recording._journal.path)
    expected = {
        content: POSES,
        content[:-1]: POSES - 1,
        content[: line + 5 * size] + bytes(2 * size): 5,  # as a power cut leaves it
        content[: line + 5 * size + 99] + b"x" + content[line + 5 * size + 100 :]: POSES - 1,
        content[: line + 5 * size] + bytes(size) + content[line + 6 * size :]: POSES - 1,
        content[: unseen + 9] + b"x" + content[unseen + 10 :]: POSES - 1,
        content[: line + size] + content[line : line + size]: 1,  # the same pose again
        content[:line] + content[unseen : unseen + 64]: 0,
        content[:line]: 0,
    }
    for damaged, count in expected.items():
        file.write_bytes(damaged)
        assert len(read_records(file, about, body)) == count
    with pytest.raises(NoPersonError, match="ends before its first pose"):
        unfinished_recording(file, lambda _: [tmp_path / "x.npz"])
    for damaged in (content[: line - 5], b"", b"[]\n", b"\xff\n", b"{" * 70000):
        file.write_bytes(damaged)
        with pytest.raises(InputError, match="is not the recording of a live capture, or damaged"):
            read_about(file)


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ({"people": None}, "a damaged people in its first line"),
        ({"fps": "1e999999999"}, "a damaged fps in its first line"),
        ({"size": [640]}, "a damaged size in its first line"),
        ({"origin": [0, float("nan")]}, "a damaged origin in its first line"),
        ({"tempo": 1}, "an unknown tempo in its first line"),
    ],
)
def test_a_damaged_first_line_says_what_is_wrong_in_it(tmp_path, body, entries, said):
    recording, _ = recorded(tmp_path / "a", body)
    recording._journal.close()
    line = recording._journal.path.read_bytes().splitlines()[0]
    file = tmp_path / "damaged.recording"
    file.write_text(json.dumps(json.loads(line) | entries) + "\n")
    with pytest.raises(InputError) as raised:
        read_about(file)
    assert f"({said}); choose another .recording file" in str(raised.value)


def test_a_first_line_without_entries_names_them_in_our_words(tmp_path):
    """Not as Python says it, with a name of the code."""
    file = tmp_path / "damaged.recording"
    file.write_text('{"body": "scope"}\n')
    with pytest.raises(InputError, match=r"\(no fingerprint, no source, .*, no footage in its"):
        read_about(file)


def test_frames_in_which_nobody_is_seen_take_little_room(tmp_path, body):
    """As those of an empty room, for hours."""
    recording, _ = recorded(tmp_path / "a", body)
    growing = recording._journal
    for k in range(POSES, 3 * POSES):
        pose = replace(pose_of(body, presence=Presence.LOST), index=2 * k, timestamp_s=k / 15)
        recording.send(pose, 0.0)
    last = replace(pose_of(body), index=6 * POSES, timestamp_s=3 * POSES / 15)
    recording.send(last, 0.0)
    growing.close()
    pose_bytes = journal._CHECKSUM_BYTES + journal._record_type(body).itemsize
    size = growing.path.stat().st_size
    assert 0 < size - (POSES - 1) * pose_bytes - (2 * POSES + 2) * 32 < 1000  # the first line
    assert not any(isinstance(record, tuple) for record in growing._records[POSES:-1])
    records = read_records(growing.path, read_about(growing.path), body)
    assert [pose.index for pose, _ in records] == list(range(0, 6 * POSES + 1, 2))
    unseen = [pose.index for pose, _ in records if pose.presence is not Presence.SEEN]
    assert unseen == [40, 42, *range(2 * POSES, 6 * POSES, 2)]


def test_a_recording_with_another_body_is_not_finished(tmp_path, body):
    recording, _ = recorded(tmp_path / "a", body)
    recording._journal.close()
    about = replace(read_about(recording._journal.path), fingerprint=1)
    with pytest.raises(UsageError, match="was recorded with another body than scope is now"):
        read_records(recording._journal.path, about, body)


def test_a_finished_recording_replaces_no_body_that_it_was_recorded_with(tmp_path, body, capfd):
    """The command names the recording alone, which names the body."""
    own = Path(shutil.copy(ASSETS / "body" / "scope.npz", tmp_path / "own.npz"))
    recording, _ = recorded(tmp_path / "a", body)
    recording._journal.close()
    line, _, records = recording._journal.path.read_bytes().partition(b"\n")
    left = tmp_path / "left.recording"
    about = json.dumps(json.loads(line) | {"body": str(own)})
    left.write_bytes(about.encode() + b"\n" + records)
    assert main(["live", str(left), "--record", str(own)]) == 2
    assert f"{own} is the input itself" in capfd.readouterr().err
    assert own.read_bytes() == (ASSETS / "body" / "scope.npz").read_bytes()
    assert main(["live", str(left), "--record", str(tmp_path / "take.npz")]) == 0
    recording.save()


def test_what_still_grows_is_not_finished(tmp_path, body, capfd):
    """It would be removed while the other process writes to it."""
    recording, (path,) = recorded(tmp_path / "a", body)
    growing = recording._journal.path
    assert main(["live", str(growing), "--record", str(tmp_path / "early.npz")]) == 2
    lock = growing.with_name(f".{growing.name}.lock")
    said = f"{growing} is still being recorded, as {lock} says; end that live"
    assert said in capfd.readouterr().err
    assert growing.is_file()
    assert recording.save() == [path]


def test_a_second_capture_of_the_same_name_is_refused(tmp_path, body, monkeypatch, capfd):
    """The one that ends last would replace the take of the other."""
    recording, (path,) = recorded(tmp_path, body)
    fake_run(monkeypatch, lambda: None)
    name = str(recording._journal.path.with_suffix(".npz"))
    assert main(["live", str(SAMPLE), "--record", name]) == 2
    assert f"another live capture records to {name}, as {tmp_path}" in capfd.readouterr().err
    assert recording.save() == [path]


def test_what_hinders_a_recording_though_nothing_is_recorded_is_named(tmp_path, capfd):
    """Such as a lock that another program has written into, which could not be found otherwise."""
    lock = tmp_path / ".take.recording.lock"
    lock.write_text("another's")
    assert main(["live", str(SAMPLE), "--record", str(tmp_path / "take.npz")]) == 2
    said = f"as {lock} says; give another name with --record, or remove"
    assert said in capfd.readouterr().err
    assert lock.read_text("utf-8") == "another's"


def test_of_two_recordings_that_begin_at_once_neither_replaces_the_other(tmp_path, body):
    """Neither sees the other before its first pose."""
    first, (path,) = recorded(tmp_path / "a", body)
    second, _ = recorded(tmp_path / "a", body)
    assert first.save() == [path]
    content = path.read_bytes()
    other = tmp_path / "user" / "recordings" / path.name
    with pytest.raises(
        OutputError, match=f"written it meanwhile; the recording is in {literal(other)}"
    ):
        second.save()
    assert path.read_bytes() == content
    np.testing.assert_array_equal(Motion.load(other).trans, Motion.load(path).trans)


def test_where_a_recording_is_is_said_if_the_folder_is_gone(tmp_path, body, monkeypatch, capfd):
    path = tmp_path / "out" / "take.npz"
    path.parent.mkdir()
    images = FootageRecording(path.with_suffix(".mp4"), Fraction(30))

    def remove_folder():
        images.add(Picture(0, 0.0, 0.0, np.zeros((48, 64, 3), np.uint8)))
        shutil.rmtree(path.parent)

    fake_run(monkeypatch, remove_folder)
    monkeypatch.setattr(footage_recording, "FootageRecording", lambda *_: images)
    images_too = ["--keep-footage", str(path.with_suffix(".mp4"))]
    assert main(["live", str(SAMPLE), "--record", str(path), *images_too]) == 1
    said = capfd.readouterr().err
    other = tmp_path / "user" / "recordings" / path.name
    assert f"the recording is in {other}" in said
    assert len(Motion.load(other)) > POSES - 3
    assert "take.mp4" in said


on_linux = pytest.mark.skipif(sys.platform != "linux", reason="limits sizes of files as Linux does")


def take_nothing(_):
    raise OSError(errno.ENOSPC, "No space left on device")


def fill_disk(growing, write=take_nothing):
    """Let the disk of a growing file refuse what is written from now on."""
    while not is_whole(growing.path):
        pass
    growing._file.close()
    growing._file = SimpleNamespace(write=write, close=lambda: None)


def test_a_disk_that_refuses_what_is_written_loses_no_pose(tmp_path, body, monkeypatch):
    """No other place takes the recording; memory does."""
    said = []
    recording, (path,) = recorded(tmp_path / "full", body, say=said.append)
    begun = recording._journal.path
    fill_disk(recording._journal)
    monkeypatch.setattr(journal, "create_new", take_nothing)
    later = replace(pose_of(body), index=2 * POSES, timestamp_s=POSES / 15)
    recording.send(later, 0.0)
    recording._journal.close()
    assert said[0].startswith(f"the recording begins in {begun}, goes on in memory")
    assert recording.save() == [path]
    assert len(Motion.load(path)) == POSES
    assert [file for file in tmp_path.rglob("*") if file.is_file()] == [path]


@pytest.mark.parametrize("write", [take_nothing, lambda content: len(content) - 1])
def test_a_disk_that_fills_meanwhile_moves_the_growing_file_to_a_second_place(
    tmp_path, body, write
):
    """Also where it takes a part of a pose, and says so only at the next write."""
    said = []
    recording, (path,) = recorded(tmp_path / "full", body, say=said.append)
    growing = recording._journal
    fill_disk(growing, write)
    later = replace(pose_of(body), index=2 * POSES, timestamp_s=POSES / 15)
    recording.send(later, 0.0)
    growing.close()
    other = tmp_path / "user" / "recordings" / "take.recording"
    assert said == [
        f"the recording is kept in {other} while it runs: {tmp_path / 'full' / 'take.recording'}"
        " cannot be written (No space left on device; free some space or choose another folder)"
    ]
    assert len(read_records(other, read_about(other), body)) == POSES + 1
    assert list((tmp_path / "full").iterdir()) == []
    assert recording.save() == [path]
    assert [file for file in tmp_path.rglob("*") if file.is_file()] == [path]


def test_where_a_recording_grows_is_said_if_its_place_refuses_from_the_beginning(
    tmp_path, body, monkeypatch
):
    said = []
    real = journal.create_new

    def full(path):
        return take_nothing(path) if path.parent == tmp_path / "full" else real(path)

    monkeypatch.setattr(journal, "create_new", full)
    recorded(tmp_path / "full", body, say=said.append)
    other = tmp_path / "user" / "recordings" / "take.recording"
    refused = f"{tmp_path / 'full' / 'take.recording'} cannot be written (No space left on device"
    assert said[0].startswith(f"the recording is kept in {other} while it runs: {refused}")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows keeps the user's folders from others")
@pytest.mark.parametrize("is_link", [False, True])
def test_a_temporary_folder_that_is_private_alone_takes_a_recording(
    tmp_path, body, monkeypatch, is_link
):
    """Whoever may write to it could replace the recording."""
    said = []
    monkeypatch.setattr(unfinished, "lasting_folder", lambda: None)
    place = unfinished.temporary_place()
    prepared = tmp_path / "prepared" if is_link else place
    prepared.mkdir()
    prepared.chmod(0o777)
    if is_link:
        place.symlink_to(prepared)
    about = read_about(recorded(tmp_path / "a", body)[0]._journal.path)
    taken = tmp_path / "no folder"
    taken.touch()
    growing = journal.Journal(taken / "take.recording", about, body, said.append)
    if is_link:
        assert said[0].startswith("the recording is in memory alone")
        assert list(prepared.iterdir()) == []
    else:
        assert growing.path == place / "take.recording"
        assert place.stat().st_mode & 0o777 == 0o700
    growing.remove()


def test_a_recording_in_memory_alone_is_said_to_be_that(tmp_path, body):
    """As with a name that is too long once it has the growing file's suffix."""
    said = []
    about = read_about(recorded(tmp_path / "a", body)[0]._journal.path)
    growing = journal.Journal(tmp_path / f"{'x' * 250}.recording", about, body, said.append)
    assert growing.path is None
    assert said[0].startswith("the recording is in memory alone, and lost if it is killed: ")
    growing.remove()


def test_the_name_of_the_growing_images_is_checked_before_the_capture(tmp_path, monkeypatch, capfd):
    fake_run(monkeypatch, lambda: None)
    video = tmp_path / f"{'x' * 246}.mp4"
    assert main(["live", str(SAMPLE), "--keep-footage", str(video)]) == 1
    assert "choose a shorter name" in capfd.readouterr().err
    assert list(tmp_path.glob("*.mp4")) == []


def refusing(monkeypatch, *folders):
    """Let files of motions below some folders be refused."""
    save = Motion.save

    def full(motion, path):
        if any(str(path).startswith(str(folder)) for folder in folders):
            raise journal.OutputError(f"cannot write {path}: No space left on device")
        save(motion, path)

    monkeypatch.setattr(Motion, "save", full)


def test_a_full_disk_at_the_end_leaves_the_recording_in_a_second_place(tmp_path, body, monkeypatch):
    recording, _ = recorded(tmp_path / "truth", body)
    (truth,) = recording.save()
    path = tmp_path / "full" / "take0.npz"
    path.parent.mkdir()
    path.write_bytes(EARLIER)
    recording, _ = recorded(path.parent, body)
    refusing(monkeypatch, path.parent)
    other = tmp_path / "user" / "recordings" / path.name
    with pytest.raises(
        journal.OutputError, match=f"No space.*; the recording is in {literal(other)}"
    ):
        recording.save()
    assert_same(other, truth)
    assert path.read_bytes() == EARLIER
    assert not list(tmp_path.rglob("*.recording"))


def test_when_the_room_of_the_growing_file_is_needed_the_recording_is_where_it_should_be(
    tmp_path, body, monkeypatch
):
    recording, (path,) = recorded(tmp_path / "full", body)
    save = Motion.save

    def full(motion, place):
        if place == path and list(path.parent.glob("*.recording")):
            raise journal.OutputError(f"cannot write {path}: No space left on device")
        save(motion, place)

    monkeypatch.setattr(Motion, "save", full)
    assert recording.save() == [path]
    assert len(Motion.load(path)) > POSES - 3
    assert [file for file in tmp_path.rglob("*") if file.is_file()] == [path]


def test_when_every_place_refuses_the_growing_file_stays_and_is_named(tmp_path, body, monkeypatch):
    recording, (path,) = recorded(tmp_path / "full", body)
    with monkeypatch.context() as patch:
        refusing(patch, tmp_path)
        file = tmp_path / "full" / "take.recording"
        with pytest.raises(journal.OutputError, match=f"finish it with scope live {literal(file)}"):
            recording.save()
    release(lock_of(file))  # as the end of the process does
    assert main(["live", str(file), "--record", str(path), "--quiet"]) == 0
    assert len(Motion.load(path)) > POSES - 3


def fake_run(monkeypatch, end):
    """Let a live capture give all poses, and then end in some way."""

    def run_live(source, body, options, outputs, listeners, clock=None):
        listeners.camera(people_of(), SIZE)
        for pose in poses(body):
            for output in outputs:
                output.send(pose, 0.0)
        end()
        return {
            "frames": POSES,
            "dropped": 0,
            "damaged": 0,
            "poses": POSES,
            "poses_per_second": 1.0,
            "latency_ms": {"median": 1.0, "p95": 1.0},
            "stopped": False,
        }

    monkeypatch.setattr(run, "run_live", run_live)


def raising(error):
    def end():
        raise error

    return end


ENDS = {
    "source ends": (lambda: None, 0, "wrote"),
    "source fails": (raising(VideoError("fake is gone")), 1, "fake is gone"),
    "disk full": (raising(OSError(errno.ENOSPC, "No space left on device")), 1, "No space left"),
    "defect": (raising(RuntimeError("a defect")), 1, "a defect"),
    "signal": (lambda: signal.raise_signal(signal.SIGTERM), 130, "stopped"),
}


@pytest.mark.parametrize("end", ENDS)
def test_the_command_finishes_the_recording_however_its_capture_ends(
    tmp_path, monkeypatch, capfd, body, end
):
    how, status, said = ENDS[end]
    fake_run(monkeypatch, how)
    path = tmp_path / "out" / "take.npz"
    path.parent.mkdir()
    path.write_bytes(EARLIER)
    assert main(["live", str(SAMPLE), "--record", str(path)]) == status
    error = capfd.readouterr().err
    assert said in error
    assert f"wrote {path}" in error
    assert "nothing was written" not in error
    recording, paths = recorded(tmp_path / "truth", body)
    recording.save()
    np.testing.assert_array_equal(Motion.load(path).trans, Motion.load(paths[0]).trans)
    assert [file.name for file in path.parent.iterdir()] == ["take.npz"]


def test_a_motion_of_an_earlier_recording_of_more_people_is_named(
    tmp_path, monkeypatch, capfd, body
):
    fake_run(monkeypatch, lambda: None)
    earlier = tmp_path / "take.person2.npz"
    earlier.write_bytes(EARLIER)
    assert main(["live", str(SAMPLE), "--record", str(tmp_path / "take.npz")]) == 0
    said = capfd.readouterr().err
    assert f"not part of this result: '{earlier.name}'; remove" in said
    assert earlier.read_bytes() == EARLIER


def test_where_motion_and_images_are_is_said_if_neither_can_be_saved(
    tmp_path, monkeypatch, capfd, body
):
    class Images:
        def save(self):
            raise OutputError("the images until then are in take.unfinished.mp4")

    recording, (path,) = recorded(tmp_path / "full", body)
    refusing(monkeypatch, tmp_path / "full")
    with pytest.raises(OutputError, match="the images until then"):
        live_command._save(recording, Images())
    other = tmp_path / "user" / "recordings" / path.name
    assert f"the recording is in {other}" in capfd.readouterr().err
    assert other.is_file()


def is_whole(path):
    """Whether all poses are in a recording on the disk."""
    about = read_about(path)
    return len(read_records(path, about, load_body(about.body))) == POSES


KILLED = """
import os, signal, sys, time
import pytest
from scope.scope_addon.cli import SAMPLE, main
from scope.scope_addon.command_line import live_command
from scope.tests.live import test_recording_ends as tests
def end():
    left = tests.Path(sys.argv[2]).with_suffix(".recording")
    for _ in range(6000):
        if tests.is_whole(left):
            break
        time.sleep(0.01)
    os.kill(os.getpid(), signal.SIGKILL)
with pytest.MonkeyPatch.context() as patch:
    tests.fake_run(patch, end)
    main(["live", sys.argv[1], "--record", sys.argv[2]])
"""


@on_linux
def test_a_killed_command_leaves_what_the_next_one_names_and_finishes(tmp_path, capfd, monkeypatch):
    path = tmp_path / "take.npz"
    path.write_bytes(EARLIER)
    command = [sys.executable, "-c", KILLED, str(SAMPLE), str(path)]
    assert subprocess.run(command, check=False).returncode == -signal.SIGKILL
    left = tmp_path / "take.recording"
    assert path.read_bytes() == EARLIER
    capfd.readouterr()
    with monkeypatch.context() as patch:
        fake_run(patch, lambda: None)
        assert main(["live", str(SAMPLE), "--record", str(path)]) == 0
    assert f"{left} has a recording that is not finished" in capfd.readouterr().err
    second = Motion.load(path)
    assert main(["live", str(left)]) == 2
    assert f"{path} exists; give another name with --record" in capfd.readouterr().err
    assert main(["live", str(left), "--record", str(tmp_path / "first.npz")]) == 0
    assert "2.6 s of sample.mp4" in capfd.readouterr().err
    np.testing.assert_array_equal(Motion.load(tmp_path / "first.npz").trans[:60], second.trans[:60])
    assert not left.exists()
    assert main(["live", str(left)]) == 1
    assert "does not exist" in capfd.readouterr().err


def test_nobody_seen_leaves_nothing(tmp_path, body):
    (tmp_path / "a").mkdir()
    keep = Keep(tmp_path / "a" / "take.recording", "scope")
    recording = PeopleRecording([tmp_path / "a" / "take.npz"], body, SOURCE, keep=keep)
    recording.begin(people_of(), SIZE)
    with pytest.raises(NoPersonError):
        recording.save()
    assert list(Path(tmp_path / "a").iterdir()) == []
