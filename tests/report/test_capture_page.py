# SPDX-License-Identifier: GPL-3.0-or-later
"""The page about a capture as a browser's parser sees it: well-formed, escaped, small, and without
any request.
"""

from __future__ import annotations

import json
import os
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture_report import Report
from scope.scope_addon.errors import OutputError, VideoError
from scope.scope_addon.notices import OTHER, notice
from scope.scope_addon.report.capture_page import (
    CapturedClip,
    capture_page,
    face_rows,
    header_facts,
    over_time,
    warning_list,
    write_capture_page,
)
from scope.scope_addon.report.page import small_picture

from ..made_motion import made_face, made_motion

VOID = {"meta", "link", "img", "input", "br"}
HOSTILE = "<img src=x onerror=alert(1)>&\"'</script><!--.mp4"
W = 96
H = 64
FRAMES = 9


class Page(HTMLParser):
    """Every element with its attributes and text; fails on elements that are not closed in
    order.
    """

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self._open: list[str] = []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        if self._open:
            self.texts.setdefault(self._open[-1], []).append(data)


def report(people: int = 1, **given) -> Report:
    found = {
        "people": people,
        "quality": "best",
        "body": "scope",
        "camera": "estimated",
        "execution": "CPU, 2 threads",
    }
    rates = {"frame_rate": [30, 1], "fps": {"total": 12.3}, "reprojection_px": 2.5, "warnings": []}
    return Report(**{**found, **rates, **given})


def clip(body, video: Path, people: int = 1, **given) -> CapturedClip:
    trans = np.tile([0.0, 0, 0.95] - body.rest_joints()[0], (FRAMES, 1))
    valid = np.arange(FRAMES) != 4
    motion = made_motion(
        body, np.zeros((FRAMES, 3 * (body.K + 1))), trans, valid=valid, image_size=np.array([W, H])
    )
    return CapturedClip(
        video, [motion] * people, body, report(people, **given), f"scope capture '{HOSTILE}'"
    )


@pytest.fixture
def footage(tmp_path) -> Path:
    path = tmp_path / "footage.mp4"
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"mp4v"), 30, (W, H))
    for _ in range(FRAMES):
        writer.write(np.full((H, W, 3), 90, np.uint8))
    writer.release()
    return path


def test_the_page_is_well_formed_and_all_that_users_name_is_text(body):
    warnings = [
        notice("cuts", footage=HOSTILE, times=[0.1, 0.2]),
        notice(OTHER, text="javascript:alert(1)"),
    ]
    pictures = [small_picture(row, np.zeros((H, W, 3), np.uint8)) for row in (0, 8)]
    about = clip(body, Path(HOSTILE.replace("/", "")), 7, warnings=warnings, camera=HOSTILE)
    text = capture_page(about, np.arange(FRAMES), pictures)
    page = Page(text)
    assert page.texts["h1"] == [HOSTILE.replace("/", "")]
    assert "".join(page.texts["code"]) == about.command
    assert HOSTILE in page.texts["dd"]
    assert "javascript:alert(1)" in page.texts["li"]
    assert page.texts["li"][0] == f"{HOSTILE} cuts to another scene "
    tags = [tag for tag, _ in page.elements]
    assert tags.count("img") == 3
    assert tags.count("script") == 5
    assert not [
        name for _, attributes in page.elements for name in attributes if name.startswith("on")
    ]
    assert len(text) < 2_000_000
    # It requests nothing.
    named = [
        a[name]
        for _, a in page.elements
        for name in ("src", "href", "srcset", "action", "data")
        if name in a
    ]
    assert named
    assert all(value.startswith("data:") for value in named)
    policy = next(
        a["content"] for _, a in page.elements if a.get("http-equiv") == "Content-Security-Policy"
    )
    assert policy.startswith("default-src 'none';")
    assert "http" not in policy
    assert not re.search(
        r"(https?:)?//\w|@import|url\(|fetch\(|XMLHttpRequest|import\(", text.split('id="data"')[0]
    )


def test_the_view_has_its_data_and_frames_without_the_person_are_listed_and_marked(body):
    text = capture_page(clip(body, Path("a.mp4")), np.arange(FRAMES), [])
    data = text.split('id="data">')[1].split("</script>")[0]
    assert "<" not in data  # which could end the element
    assert len(json.loads(data)["people"]) == 1
    assert "not visible: the pose is filled in" in text
    mark = re.search(r'<rect class="span unseen" x="([\d.]+)"', text)
    assert mark is not None
    assert float(mark[1]) == pytest.approx(500)  # the fifth of nine frames


