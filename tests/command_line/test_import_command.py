# SPDX-License-Identifier: GPL-3.0-or-later
"""``scope import``: formats, report, warnings, and one sentence where a file cannot be used."""

import json

import numpy as np
import pytest
from scope.scope_addon.cli import main
from scope.scope_addon.motion import Motion

from ..edit.walking import motion_of, walk

MOTION = motion_of(walk(0.5))

TWO_RIGS = ["--retarget", "rig.glb", "--retarget", "other.glb"]


@pytest.fixture
def amass(tmp_path):
    path = tmp_path / "walk.npz"
    np.savez(path, poses=MOTION.poses, trans=MOTION.trans, mocap_frame_rate=np.array(60.0))
    return path


@pytest.mark.usefixtures("blender_module")
def test_the_outputs_and_the_report(amass, capfd):
    outputs = [amass.with_name(name) for name in ("out.glb", "out.bvh", "out.blend", "out.npz")]
    argv = ["import", str(amass), "--json"]
    assert main([*argv, *(word for path in outputs for word in ("-o", str(path)))]) == 0
    out, err = capfd.readouterr()
    report = json.loads(out)
    assert set(report["outputs"]) == {str(path) for path in outputs}
    assert (report["body"], report["frames"], report["frame_rate"]) == ("scope", len(MOTION), 60.0)
    assert all(path.stat().st_size > 1000 for path in outputs)
    assert all(f"scope: warning: {note}" in err for note in report["warnings"])
    np.testing.assert_allclose(Motion.load(outputs[-1]).poses, MOTION.poses, atol=1e-5)


@pytest.mark.usefixtures("blender_module")
def test_without_an_output_a_glb_lies_beside_the_motion(amass):
    assert main(["import", str(amass), "--quiet"]) == 0
    assert amass.with_suffix(".glb").stat().st_size > 1000


@pytest.mark.usefixtures("blender_module")
@pytest.mark.parametrize(
    ("arguments", "status", "says"),
    [
        (["missing.npz"], 1, "does not exist"),
        (["text.npz"], 1, "not a readable motion file (it is no archive, array or pickle)"),
        (["other.npz"], 1, "no SMPL-style motion"),
        (["walk.npz", "-o", "walk.npz"], 2, "is the input itself"),
        (["walk.npz", "--up", "x"], 2, "--up"),
        (["walk.npz", "--rate", "nan"], 2, "--rate"),
        (["walk.npz", "--body", "none.npz"], 1, "none.npz"),
        (
            ["walk.npz", "--retarget", "rig.glb", "--expression-map", "face.json"],
            2,
            "expressions, which walk.npz does not have",
        ),
        (["walk.npz", *TWO_RIGS], 2, "2 rigs need 2 outputs"),
        (["walk.npz", *TWO_RIGS, "-o", "a.glb", "-o", "a.npz"], 2, "but there is 1"),
        (
            ["walk.npz", *TWO_RIGS, "-o", "a.glb", "-o", "b.glb", "--rig-object", "Rig"],
            2,
            "--rig-object is given 1 times for 2 rigs",
        ),
        (["."], 1, "not a readable motion file"),
    ],
)
def test_errors_are_one_sentence_and_write_nothing(
    amass, monkeypatch, capfd, arguments, status, says
):
    monkeypatch.chdir(amass.parent)
    (amass.parent / "text.npz").write_text("no motion")
    np.savez(amass.parent / "other.npz", x=np.zeros(3))
    before = sorted(amass.parent.iterdir())
    assert main(["import", *arguments]) == status
    err = capfd.readouterr().err
    assert says in err
    assert err.count("\n") == 1
    assert sorted(amass.parent.iterdir()) == before
