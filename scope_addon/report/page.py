# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of a self-contained HTML page: document, sections, tables, the stage with overlay and
3D view, and a few frames of the overlay as small pictures of bounded size.

Every text that is passed in is escaped here. Content that is markup already has the type `Markup`.
The page's policy forbids every request to a network, so that it cannot come to need one.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any, NewType

import cv2
import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ..arrays import Uint8Array
from ..capture.fitting.outline import spread
from ..capture.media.video_range import FootageRange
from ..capture.overlay_video import painted_frames
from ..errors import OutputError
from ..footage_view import scaled_size
from ..motion import Motion

Markup = NewType("Markup", str)

PEOPLE_COLORS = 5  # as many as the overlay's tints
_FILES = Path(__file__).with_name("static")
_SCRIPTS = ("motion.js", "webgl.js", "viewer.js", "page.js")  # in this order
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
PICTURES = 40
LONGEST_SIDE = 800
MAX_BYTES = 5_000_000  # of all pictures of a page
_QUALITY = 74  # of WebP

Progress = Callable[[int, int], None]


def person_color(person: int) -> str:
    """Return the CSS colour of the person with this index, that of the overlay's tint."""
    return f"var(--person{person % PEOPLE_COLORS + 1})"


def document(title: str, content: Sequence[Markup], data: Mapping[str, Any]) -> Markup:
    """Return a whole page.

    :param data: for the 3D view, see `viewer_data`.
    """
    # "<" could end the element; in JSON it can only be inside a string.
    text = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    scripts = f'<script type="application/json" id="data">{text}</script>\n'
    scripts += "".join(f"<script>\n{_file(name)}</script>\n" for name in _SCRIPTS)
    return Markup(
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f'<title>{escape(title)}</title>\n<link rel="icon" '
        f'href="data:,">\n<style>\n{_file("style.css")}</style>\n'
        f"</head>\n<body>\n<main>\n{''.join(content)}</main>\n{scripts}</body>\n</html>\n"
    )


def header(title: str, subtitle: str, facts: Mapping[str, str]) -> Markup:
    """Return the page's header: its title, a line below it, and a list of facts."""
    return Markup(
        f"<header><h1>{escape(title)}</h1><p "
        f'class="subtitle">{escape(subtitle)}</p>{fact_list(facts)}</header>\n'
    )


def fact_list(facts: Mapping[str, str], single: bool = False) -> Markup:
    """Return names and values as a list of definitions; with ``single``, in one column."""
    items = "".join(
        f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>"
        for name, value in facts.items()
    )
    return Markup(f'<dl class="facts{" single" if single else ""}">{items}</dl>')


def section(title: str, *content: Markup, note: str = "") -> Markup:
    """Return a section with a heading, and a note below it."""
    said = f'<p class="note">{escape(note)}</p>' if note else ""
    return Markup(f"<section><h2>{escape(title)}</h2>{said}{''.join(content)}</section>\n")


def table(
    head: Sequence[str],
    rows: Sequence[Sequence[str | Markup]],
    markup_columns: Sequence[int] = (),
    numbers: bool = False,
) -> Markup:
    """Return a table, the first cell of each row its heading.

    :param markup_columns: columns whose cells are markup already.
    :param numbers: whether all columns but the first hold numbers, which are written to the right.
    """
    lines = ["<tr>" + "".join(f'<th scope="col">{escape(cell)}</th>' for cell in head) + "</tr>"]
    for row in rows:
        cells = [cell if n in markup_columns else escape(cell) for n, cell in enumerate(row)]
        first = f'<th scope="row">{cells[0]}</th>'
        lines.append(f"<tr>{first}{''.join(f'<td>{cell}</td>' for cell in cells[1:])}</tr>")
    kind = ' class="numbers"' if numbers else ""
    below = "".join(lines[1:])
    return Markup(
        f'<div class="wide">'
        f"<table{kind}><thead>{lines[0]}</thead><tbody>{below}</tbody></table>"
        "</div>"
    )


def folded(title: str, *content: Markup) -> Markup:
    """Return content that is hidden until its title is clicked."""
    return Markup(f"<details><summary>{escape(title)}</summary>{''.join(content)}</details>\n")


def plot_figure(
    title: str,
    svg: str,
    legend: Mapping[str, str] | None = None,
    areas: Mapping[str, str] | None = None,
) -> Markup:
    """Return a plot with its title and the legend of its curves and its marked areas, colour in CSS
    by name.
    """
    entries = "".join(
        f'<span class="key{kind}"><i style="background:{color}"></i>{escape(name)}</span>'
        for kind, names in (("", legend), (" area", areas))
        for name, color in (names or {}).items()
    )
    return Markup(
        f'<figure class="graph"><figcaption>{escape(title)}{entries}</figcaption>{svg}</figure>\n'
    )


def paragraph(text: str) -> Markup:
    """Return a text as a note."""
    return Markup(f'<p class="note">{escape(text)}</p>\n')


def list_of(texts: Sequence[str]) -> Markup:
    """Return texts, such as warnings, as a list."""
    items = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return Markup(f'<ul class="warnings">{items}</ul>\n')


def command_line(command: str) -> Markup:
    """Return a command as a block of code."""
    return Markup(f"<pre><code>{command_text(command)}</code></pre>\n")


def command_text(command: str) -> Markup:
    """Return a command whose lines do not end within an option, such as between the hyphens of
    ``--json``.
    """
    words = [escape(word) for word in command.split(" ")]
    return Markup(
        " ".join(
            f'<span class="option">{word}</span>' if word[:1] == "-" else word for word in words
        )
    )


