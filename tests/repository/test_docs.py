# SPDX-License-Identifier: GPL-3.0-or-later
"""The documentation against the program: every option and key defined once, every link alive, every
code block run.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import re
import shlex
import shutil
from collections import Counter
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from scope import solver
from scope.scope_addon.capture.camera.calibration import placed_cameras, read_calibration
from scope.scope_addon.capture.perception.adapters.box_detector import DETECTOR_TYPES
from scope.scope_addon.capture.perception.adapters.description import read_description
from scope.scope_addon.capture.perception.adapters.keypoint_network import KEYPOINT_TYPES
from scope.scope_addon.cli import SAMPLE, build_parser, main
from scope.scope_addon.command_line.arguments import body_and_options
from scope.scope_addon.edit.corrected_motion import with_corrections
from scope.scope_addon.edit.corrections import (
    Contact,
    DepthFlip,
    Exchange,
    FeetOnFloor,
    Floor,
    Interpolation,
    Pin,
    Upright,
)
from scope.scope_addon.kinematics.face import EXPRESSIONS
from scope.scope_addon.motion import CORRECTION_KEYS, FACE_KEYS, VIEW_KEYS, Motion
from scope.scope_addon.output_paths import check_output
from scope.solver.body_file import BUILT_IN

from ..made_motion import made_face, made_motion, made_views

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]
_NOT_OURS = {".venv", "build", "node_modules", "__pycache__"}


def pages_under(root: Path) -> list[Path]:
    """Return every Markdown file of the repository, without looking into folders of others.

    A folder that is being built changes, or vanishes, while it is listed, and the processes that
    run these tests must find the same files.
    """
    pages = []
    for folder, inner, files in os.walk(root):
        inner[:] = [name for name in inner if name not in _NOT_OURS and not name.startswith(".")]
        pages += [Path(folder, name) for name in files if name.endswith(".md")]
    return sorted(pages)


ALL_PAGES = pages_under(ROOT)
_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.M | re.S)
_LINK = re.compile(r"\]\(([^()\s]+)\)")


def without_code(text: str) -> str:
    return re.sub(r"`[^`\n]*`", "", _BLOCK.sub("", text))


def blocks(language: str) -> list:
    """(page, code) of every block of a language."""
    found = [
        (page, m[2])
        for page in PAGES
        for m in _BLOCK.finditer(page.read_text("utf-8"))
        if m[1] == language
    ]
    return [pytest.param(code, id=f"{page.stem}-{k}") for k, (page, code) in enumerate(found)]


def commands() -> list:
    """(words) of every line of the shell blocks."""
    shell = [
        (page, m[2])
        for page in PAGES
        for m in _BLOCK.finditer(page.read_text("utf-8"))
        if m[1] == "sh"
    ]
    words = [
        (page, shlex.split(line, comments=True))
        for page, code in shell
        for line in code.splitlines()
    ]
    return [pytest.param(w, id=f"{page.stem}: {shlex.join(w)}") for page, w in words if w]


def tables(page: Path) -> list[tuple[str, list[list[str]]]]:
    """First header cell and the rows of every table of a page."""
    found: list[tuple[str, list[list[str]]]] = []
    before = ""
    for line in _BLOCK.sub("", page.read_text("utf-8")).splitlines():
        row = (
            [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else None
        )
        if row and not before.startswith("|"):
            found.append((row[0], []))
        elif row and not re.fullmatch(r"[|\s:-]+", line):
            found[-1][1].append(row)
        before = line
    return found


def options() -> dict[str, set[str]]:
    """Every option and positional argument of each command, without --help and what is hidden."""
    subparsers = next(
        a for a in build_parser()._actions if isinstance(a, argparse._SubParsersAction)
    )
    return {
        command: {
            name
            for action in parser._actions
            if action.help is not argparse.SUPPRESS and action.dest != "help"
            for name in (action.option_strings or [action.metavar])
        }
        for command, parser in subparsers.choices.items()
    }


def defined(header: set[str]) -> Counter:
    """How often each name, and on which page, begins a row of a definition table."""
    rows = [
        (page.name, row[0])
        for page in ALL_PAGES
        for first, rows in tables(page)
        if first in header
        for row in rows
    ]
    return Counter(
        (page, code.split()[0]) for page, cell in rows for code in re.findall(r"`([^`]+)`", cell)
    )


def test_every_option_is_defined_once_in_the_command_line_page():
    known = set().union(*options().values())
    assert {"-o", "--output", "VIDEO", "--jobs"} <= known
    assert defined({"option", "argument"}) == Counter(
        {("command_line.md", name): 1 for name in known}
    )
    elsewhere = [
        (page.name, row[0])
        for page in ALL_PAGES
        for first, rows in tables(page)
        if first not in ("option", "argument")
        for row in rows
        if re.match(r"`--?\w", row[0])
    ]
    assert elsewhere == []


def test_every_key_of_the_motion_file_is_defined_once():
    keys = {field.name for field in fields(Motion)} - {"corrections", "face", "views"} | {
        *CORRECTION_KEYS,
        *FACE_KEYS,
        *VIEW_KEYS,
    }
    assert defined({"key"}) == Counter({("motion_file.md", key): 1 for key in keys})


def test_shapes_and_types_of_the_motion_file_are_as_documented(body, tmp_path):
    given = {
        "zoom": np.ones(7),
        "scene_starts": [3],
        "face": made_face(7),
        "views": made_views(0.5),
    }
    motion = made_motion(body, np.zeros((7, 3 * (body.K + 1))), np.zeros((7, 3)), **given)
    changes = (
        Pin(2, "head", (320.0, 200.0)),
        Contact(1, 3, "left"),
        Exchange(1, 2),
        Exchange(4, 5),
        DepthFlip(0, 2, "left_arm"),
        DepthFlip(1, 4, "right_shin"),
        DepthFlip(2, 6, "body"),
        Interpolation(2, 3),
        Upright.of(np.eye(4)),
        Floor(3, 0.1),
        FeetOnFloor(),
    )
    motion = with_corrections(motion, body, changes)
    motion.save(tmp_path / "a.npz")
    sizes = {
        "T": 7,
        "K": body.K,
        "P": body.P,
        "J": motion.keypoints2d.shape[1],
        "N": 1,
        "C": 1,
        "D": 3,
        "E": 2,
        "V": 1,
        "B": 1,
    }
    sizes |= {"I": 1, "S": 1, "M": 1}
    sizes |= {"W": len(EXPRESSIONS), "F": motion.face["face_landmarks"].size}
    sizes["U"] = len(motion.corrections["uncorrected_rows"])
    rows = [
        row for first, rows in tables(DOCS / "motion_file.md") if first == "key" for row in rows
    ]
    with np.load(tmp_path / "a.npz") as file:
        for key, shape, kind, _ in rows:
            array = file[key.strip("`")]
            assert array.shape == eval(shape.replace("3(", "3*("), sizes), key
            assert array.dtype.kind == "U" if kind == "string" else array.dtype == np.dtype(kind), (
                key
            )


def test_every_public_name_of_the_solver_is_shown_once():
    page = (DOCS / "solver_api.md").read_text("utf-8")
    shown = Counter(re.findall(r"^::: scope\.solver\.(\w+)$", page, re.M))
    assert shown == Counter([*solver.__all__, "kernels", "rotations"])


def test_the_sites_navigation_names_every_page_of_the_docs():
    nav = (ROOT / "mkdocs.yml").read_text("utf-8").partition("\nnav:")[2]
    named = Counter(re.findall(r": docs/(\S+\.md)$", nav, re.M))
    assert named == Counter(page.name for page in DOCS.glob("*.md"))


def anchors(page: Path) -> set[str]:
    """As they are made from headings where the pages are shown."""
    headings = re.findall(r"^#+ (.+)$", _BLOCK.sub("", page.read_text("utf-8")), re.M)
    return {
        re.sub(r"[^\w\- ]", "", re.sub(r"[`*]", "", h).lower()).replace(" ", "-") for h in headings
    }


@pytest.mark.parametrize("page", ALL_PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_every_link_leads_somewhere(page):
    for target in _LINK.findall(without_code(page.read_text("utf-8"))):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.is_relative_to(ROOT), target
        assert file.exists(), target
        if anchor:
            assert anchor in anchors(file), target


@pytest.mark.parametrize("page", ALL_PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_every_file_that_is_named_exists(page):
    text = _BLOCK.sub("", page.read_text("utf-8"))
    tops = "assets|benchmarks|docs|scope_addon|scripts|solver|tests|tools"
    for name in re.findall(rf"`(?:\./)?((?:{tops})/[\w./-]*)`", text):
        assert (
            any((folder / name).exists() for folder in (ROOT, page.parent)) or "height.py" in name
        ), name


@pytest.mark.parametrize("page", sorted(DOCS.glob("*.md")), ids=lambda p: p.name)
def test_every_page_can_be_reached_from_the_readme(page):
    assert f"(docs/{page.name})" in (ROOT / "README.md").read_text("utf-8")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty current folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def parsed(words: list[str]) -> argparse.Namespace:
    """A capture, batch or import, its footage and body replaced by the sample clip and the default
    body.
    """
    start = words.index("scope") + 1 if words[0] == "blender" else 0
    argv = [Path(words[start]).name, *words[start + 1 :]]
    args = build_parser().parse_args(argv)
    for name in (getattr(args, "video", None), Path(getattr(args, "body", "scope"))):
        if name and name.suffix in (".mp4", ".npz"):
            name.symlink_to(SAMPLE if name.suffix == ".mp4" else BUILT_IN["scope"])
    return args


@pytest.mark.parametrize("words", commands())
def test_every_command_would_be_accepted(words, folder):
    if Path(words[-1]).name == "--help":
        with pytest.raises(SystemExit, match="0"):
            parsed(words)
    elif words[0] in ("./scripts/capture", "./scripts/batch", "./scripts/import", "blender"):
        args = parsed(words)
        if args.command in ("capture", "batch"):
            body_and_options(args)
        if args.command != "report-a-problem":
            for path in getattr(args, "output", []):
                check_output(path)
    elif words[0].startswith("./"):
        assert os.access(ROOT / words[0], os.X_OK)
    else:
        assert words[:2] == [".venv/bin/python", "-m"]
        assert importlib.util.find_spec(words[2]) is not None


@pytest.mark.slow
@pytest.mark.usefixtures("blender_module")
def test_the_first_capture_of_the_command_line_page_is_run(folder, capfd):
    page = (DOCS / "command_line.md").read_text("utf-8")
    words = shlex.split(re.search(r"## capture\n\n```sh\n\./scripts/(.+)", page)[1], comments=True)
    (folder / "walk.mp4").symlink_to(SAMPLE)
    assert main([*words, "--quality", "fast", "--end", "0.1", "--json"]) == 0
    report = json.loads(capfd.readouterr().out)
    written = [
        word
        for before, word in zip(words, words[1:], strict=False)
        if before in ("-o", "--overlay")
    ]
    assert len(written) == 3
    assert report["outputs"]
    assert all((folder / name).stat().st_size > 0 for name in written)
    entries = next(rows for first, rows in tables(DOCS / "command_line.md") if first == "entry")
    assert {code for row in entries for code in re.findall(r"`([^`]+)`", row[0])} == set(report)


def session() -> list:
    """(words) of the captures in the README's session, but that for a rig, which the reader has."""
    readme = (ROOT / "README.md").read_text("utf-8")
    lines = (
        readme.partition("## A session in the shell\n\n```sh\n")[2].partition("```")[0].splitlines()
    )
    words = [shlex.split(line.removeprefix("./scripts/"), comments=True) for line in lines]
    return [
        pytest.param(w, id=shlex.join(w))
        for w in words
        if w[0] == "capture" and "--retarget" not in w
    ]