def test_times_in_warnings_lead_to_their_frames_and_the_text_stays_as_printed():
    said = notice("cuts", footage="a.mp4", times=[2.0, 4.1])
    page = Page("".join(warning_list([said])))
    assert [a["data-time"] for tag, a in page.elements if tag == "button"] == ["2.0000", "4.1000"]
    assert (
        "".join(page.texts["li"][:1] + page.texts["button"][:1])
        == "a.mp4 cuts to another scene at 2.0 s"
    )
    assert "".join(re.sub("<[^>]*>", "", "".join(warning_list([said])))).strip() == str(said)


def test_warnings_of_slow_motion_lead_to_the_frames_that_they_mean(body):
    """Played four times as slowly as it was recorded, frame 8 is at 8/30 s, and the motion has it
    at 2/30 s; the marks were on the clock of the footage.
    """
    about = clip(body, Path("a.mp4"))
    (motion,) = about.motions
    slow = replace(motion, timestamps=motion.timestamps / 4, footage_speed=4.0)
    warning = notice("cuts", footage="a.mp4", times=[0.2, 9.0])  # the clip ends at 8/30 s
    said = report(warnings=[warning])
    text = capture_page(replace(about, motions=[slow], report=said), np.arange(FRAMES), [])
    marks = re.findall(r'<rect class="span warned" x="([\d.]+)" [^>]*><title>([^<]*)<', text)
    # the sixth of eight steps, in both plots of lines
    assert marks == [("750.0", str(warning))] * 2
    buttons = [a for tag, a in Page(text).elements if tag == "button" and "data-time" in a]
    assert buttons[0]["data-time"] == "0.0500"
    assert "at 0.2 s" in text  # as the footage plays


@pytest.mark.parametrize(
    ("times_s", "rate", "speed", "shown"),
    [
        # every second picture of a sequence is missing
        (np.arange(FRAMES) / 15, 30.0, 1.0, "0.57 s, 9 frames at 30 per second"),
        # recorded twice as fast as it plays, at 30 frames per second, from its tenth second on
        (10.0 + np.arange(FRAMES) / 60, 60.0, 2.0, "0.15 s, 9 frames at 60 per second"),
    ],
)
def test_the_duration_is_that_in_which_the_motion_happened(body, times_s, rate, speed, shown):
    about = clip(body, Path("a.mp4"))
    (motion,) = about.motions
    timed = replace(motion, timestamps=times_s, mocap_framerate=rate, footage_speed=speed)
    assert header_facts(replace(about, motions=[timed]))["Duration"] == shown


def test_the_written_page_has_the_overlay_of_the_footage(body, footage, tmp_path):
    out = tmp_path / "out.html"
    done = []
    write_capture_page(out, clip(body, footage), lambda i, n: done.append((i, n)))
    page = Page(out.read_text("utf-8"))
    assert sum(a.get("src", "").startswith("data:image/webp") for _, a in page.elements) == FRAMES
    assert done[-1] == (FRAMES, FRAMES)
    assert [t for t in page.texts["span"] if t.startswith("frame 8")]


def test_a_page_that_cannot_be_written_leaves_the_earlier_one(body, footage, tmp_path, monkeypatch):
    out = tmp_path / "out.html"
    out.write_text("earlier")
    with pytest.raises(VideoError):
        write_capture_page(out, clip(body, tmp_path / "lost.mp4"))

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OutputError, match="No space left"):
        write_capture_page(out, clip(body, footage))
    assert out.read_text("utf-8") == "earlier"
    assert sorted(os.listdir(tmp_path)) == ["footage.mp4", "out.html"]


def test_a_captured_face_is_shown_over_time(body):
    about = clip(body, Path("talk.mp4"))
    without = over_time(about.motions)
    (motion,) = about.motions
    blink = (np.arange(FRAMES) == 3).astype(float)
    talking = replace(motion, face=made_face(FRAMES, jawOpen=0.25, eyeBlinkLeft=blink))
    assert [name for name, _ in face_rows(talking)] == [
        "jaw open",
        "left eye shut",
        "right eye shut",
        "confidence",
    ]
    for (_, values), expected in zip(face_rows(talking), (0.25, blink, 0.0, 1.0), strict=True):
        np.testing.assert_allclose(values, np.broadcast_to(expected, FRAMES))
    figures = over_time([talking])
    assert len(figures) == len(without) + 1
    assert "left eye shut" in figures[-1]
