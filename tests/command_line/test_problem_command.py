# SPDX-License-Identifier: GPL-3.0-or-later
"""A problem report has what developers need, and nothing that names the user's files or people."""

import json
import os
import platform
from pathlib import Path

import pytest
from scope.scope_addon.capture_report import Report
from scope.scope_addon.cli import main
from scope.scope_addon.notices import notice

SECRETS = ("Ann", "Smith", "smith", "wedding", "hunter2", "192.168", "home", "C:")
FOLDER = "/home/Ann Smith/wedding (2)"


def report_of_a_private_clip() -> dict:
    url = "rtsp://smith:hunter2@192.168.1.5/door"
    warnings = [
        notice("cuts", footage="Ann Smith's wedding.mp4", times=[2.0, 4.125]),
        notice("provider_failed", provider="CUDA", reason=f"no {FOLDER}/lib.so"),
        notice("other", text=f"cannot read C:\\Users\\Ann\\{url}"),
        notice("no_hands", footage=url, person=2),
    ]
    report = Report(
        source=f"{FOLDER}/wedding of Ann.mp4",
        frames=301,
        people=2,
        valid_frames=300,
        per_person=[{"valid_frames": 300, "height_m": 1.73, "note": f"{FOLDER}/a"}],
        quality="best",
        detector=f"{FOLDER}/smith.onnx",
        keypoints="built-in",
        execution="CUDA and CPU with 2 threads",
        body="Ann",
        camera=f"{FOLDER}/wedding.json",
        up="lines",
        focal_px=912.5,
        frame_rate=[30000, 1001],
        fps={"observe": 40.5},
        warnings=warnings,
    )
    return report.as_json() | {"outputs": [f"{FOLDER}/out.glb"], "owner": "Ann Smith"}


def test_no_name_of_the_users_is_in_the_file_and_every_figure_is(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("Ann.json").write_text(json.dumps(report_of_a_private_clip()), "utf-8")
    assert main(["report-a-problem", "Ann.json"]) == 0
    assert "scope-problem.json" in capsys.readouterr().err
    text = Path("scope-problem.json").read_text("utf-8")
    found = json.loads(text)
    assert f"Python {platform.python_version()}" in found.pop("versions")
    assert platform.system() in found.pop("computer")
    assert [secret for secret in SECRETS if secret in json.dumps(found)] == []
    capture = found["capture"]
    assert (capture["frames"], capture["people"], capture["focal_px"]) == (301, 2, 912.5)
    assert capture["execution"] == ["CUDA", "CPU"]
    assert capture["frame_rate"] == [30000, 1001]
    assert (capture["quality"], capture["keypoints"], capture["up"]) == (
        "best",
        "built-in",
        "lines",
    )
    assert capture["per_person"] == [{"valid_frames": 300, "height_m": 1.73, "note": "left out"}]
    assert [each["code"] for each in capture["notices"]] == [
        "cuts",
        "provider_failed",
        "other",
        "no_hands",
    ]
    assert capture["notices"][0]["values"] == {"footage": "left out", "times": [2.0, 4.125]}
    assert capture["notices"][1]["values"]["provider"] == "CUDA"


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such names")
def test_the_name_of_the_file_cannot_forge_a_line(tmp_path, capsys):
    assert main(["report-a-problem", "-o", str(tmp_path / "\x1b[2K\nscope: done.json")]) == 0
    assert capsys.readouterr().err.rstrip("\n").isprintable()


def test_without_a_capture_the_computer_alone_is_described(tmp_path):
    assert main(["report-a-problem", "-o", str(tmp_path / "mine.json")]) == 0
    found = json.loads((tmp_path / "mine.json").read_text("utf-8"))
    assert set(found) == {"versions", "computer", "limits_files"}


@pytest.mark.parametrize(
    "content",
    ["[1]", '{"frames": 3}', "not JSON", "[" * 5000],
    ids=["list", "other", "text", "deep list"],
)
def test_what_is_no_report_is_refused_in_one_sentence_and_nothing_is_written(
    content, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("other.json").write_text(content)
    assert main(["report-a-problem", "other.json"]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["other.json"]


@pytest.mark.parametrize(
    "damaged",
    [
        3,
        [1, "Ann", {"Ann": "Ann"}],
        {"Ann Smith": "Ann"},
        [{"code": ["Ann"]}, {"code": {"Ann": 1}}],
    ],
)
def test_an_edited_report_gives_no_traceback_and_no_name(damaged, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    report = dict.fromkeys(report_of_a_private_clip(), damaged)
    Path("edited.json").write_text(json.dumps(report))
    assert main(["report-a-problem", "edited.json"]) == 0
    assert "Ann" not in Path("scope-problem.json").read_text("utf-8")


def test_the_report_itself_is_never_overwritten(tmp_path, capsys):
    path = tmp_path / "report.json"
    path.write_text(json.dumps(report_of_a_private_clip()))
    before = path.read_bytes()
    assert main(["report-a-problem", str(path), "-o", str(path)]) == 2
    assert path.read_bytes() == before
    assert "is the input itself" in capsys.readouterr().err
