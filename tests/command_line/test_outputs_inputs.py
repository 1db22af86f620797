# SPDX-License-Identifier: GPL-3.0-or-later
"""No option that writes may name, by any path or link, what an argument or option reads."""

import json
import os

import pytest
from scope.scope_addon.cli import main
from scope.scope_addon.command_line.outputs import FOOTAGE, OTHER_INPUTS, check_outputs
from scope.scope_addon.errors import UsageError

WRITTEN = {"outputs": ".npz", "overlay": ".mp4", "report": ".html"}
NAMES = ("symbolic link", "hard link", "detour")


def other_name(read, suffix, kind):
    """Another path of the same file, with the suffix of an output."""
    path = read.with_name(f"result{suffix}")
    if kind == "symbolic link":
        path.symlink_to(read)
    elif kind == "hard link":
        os.link(read, path)
    else:
        os.link(read, path)
        (read.parent / "below").mkdir()
        path = read.parent / "below" / ".." / path.name
    return path


def check(written, path, values):
    outputs = [path] if written == "outputs" else []
    given = {written: path} if written != "outputs" else {}
    check_outputs(outputs, values, **given)


@pytest.mark.parametrize("kind", NAMES)
@pytest.mark.parametrize("written", WRITTEN)
@pytest.mark.parametrize("read", [*FOOTAGE, *OTHER_INPUTS])
def test_no_output_is_an_input(tmp_path, read, written, kind):
    file = tmp_path / "read.onnx"
    file.write_text("mine")
    path = other_name(file, WRITTEN[written], kind)
    with pytest.raises(UsageError, match="is the input itself; choose another name"):
        check(written, path, {read: file})
    check(written, tmp_path / f"new{WRITTEN[written]}", {read: file})


@pytest.mark.parametrize("footage", ["f_0001.png", "f_####.png", "f_%04d.png", "."])
def test_no_output_is_a_picture_of_a_sequence(tmp_path, footage):
    for number in (1, 2, 3):
        (tmp_path / f"f_{number:04d}.png").write_text("picture")
    values = {"video": tmp_path / footage}
    with pytest.raises(UsageError, match="f_0002.png is the input itself"):
        check("overlay", tmp_path / "f_0002.png", values)
    check("overlay", tmp_path / "drawn_0002.png", values)


def test_an_earlier_overlay_beside_a_picture_may_be_replaced(tmp_path):
    (tmp_path / "walk.png").write_text("picture")
    (tmp_path / "overlay.png").write_text("earlier overlay")
    check("overlay", tmp_path / "overlay.png", {"video": tmp_path / "walk.png"})


def test_the_description_of_a_network_is_no_output(tmp_path):
    (tmp_path / "people.onnx").write_text("network")
    (tmp_path / "people.json").write_text("{}")
    (tmp_path / "out.npz").symlink_to("people.json")
    with pytest.raises(UsageError, match="is the input itself"):
        check("outputs", tmp_path / "out.npz", {"detector": tmp_path / "people.onnx"})


def test_the_file_of_one_of_several_people_is_no_input(tmp_path):
    body = tmp_path / "take.person2.npz"
    body.write_text("body")
    with pytest.raises(UsageError, match="take.person2.npz is the input itself"):
        check("outputs", tmp_path / "take.npz", {"body": body})


def test_the_command_line_refuses_before_it_begins(tmp_path, capsys):
    body = tmp_path / "my.npz"
    body.write_text("body")
    clip = tmp_path / "walk.mp4"
    clip.write_text("clip")
    assert main(["capture", str(clip), "--body", str(body), "-o", str(body), "--quiet"]) == 2
    assert "is the input itself" in capsys.readouterr().err
    assert main(["live", str(clip), "--body", str(body), "--record", str(body)]) == 2
    assert "is the input itself" in capsys.readouterr().err
    calibration = tmp_path / "camera.json"
    intrinsics = [[900, 0, 320], [0, 900, 240], [0, 0, 1]]
    camera = {"intrinsics": intrinsics, "dist": [0, 0, 0, 0, 0], "size": [640, 480]}
    calibration.write_text(json.dumps(camera))
    (tmp_path / "walk.npz").symlink_to(calibration)
    batch = ["batch", str(tmp_path), "--out", str(tmp_path), "--calibration", str(calibration)]
    assert main([*batch, "--formats", "npz"]) == 2
    assert "walk.npz is the input itself" in capsys.readouterr().err
    assert body.read_text() == "body"
