# SPDX-License-Identifier: GPL-3.0-or-later
"""No option that writes may name, by any path or link, what an argument or option reads."""

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon import cli
from scope.scope_addon.capture.pipeline import Capture
from scope.scope_addon.capture_report import Report
from scope.scope_addon.cli import SAMPLE, main
from scope.scope_addon.command_line.outputs import FOOTAGE, OTHER_INPUTS, check_outputs
from scope.scope_addon.errors import ChangedFootageError, UsageError
from scope.scope_addon.job import watched_capture, worker
from scope.scope_addon.job.request import JobRequest
from scope.scope_addon.job.watched_footage import WatchedFiles

RIG_WITH_TEXTURE = """
import os, sys, bpy
from scope.tests.scene.made_rigs import build_rig
bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
rig, _ = build_rig("mixamo")
texture, *targets = sys.argv[1:]
image = bpy.data.images.new("texture", 4, 4)
image.filepath_raw = texture
image.file_format = "PNG"
image.save()
material = bpy.data.materials.new("skin")
material.use_nodes = True
node = material.node_tree.nodes.new("ShaderNodeTexImage")
node.image = image
shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
mesh = bpy.data.meshes.new("skin")
mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
mesh.uv_layers.new()
mesh.materials.append(material)
skin = bpy.data.objects.new("skin", mesh)
bpy.context.scene.collection.objects.link(skin)
skin.parent = rig
skin.vertex_groups.new(name=rig.data.bones[0].name).add([0, 1, 2], 1.0, "REPLACE")
skin.modifiers.new("Armature", "ARMATURE").object = rig
bpy.ops.wm.save_as_mainfile(filepath=targets[0])
bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
bpy.ops.export_scene.gltf(
    filepath=targets[1], export_format="GLTF_SEPARATE", export_keep_originals=True
)
sys.stdout.flush()
os._exit(0)  # without Blender's exit handlers, which can wait for ever
"""
# Instead of a capture.
WRITE_RESULTS = """
import json, sys
path = sys.argv[sys.argv.index("-o") + 1]
open(path, "w").write("result")
print(json.dumps({"outputs": [path], "warnings": []}))
"""
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


@pytest.mark.parametrize(
    ("read", "written", "kind"),
    [
        *((read, "outputs", NAMES[0]) for read in (*FOOTAGE, *OTHER_INPUTS)),
        *((FOOTAGE[0], written, NAMES[0]) for written in ("overlay", "report")),
        *((FOOTAGE[0], "outputs", kind) for kind in NAMES[1:]),
    ],
)
def test_no_output_is_an_input(tmp_path, read, written, kind):
    file = tmp_path / "read.onnx"
    file.write_text("mine")
    path = other_name(file, WRITTEN[written], kind)
    with pytest.raises(UsageError, match="is the input itself; choose another name"):
        check(written, path, {read: file})
    check(written, tmp_path / f"new{WRITTEN[written]}", {read: file})


@pytest.mark.parametrize("footage", ["f_0001.png", "f_####.png", "."])
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


@pytest.fixture(scope="module")
def texture_and_rigs(tmp_path_factory, blender_module):
    """The texture of a rig, which is read whenever the rig is exported, and files of the rig."""
    folder = tmp_path_factory.mktemp("rigs")
    texture = folder / "texture.png"
    rigs = [str(folder / f"rig{suffix}") for suffix in (".blend", ".gltf")]
    subprocess.run(
        [sys.executable, "-c", RIG_WITH_TEXTURE, str(texture), *rigs],
        check=True,
        cwd=Path(__file__).parents[2],
    )
    return texture, rigs


def test_what_a_rigs_file_refers_to_is_no_output(tmp_path, capsys, texture_and_rigs):
    clip = tmp_path / "walk.png"
    clip.write_text("clip")
    texture, rigs = texture_and_rigs
    was = texture.read_bytes()
    for rig in rigs:
        command = ["capture", str(clip), "--overlay", str(texture), "--retarget", rig]
        assert main([*command, "-o", str(tmp_path / "out.glb"), "--quiet"]) == 2
        assert "texture.png is the input itself" in capsys.readouterr().err
        assert texture.read_bytes() == was


def test_a_clip_is_captured_again_when_a_file_of_its_rig_has_changed(
    tmp_path, capsys, texture_and_rigs
):
    clips = tmp_path / "clips"
    clips.mkdir()
    (clips / "walk.png").write_text("clip")
    texture, rigs = texture_and_rigs
    batch = ["batch", str(clips), "--out", str(tmp_path / "out"), "--formats", "glb"]

    def outcome(rig):
        assert main([*batch, "--retarget", rig], [sys.executable, "-c", WRITE_RESULTS]) == 0
        return capsys.readouterr().err.splitlines()[0].split()[-1]

    for rig in rigs:
        further = [texture, *texture.parent.glob("*.bin")] if rig.endswith(".gltf") else [texture]
        for file in further:
            assert outcome(rig) == "done"
            assert outcome(rig) == "skipped"
            file.write_bytes(file.read_bytes() + b"changed")