@pytest.mark.slow
@pytest.mark.usefixtures("blender_module")
@pytest.mark.parametrize("words", session())
def test_the_captures_of_the_readme_are_run(words, folder):
    (folder / "walk.mp4").symlink_to(SAMPLE)
    for name in ("left.mp4", "right.mp4"):
        shutil.copy(SAMPLE, folder / name)
    assert main([*words, "--quality", "fast", "--end", "0.1", "--quiet"]) == 0
    written = [
        word for before, word in zip(words, words[1:], strict=False) if before in ("-o", "--report")
    ]
    for name in written or ["walk.glb"]:
        assert (folder / name).stat().st_size > 1000


# Those of the solver's page are run by tests/solver/test_api_page.py.
@pytest.mark.parametrize(
    "code", [each for each in blocks("python") if not str(each.id).startswith("solver_api")]
)
def test_every_python_block_runs(code, body, folder, capsys):
    seen = {"joints_cam": np.ones((3, body.K + 1, 3))}
    made_motion(body, np.zeros((3, 3 * (body.K + 1))), np.zeros((3, 3)), **seen).save(
        folder / "walk.npz"
    )
    index = list(body.keypoint_set("coco").values())[:17]
    state = solver.State.rest(body.K, body.P)
    rotations = np.concatenate([state.R_camera_root[None], state.Omega[-body.K :]])
    R, t = body.forward_kinematics(rotations, state.t_camera_root - body.rest_joints()[0])
    K = np.array([[800.0, 0, 320], [0, 800, 240], [0, 0, 1]])
    points = body.keypoints(R, t)[index]
    pixels = (points / points[:, 2:] @ K.T)[:, :2]
    confidence = np.ones(17)
    frame = solver.Measurements(K, keypoints2d=solver.Keypoints2D(index, pixels, confidence))
    names = {
        "K": K,
        "pixels": pixels,
        "confidence": confidence,
        "frames": [frame] * 3,
        "times": [0.0, 0.04, 0.08],
    }
    exec(compile(code, "page", "exec"), names)
    if "fit" in names:
        error = np.linalg.norm(names["fit"].t_camera_part - names.get("joints", t), axis=1)
        assert error.mean() < 0.2  # one view does not fix the depth
    joints = names.get("joints")
    assert joints is None or np.isfinite(joints).all()
    if "off" in names:
        status, error = capsys.readouterr().out.split(", ")
        page = (ROOT / "docs" / "for_researchers.md").read_text("utf-8")
        said = re.search(rf"prints `{status}, (\d+) mm`", page)
        assert float(said[1]) == pytest.approx(float(error.split()[0]), abs=3.0)