def seek_button(text: str, time_s: float) -> Markup:
    """Return a button that moves the page to a time."""
    return Markup(
        f'<button type="button" class="seek" data-time="{time_s:.4f}">{escape(text)}</button>'
    )


def strip(pictures: Sequence[Picture], captions: Sequence[str]) -> Markup:
    """Return pictures in one row that can be scrolled; each moves the page to its frame."""
    items = "".join(
        f'<button type="button" data-row="{picture.row}"><img src="{picture.url}" '
        f'width="{picture.width}" '
        f'height="{picture.height}" alt="{escape(caption)}"><span>{escape(caption)}</span></button>'
        for picture, caption in zip(pictures, captions, strict=True)
    )
    return Markup(f'<div class="strip" id="strip">{items}</div>\n')


def stage(count: int, image_size: Sequence[int]) -> Markup:
    """Return the overlay's picture beside the 3D view, and the player that moves both.

    :param count: of frames.
    :param image_size: width and height of the footage.
    """
    aspect = min(max(image_size[0] / image_size[1], 1.0), 2.0)
    picture = (
        '<figure class="pane"><figcaption>Overlay <span id="picture-frame"></span></figcaption>'
        '<div class="frame"><img id="picture" alt="The captured body over the '
        'footage"></div></figure>'
    )
    return Markup(
        f'<section class="stage" style="--aspect: {aspect:.4f}">{picture}'
        '<figure class="pane"><figcaption>3D view <span id="pose-state"></span></figcaption>'
        '<div class="frame"><canvas id="view" tabindex="0" aria-label="The captured motion in '
        '3D"></canvas>'
        '<p id="no-view" hidden>This browser does not offer WebGL 2, so the 3D view is left out; '
        "everything else "
        "works without it.</p></div>"
        '<div class="views"><button type="button" data-view="front" '
        'aria-pressed="true">Front</button>'
        '<button type="button" data-view="side">Side</button><button type="button" '
        'data-view="top">Top</button>'
        '<button type="button" data-view="camera">Camera</button>'
        '<label><input type="checkbox" id="follow">Follow</label>'
        '<span class="hint">Drag to orbit, two fingers or Shift to pan, wheel or pinch to '
        "zoom</span></div></figure>"
        "</section>\n"
        '<div class="player"><button type="button" id="play" aria-label="Play">▶</button>'
        f'<input type="range" id="row" min="0" max="{max(count - 1, 0)}" value="0" step="1" '
        'aria-label="Frame">'
        '<output id="time"></output>'
        '<select id="speed" aria-label="Speed"><option value="0.25">¼ ×</option><option '
        'value="0.5">½ ×</option>'
        '<option value="1" selected>1 ×</option></select></div>\n'
        "<noscript><p>Without JavaScript, the 3D view cannot be shown and the page cannot be "
        "played.</p></noscript>\n"
    )


def _file(name: str) -> str:
    return (_FILES / name).read_text(encoding="utf-8")


@dataclass(frozen=True)
class Picture:
    """A picture of one of the rows that the page shows: a WebP file."""

    row: int
    content: bytes
    width: int
    height: int

    @property
    def url(self) -> str:
        """Its content as a data URL."""
        return f"data:image/webp;base64,{base64.b64encode(self.content).decode('ascii')}"


def overlay_pictures(
    video: Path,
    motions: Sequence[Motion],
    body: Body,
    rows: NDArray[np.int64],
    wanted: FootageRange | None = None,
    progress: Progress | None = None,
) -> list[Picture]:
    """Return at most `PICTURES` frames of the overlay, in chronological order, of at most
    `MAX_BYTES` together.

    :param rows: (n,) rows of the motions that the page shows.
    :param wanted: the range of the footage that was captured.
    :param progress: called with (pictures done, pictures expected).
    :raises VideoError: the footage cannot be read.
    :raises ShapeError: a motion does not have the joints of the body.
    :raises OutputError: OpenCV cannot write WebP.
    """
    chosen = spread(np.arange(len(rows)), PICTURES)
    row_of = dict(zip(motions[0].frames[rows[chosen]].tolist(), chosen.tolist(), strict=True))
    pictures = []
    for index, image in painted_frames(video, motions, body, list(row_of), wanted=wanted):
        pictures.append(small_picture(row_of[index], image))
        if progress is not None:
            progress(len(pictures), len(chosen))
    return bounded(pictures, MAX_BYTES)


def small_picture(row: int, image: Uint8Array, longest_side: int = LONGEST_SIDE) -> Picture:
    """Return an RGB image, (H, W, 3) uint8, as a WebP picture of at most ``longest_side`` pixels.

    :raises OutputError: OpenCV cannot write WebP.
    """
    height, width = image.shape[:2]
    scale, size = scaled_size(width, height, min(longest_side, max(width, height)))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA) if scale < 1 else image
    ok, data = cv2.imencode(
        ".webp", cv2.cvtColor(small, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_WEBP_QUALITY, _QUALITY]
    )
    if not ok:
        raise OutputError(
            "cannot make the report's images: this OpenCV cannot write WebP; install another"
        )
    return Picture(row, data.tobytes(), *size)


def bounded(pictures: list[Picture], most_bytes: int) -> list[Picture]:
    """Return the pictures, or every second, fourth, ... of them, so that all together are at most
    ``most_bytes``.
    """
    while len(pictures) > 1 and sum(len(picture.content) for picture in pictures) > most_bytes:
        pictures = pictures[::2]
    return pictures
