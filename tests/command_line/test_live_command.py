# SPDX-License-Identifier: GPL-3.0-or-later
"""The command of live captures as users see it: a sentence and a status for what is wrong, a file
that is kept.
"""

import json
import os
import signal
import socket
import subprocess
import sys
from importlib.machinery import PathFinder
from itertools import islice

import numpy as np
import pytest
from scope.scope_addon import installed
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.cli import SAMPLE, main
from scope.scope_addon.command_line import signals
from scope.scope_addon.job import live_cameras
from scope.scope_addon.job.live_cameras import ListedCamera
from scope.scope_addon.live.people import LivePeople
from scope.scope_addon.live.smoothing import DELAY_S
from scope.scope_addon.live.vmc import BONES
from scope.scope_addon.motion import Motion

from ..live.mjpeg_server import mjpeg_server
from ..live.test_vmc import parsed


@pytest.mark.parametrize(
    ("arguments", "status", "sentence"),
    [
        (["missing.mp4"], 1, "missing.mp4 does not exist; check the path"),
        (["ftp://host/x"], 1, "'ftp' is not a kind of stream that can be read"),
        (
            ["x.mp4", "--record", "a.glb"],
            2,
            "--record writes a motion file: give a name that ends in .npz, not a.glb",
        ),
        (["x.mp4", "--record", "none/a.npz"], 1, "none"),
        (
            ["x.mp4", "--keep-footage", "a.mov"],
            2,
            "--keep-footage writes a video: give a name that ends in .mp4, not",
        ),
        (
            [str(SAMPLE), "--vmc", "39539"],
            2,
            "--vmc must be HOST:PORT, such as 127.0.0.1:39539, not '39539'",
        ),
        (
            [str(SAMPLE), "--height", "70"],
            2,
            "'scope_child' can be 80 to 213 cm tall, not 70: omit the height",
        ),
        (["x.mp4", "--height", "170,180"], 2, "2 heights are given, but --people is 1"),
        (["x.mp4", "--json-port", "70000"], 2, "--json-port must be from 0 to 65535, not 70000"),
        ([str(SAMPLE), "--listen", "0.0.0.0"], 2, "--listen is the address on which --json-port"),
        ([str(SAMPLE), "--reconnect", "0"], 2, "--reconnect is for cameras and streams"),
        (["0", "--list-formats", "--record", "a.npz"], 2, "--record is for a capture"),
        (["x.mp4", "--list-formats"], 2, "x.mp4 is not a camera; give its number, 0 for the first"),
        (
            ["rtsp://me:secret@host/a", "--list-formats"],
            2,
            "scope: a stream is not a camera; give its number",
        ),
        (
            ["x.mp4", "--focal-mm", "26", "--fov", "60"],
            2,
            "--focal-mm and --fov contradict each other",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(
    arguments, status, sentence, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert main(["live", *arguments]) == status
    error = capsys.readouterr().err
    assert sentence in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_the_formats_of_a_camera_are_told_without_opening_it_as_a_source(capfd, monkeypatch):
    told = ListedCamera(2, "USB Camera", ("mjpeg 1280×720",))
    monkeypatch.setattr(live_cameras, "ask_for_formats", lambda source: {"2": told}[source])
    assert main(["live", "2", "--list-formats"]) == 0
    assert capfd.readouterr().err == "scope: 2: USB Camera (mjpeg 1280×720)\n"
    assert main(["live", "2", "--list-formats", "--json"]) == 0
    report = json.loads(capfd.readouterr().out)
    assert (report["camera"], report["name"], report["formats"]) == (
        2,
        "USB Camera",
        ["mjpeg 1280×720"],
    )


def test_a_port_in_use_is_said(capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert main(["live", str(SAMPLE), "--json-port", str(port)]) == 1
    assert f"cannot listen on 127.0.0.1 port {port}" in capsys.readouterr().err


def test_an_empty_address_does_not_mean_all_networks(capsys):
    assert main(["live", str(SAMPLE), "--json-port", "0", "--listen", ""]) == 2
    assert "--listen is empty" in capsys.readouterr().err


@pytest.mark.parametrize("given", [["--json-port", "0"], ["--people", "2"], ["--height", "170"]])
def test_finishing_a_recording_does_nothing_else(tmp_path, capsys, given):
    left = tmp_path / "take.recording"
    left.write_text("{}\n")
    assert main(["live", str(left), *given]) == 2
    assert f"{given[0]} is for a running capture" in capsys.readouterr().err


def test_the_extension_says_where_live_captures_are(capsys, monkeypatch):
    def find_spec(name, *_):
        return None if name.endswith(".json_lines") else PathFinder.find_spec(name)

    monkeypatch.setattr(installed, "find_spec", find_spec)
    assert main(["live", "0"]) == 1
    said = (
        "scope: Blender's extension captures live in its panel alone; use ./scripts/live in the "
        "repository\n"
    )
    assert capsys.readouterr().err == said


@pytest.mark.usefixtures("networks")
def test_a_signal_whose_exception_is_lost_ends_a_live_capture_too(tmp_path, monkeypatch, capfd):
    """The exception is lost while a frame is processed, as in a callback of a weak reference."""
    step = LivePeople.step

    def losing(people, frame):
        signals.received.append(signal.SIGINT)
        return step(people, frame)

    monkeypatch.setattr(LivePeople, "step", losing)
    monkeypatch.setattr(signals, "received", [])
    assert main(["live", str(SAMPLE), "--record", str(tmp_path / "take.npz"), "--json"]) == 0
    report = json.loads(capfd.readouterr().out)
    assert (report["stopped"], report["poses"], report["outputs"]) == (
        True,
        1,
        [str(tmp_path / "take.npz")],
    )


def times_seen(lines):
    """Return the times (n,) of the poses in which somebody is seen, of complete lines: the last one
    may be cut.
    """
    poses = [json.loads(line) for line in lines if line.endswith(b"\n")]
    return np.array([pose["time_s"] for pose in poses if pose["presence"] == "seen"])


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="SIGINT of POSIX")
@pytest.mark.usefixtures("networks")
def test_ctrl_c_ends_a_capture_that_sends_its_poses_and_keeps_the_recording(tmp_path):
    target = tmp_path / "take.npz"
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.bind(("127.0.0.1", 0))
    receiver.settimeout(300)
    with open_video(SAMPLE) as video:
        pictures = [frame.image_rgb for frame in islice(video, 0, 60, 2)]
    # a file would end on a busy computer
    with mjpeg_server(pictures, interval_s=0.05, rounds=10_000) as address:
        command = [
            sys.executable,
            "-m",
            "scope.scope_addon",
            "live",
            address,
            "--json-port",
            "0",
            "--json",
        ]
        command += ["--vmc", f"127.0.0.1:{receiver.getsockname()[1]}", "--record", str(target)]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as process:
            port = int(process.stderr.readline().rsplit(" ", 1)[1])
            with (
                socket.create_connection(("127.0.0.1", port), timeout=300) as client,
                client.makefile("rb") as lines,
            ):
                assert json.loads(lines.readline())["format"] == "scope live"
                sent = []
                bones = {}
                while len(times_seen(sent)) < 4:
                    sent.append(lines.readline())
                while len(bones) < len(BONES):
                    messages = parsed(receiver.recv(65536))
                    bones |= {
                        values[0]: values[1:]
                        for name, values in messages
                        if name == "/VMC/Ext/Bone/Pos"
                    }
                process.send_signal(signal.SIGINT)
                sent += lines.readlines()
                out, _ = process.communicate(timeout=300)
    receiver.close()
    assert set(bones) == set(BONES)
    assert 0.5 < bones["Hips"][1] < 1.3  # metres over the floor
    report = json.loads(out)
    assert (process.returncode, report["stopped"], report["outputs"]) == (0, True, [str(target)])
    # Smoothing gives each pose a little later, so that those of the frames during the last delay
    # are missing. A client may miss lines, also the last ones, so that what it got says which
    # frames must be there, not which are all. The signal may come when the last pose has been sent,
    # and not been recorded yet.
    motion = Motion.load(target)
    recorded = motion.timestamps[motion.valid]
    assert 1 <= len(recorded) < report["poses"]
    times = times_seen(sent)[:-1]
    for time_s in times[times < times[-1] - DELAY_S]:
        assert np.abs(recorded - time_s).min() < 1e-3  # lines give four decimals
