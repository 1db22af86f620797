# SPDX-License-Identifier: GPL-3.0-or-later
"""The job type for Flamenco: compiled as its manager does, and its commands run as its worker
does.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from scope.scope_addon.cli import SAMPLE, build_parser
from scope.scope_addon.motion import Motion

from ..required import missing

JOB_TYPE = Path(__file__).resolve().parents[2] / "scripts" / "flamenco" / "scope_capture.js"

# What Flamenco Manager gives a job compiler, as far as this one uses it: author, path (with stem),
# print, and the job.
MANAGER = """
const { readFileSync } = require("fs"), vm = require("vm"), posix = require("path").posix;
const tasks = [];
const author = {
    Task: (name, type) => ({
        name, type, commands: [], addCommand(command) { this.commands.push(command); }
    }),
    Command: (name, parameters) => ({ name, parameters }),
};
const path = { join: posix.join, basename: posix.basename, stem: name => posix.parse(name).name };
const context = vm.createContext({ author, path, print: () => {} });
vm.runInContext(readFileSync(process.argv[1], "utf8"), context);
const settings = JSON.parse(process.argv[2]);
context.job = { name: "a job", settings, addTask: task => tasks.push(task) };
try {
    if (settings) vm.runInContext("compileJob(job)", context);
    console.log(JSON.stringify({ type: vm.runInContext("JOB_TYPE", context), tasks }));
} catch (error) {
    console.log(JSON.stringify({ error: String(error) }));
}
"""
# Flamenco's worker puts Blender's path in the place of {blender}. This takes the same arguments.
BLENDER = """#!{python}
import sys
assert sys.argv[1:4] == ["--background", "--command", "scope"], sys.argv
sys.argv[1:] = sys.argv[4:]
from scope.scope_addon.cli import run
run()
"""


def compiled(settings):
    node = shutil.which("node")
    if node is None:  # nothing else needs it, so set-up does not install it
        missing(
            "node is not installed, which runs job types of Flamenco here",
            allowed_by="SCOPE_WITHOUT_NODE",
        )
    command = [node, "-e", MANAGER, str(JOB_TYPE), json.dumps(settings)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def given(folder, **settings):
    """The settings as Blender submits them: the given ones, defaults, and what it evaluates."""
    values = {"folder": str(folder), "out": str(folder.parent / "out"), **settings}
    for setting in compiled(None)["type"]["settings"]:
        if "eval" in setting:
            names = {"Path": Path, "abspath": str, "settings": SimpleNamespace(**values)}
            values[setting["key"]] = eval(setting["eval"], names, {})
        else:
            values.setdefault(setting["key"], setting.get("default"))
    return values


@pytest.fixture
def folder(tmp_path):
    for name in ("clips", "out"):
        (tmp_path / name).mkdir()
    return tmp_path / "clips"


def test_each_clip_is_a_task_with_results_of_its_own(folder):
    for name in ("a.mp4", "A.mov", "two words.PNG", "notes.txt", ".hidden.mp4"):
        (folder / name).touch()
    tasks = compiled(
        given(folder, formats="npz, glb", reports=True, options="--people all  --height 182")
    )["tasks"]
    assert [task["name"] for task in tasks] == ["A.mov", "a.mp4", "two words"]
    assert {task["type"] for task in tasks} == {"blender"}
    for task, file in zip(tasks, ("A.mov", "a.mp4", "two words.PNG"), strict=True):
        (command,) = task["commands"]
        assert command["name"] == "exec"
        assert command["parameters"]["exe"] == "{blender}"
        args = build_parser().parse_args(command["parameters"]["args"][3:])
        out = folder.parent / "out" / task["name"]
        assert args.video == folder / file
        assert args.output == [Path(f"{out}.npz"), Path(f"{out}.glb")]
        assert args.report == Path(f"{out}.report.html")
        assert (args.people, args.height, args.quality) == ("all", "182", "best")


@pytest.mark.parametrize(
    ("files", "formats", "says"),
    [
        ([], "npz", "there is no footage in"),
        (["a.mp4"], " ,", "the list of formats is empty"),
        (["a.mp4", "a.mov", "a.mp4.png"], "npz", "two clips would have the same name"),
    ],
)
def test_what_cannot_be_compiled_is_refused_with_a_sentence(folder, files, formats, says):
    for name in files:
        (folder / name).touch()
    assert says in compiled(given(folder, formats=formats))["error"]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="the stand-in for Blender is a script")
@pytest.mark.usefixtures("networks")
def test_the_commands_capture(folder, tmp_path):
    shutil.copy(SAMPLE, folder / "walk.mp4")
    blender = tmp_path / "blender"
    blender.write_text(BLENDER.format(python=sys.executable))
    blender.chmod(0o755)
    (task,) = compiled(given(folder, formats="npz", quality="fast", options="--end 0.1"))["tasks"]
    (command,) = (each["parameters"] for each in task["commands"])
    subprocess.run(
        [command["exe"].replace("{blender}", str(blender)), *command["args"]], check=True
    )
    assert Motion.load(folder.parent / "out" / "walk.npz").frames.size == 4