def test_researchers_are_told_the_recorded_figures_of_the_sample():
    """What the page's own lines print of its capture, as the gate records it."""
    record = json.loads((ROOT / "benchmarks" / "gate.json").read_text("utf-8"))
    figures = (record[f"sample {key}"]["value"] for key in ("mpjpe_root", "pa_mpjpe"))
    page = (ROOT / "docs" / "for_researchers.md").read_text("utf-8")
    assert "prints {:.0f} / {:.0f} mm".format(*figures) in page


@pytest.mark.parametrize("code", blocks("toml"))
def test_every_toml_block_is_a_calibration_with_places(code, folder):
    (folder / "calib.toml").write_text(code + "\n" + code.replace("cam_1", "cam_2"))
    found = placed_cameras(folder / "calib.toml", ["Cam1", "Cam2"])
    assert all(place is not None for _, place in found)
    assert all(read_calibration(file).intrinsics.any() for file, _ in found)


@pytest.mark.parametrize("code", blocks("json"))
def test_every_json_block_is_read(code, tmp_path):
    file = tmp_path / "network.json"
    file.write_text(code, "utf-8")
    if "intrinsics" in json.loads(code):
        assert read_calibration(file).size is not None
    else:
        described = read_description(file.with_suffix(".onnx"), DETECTOR_TYPES + KEYPOINT_TYPES)
        assert described.mean is not None