def test_the_command_line_refuses_before_it_begins(tmp_path, capsys):
    body = tmp_path / "my.npz"
    body.write_text("body")
    clip = tmp_path / "walk.mp4"
    clip.write_text("clip")
    assert main(["capture", str(clip), "--body", str(body), "-o", str(body), "--quiet"]) == 2
    assert "is the input itself" in capsys.readouterr().err
    assert main(["live", str(clip), "--body", str(body), "--record", str(body)]) == 2
    assert "is the input itself" in capsys.readouterr().err
    assert body.read_text() == "body"


def test_a_batch_replaces_no_picture_of_a_sequence_and_no_map_by_its_report(tmp_path, capsys):
    frames = tmp_path / "clips" / "frames"
    frames.mkdir(parents=True)
    pictures = [frames / f"f_{number}.png" for number in (1, 2)]
    for picture in pictures:
        picture.write_text("picture")
    (tmp_path / "clips" / "walk.mp4").write_text("clip")
    out = tmp_path / "out"
    out.mkdir()
    (out / "walk.npz").symlink_to(pictures[1])
    batch = ["batch", str(tmp_path / "clips"), "--out", str(out), "--formats", "npz"]
    assert main(batch) == 2
    assert "walk.npz is the input itself" in capsys.readouterr().err
    assert pictures[1].read_text() == "picture"
    (out / "walk.npz").unlink()
    calibration = out / "scope-batch.json"
    intrinsics = [[900, 0, 320], [0, 900, 240], [0, 0, 1]]
    camera = {"intrinsics": intrinsics, "dist": [0, 0, 0, 0, 0], "size": [640, 480]}
    calibration.write_text(json.dumps(camera))
    assert main([*batch, "--calibration", str(calibration)]) == 2
    assert "scope-batch.json is the input itself" in capsys.readouterr().err


LENS = {"intrinsics": [[1000, 0, 640], [0, 1000, 360], [0, 0, 1]], "size": [1280, 720]}
CAMERA_PATH = LENS | {"times_s": [0.0], "world_from_camera": [np.eye(4).tolist()]}


@pytest.mark.parametrize("way", ["in a shell", "in the panel"])
@pytest.mark.parametrize(
    ("option", "content"), [("calibration", LENS), ("camera_path", CAMERA_PATH)]
)
def test_a_file_of_an_option_that_is_replaced_during_a_capture_is_noticed(
    tmp_path, capsys, monkeypatch, option, content, way
):
    """It is read more than once: the result would be of both files."""
    file = tmp_path / "camera.json"
    file.write_text(json.dumps(content))

    def replace_file(*_, **__):
        file.with_name("new").write_text(json.dumps(content | {"size": [1920, 1080]}))
        file.with_name("new").replace(file)

    monkeypatch.setattr(watched_capture, "capture", replace_file)
    if way == "in the panel":
        request = JobRequest(str(SAMPLE), **{option: str(file)})
        sent = io.StringIO()
        assert worker.run(request, tmp_path, worker.Reporter(sent)) == 1
        said = json.loads(sent.getvalue().splitlines()[-1])["message"]
    else:
        flag = f"--{option.replace('_', '-')}"
        out = str(tmp_path / "out.npz")
        assert main(["capture", str(SAMPLE), flag, str(file), "-o", out, "--quiet"]) == 1
        said = capsys.readouterr().err.removeprefix("scope: ")
    assert said.startswith(f"{file} was changed while it was read")
    assert not list(tmp_path.glob("*.npz"))


def test_a_file_of_an_option_that_is_saved_again_as_it_was_is_the_same(tmp_path):
    file = tmp_path / "camera.json"
    file.write_text("{}")
    watched = WatchedFiles([file])
    os.utime(file, (1e9, 1e9))
    watched.check()
    file.write_text("[]")
    with pytest.raises(ChangedFootageError, match="camera.json was changed"):
        watched.check()
    file.unlink()
    with pytest.raises(ChangedFootageError, match="camera.json was changed"):
        watched.check()


def test_a_rig_may_be_edited_during_a_capture(tmp_path, capsys, monkeypatch, texture_and_rigs):
    """It decides nothing of what is captured, and is loaded after that."""
    rig = tmp_path / "rig.blend"
    rig.write_bytes(Path(texture_and_rigs[1][0]).read_bytes())

    def edit(*_, **__):
        os.utime(rig, (1e9, 1e9))
        return Capture([], Report())

    def write(*_, **__):
        raise UsageError("the results are written")

    monkeypatch.setattr(watched_capture, "capture", edit)
    monkeypatch.setattr(cli, "write_outputs", write)
    out = str(tmp_path / "out.glb")
    main(["capture", str(SAMPLE), "--retarget", str(rig), "-o", out, "--quiet"])
    assert "the results are written" in capsys.readouterr().err
