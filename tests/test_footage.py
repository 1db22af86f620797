# SPDX-License-Identifier: GPL-3.0-or-later
"""Footage by its names: sequences of pictures, addresses, and names that are no text."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from scope.scope_addon.footage import (
    display_address,
    display_text,
    is_sequence,
    is_url,
    is_utf8,
    json_text,
    numbered,
    numbered_from,
    pictures_in,
    sequence_pattern,
)


def made(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).write_bytes(b"")
    return folder


def names(pictures: list[Path]) -> list[str]:
    return [picture.name for picture in pictures]


def test_pictures_come_in_natural_order_without_anything_else(tmp_path: Path) -> None:
    made(tmp_path, "f10.png", "f9.png", "f010.PNG", "notes.txt", ".hidden.png", "clip.mp4")
    (tmp_path / "folder.png").mkdir()
    found = names(pictures_in(tmp_path))
    assert found[0] == "f9.png"
    assert sorted(found[1:]) == ["f010.PNG", "f10.png"]


def test_a_sequence_differs_in_the_last_number_only(tmp_path: Path) -> None:
    assert sequence_pattern(Path("take2_v3_0041.PNG")) == "take2_v3_#.png"
    assert is_sequence([Path("a1.png"), Path("a2.png")])
    assert not is_sequence([Path("a1.png")])
    assert not is_sequence([Path("a1.png"), Path("b2.png")])
    assert not is_sequence([Path("a1.png"), Path("a2.jpg")])


def test_a_picture_is_continued_by_those_with_larger_numbers(tmp_path: Path) -> None:
    made(
        tmp_path,
        "a_8.png",
        "a_9.png",
        "a_010.png",
        "a_11.jpg",
        "a_12.png.txt",
        "b_12.png",
        "a_7.png",
        "still.png",
    )
    assert names(numbered_from(tmp_path / "a_8.png")) == ["a_8.png", "a_9.png", "a_010.png"]
    assert names(numbered(tmp_path, "a_", ".png")) == ["a_7.png", "a_8.png", "a_9.png", "a_010.png"]
    assert numbered(tmp_path, "a_", ".png.txt") == []  # no picture
    assert numbered(tmp_path, "a.", ".png") == []  # no pattern
    assert numbered_from(tmp_path / "still.png") == []


def test_addresses_are_told_from_paths() -> None:
    assert [
        is_url(text)
        for text in ("s3://bucket/clips", "https://a/b.mp4", "clips/a.mp4", "C:\\a.mp4", 3, None)
    ] == [True, True, False, False, False, False]


@pytest.mark.skipif(sys.platform != "linux", reason="file names are Unicode on this system")
def test_names_that_are_no_text_can_be_shown() -> None:
    odd = os.fsdecode(b"caf\xe9.mp4")
    assert (is_utf8(odd), is_utf8("café.mp4")) == (False, True)
    assert display_text(odd) == "caf\N{REPLACEMENT CHARACTER}.mp4"
    # As json reads the escape of half a pair, which stands for no byte.
    assert display_text("caf\ud800.mp4") == "caf\N{REPLACEMENT CHARACTER}.mp4"
    assert display_text(Path("café.mp4")) == "café.mp4"
    text = json_text({odd: [odd, "é", 1.5, None]})
    assert text.isascii()
    assert json.loads(text) == {display_text(odd): [display_text(odd), "é", 1.5, None]}


@pytest.mark.skipif(sys.platform != "linux", reason="file names are Unicode on this system")
def test_names_can_be_shown_with_other_text_where_the_system_has_ascii_alone() -> None:
    code = (
        "import os, sys; from scope.scope_addon.footage import json_text\n"
        "name = os.fsdecode(b'\\xc3\\xa9')\n"
        "print(json_text([name, '60\\xb0']), sys.getfilesystemencoding())"
    )
    ascii_alone = dict(os.environ, LC_ALL="C", PYTHONUTF8="0")
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=ascii_alone, timeout=600
    )
    assert ended.stdout == '["\\u00e9", "60\\u00b0"] ascii\n', ended.stderr


@pytest.mark.parametrize(
    "address",
    [
        "rtsp://me:SECRET@camera/x",
        "rtsp://me:SEC@RET@camera/x",
        "rtsp://me:SEC/RET@camera/x",
        "rtsp://me:SEC?RET@camera/x",
        "rtsp://me:SEC#R@E/T@camera/x",
        "rtsp://SECRET@camera/x",
        "rtsp://camera/x?token=SECRET",
        "rtsp://me:SECRET@camera/x?token=SECRET#SECRET",
        "rtsp://camera/x;pw=SECRET",
    ],
)
def test_an_address_is_shown_without_its_secrets(address: str) -> None:
    assert display_address(address) == "rtsp://camera/x"
    shown = display_text(f"{address} cannot be opened ('{address}')")
    assert shown == "rtsp://camera/x cannot be opened ('rtsp://camera/x')"


@pytest.mark.parametrize(
    "text", ["/takes/a@b?c.mp4", "rtsp://camera:554/a@b", "http://[::1]:80/a", "s3://takes/a", ""]
)
def test_other_texts_are_shown_as_they_are(text: str) -> None:
    assert display_address(text) == text
    assert display_text(text) == text


def test_a_name_cannot_end_a_line_move_the_cursor_or_turn_the_text() -> None:
    hostile = "a\nscope: wrote b\r\x1b[2K\x1b]0;c\x07\x7f\x9b2J\u2028\u202e4pm.\u2066\u200f\u061c"
    shown = display_text(hostile)
    assert len(shown) == len(hostile)
    assert shown.isprintable()
    assert shown.replace("\N{REPLACEMENT CHARACTER}", "") == "ascope: wrote b[2K]0;c2J4pm."
    assert display_text("ขา क्षेत्र 👩‍🚀 e\u0301.mp4") == "ขา क्षेत्र 👩‍🚀 e\u0301.mp4"
