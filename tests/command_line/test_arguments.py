# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of the capture options, and the arguments that a batch passes on."""

from __future__ import annotations

import os
import shutil

import pytest
from scope.scope_addon.cli import build_parser
from scope.scope_addon.command_line.arguments import (
    body_and_options,
    non_default_arguments,
    with_bare_values,
)
from scope.scope_addon.errors import UsageError
from scope.solver.body_file import BUILT_IN


def options(*argv):
    """What a capture's arguments mean."""
    return body_and_options(build_parser().parse_args(["capture", *argv]))[1]


def passed_on(*argv):
    """The arguments that a batch passes on to the process of each clip."""
    return non_default_arguments(build_parser().parse_args(["batch", ".", "--out", "out", *argv]))


@pytest.mark.parametrize(("said", "meant"), [("2", 2), ("all", "all"), ("largest", "largest")])
def test_the_number_of_people(said, meant):
    assert options("--people", said).people == meant


@pytest.mark.parametrize("said", ["0", "1.5", "", "9999999", "\u0663"])
def test_an_invalid_number_of_people_is_an_error(said):
    with pytest.raises(UsageError, match="people"):
        options(f"--people={said}")


@pytest.mark.parametrize(
    ("said", "meant"), [("175", (1.75,)), ("175,162.5", (1.75, 1.625)), ("180, 170", (1.8, 1.7))]
)
def test_heights_are_centimetres(said, meant):
    assert options("--height", said).heights_m == pytest.approx(meant)


@pytest.mark.parametrize(
    ("said", "body"),
    [
        (["--height", "110"], "scope_child"),
        (["--height", "175,110", "--people", "2"], "scope_child"),
        (["--height", "110", "--hands"], "scope_child_h"),
        (["--height", "150"], "scope"),
    ],
)
def test_the_height_of_a_child_needs_the_body_of_all_ages(said, body):
    assert (
        body_and_options(build_parser().parse_args(["capture", "clip.mp4", *said]))[0].name == body
    )


@pytest.mark.parametrize("flag", ["--person", "--crop", "--offset"])
def test_an_empty_text_is_not_an_option_left_out(flag):
    """As an unset variable of the shell gives it."""
    for argv in ([flag, " ", "a.mp4"], [f"{flag}=", "a.mp4"]):
        with pytest.raises(UsageError, match=f"{flag} is empty"):
            with_bare_values(argv)


def test_what_several_cameras_refuse_is_said_before_the_first_take(tmp_path):
    argv = ["batch", str(tmp_path), "--out", str(tmp_path), "--views", "--person", "640,360"]
    with pytest.raises(UsageError, match="--person is a place in one video"):
        body_and_options(build_parser().parse_args(argv))


def test_a_list_may_begin_with_a_number_below_zero():
    argv = ["capture", "--offset", "-0.4,auto", "--offset", "-.5", "--hands", "a.mp4", "-o", "x"]
    assert with_bare_values(argv) == [
        "capture",
        "--offset=-0.4,auto",
        "--offset=-.5",
        "--hands=on",
        "a.mp4",
        "-o",
        "x",
    ]


def test_ones_own_body_is_not_exchanged(tmp_path):
    own = shutil.copy(BUILT_IN["scope"], tmp_path / "own.npz")
    with pytest.raises(UsageError, match="can be 127 to 213 cm tall, not 110: omit the height"):
        body_and_options(
            build_parser().parse_args(
                ["capture", "clip.mp4", "--height", "110", "--body", str(own)]
            )
        )


@pytest.mark.parametrize("said", ["", "175,", "1,75", "nan", "175;162"])
def test_an_invalid_height_is_an_error(said):
    with pytest.raises(UsageError):
        options(f"--height={said}")


def test_a_batch_passes_the_rig_on(tmp_path):
    given = {
        "--retarget": str(tmp_path / "rig.glb"),
        "--rig-object": "Rig",
        "--retarget-root": "object",
    }
    argv = [word for option in given.items() for word in option]
    assert passed_on(*argv) == given


def test_processes_with_another_current_folder_find_the_files_of_the_options(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert passed_on("--calibration", "lens.json", "--detector", "/a.onnx") == {
        "--calibration": str(tmp_path / "lens.json"),
        "--detector": os.path.abspath("/a.onnx"),
    }
    for name in ("SMPL.npz", "SMPL.pkl", "SMPL.pickle"):
        assert passed_on("--body", f"my/{name}") == {"--body": str(tmp_path / "my" / name)}
    assert passed_on("--body", "scope_h") == {"--body": "scope_h"}
