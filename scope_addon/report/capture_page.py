# SPDX-License-Identifier: GPL-3.0-or-later
"""The page about one capture, with the figures of each person's motion in the field's units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ..arrays import BoolArray, Float64Array
from ..atomic_write import write_result
from ..capture.media.video_range import FootageRange
from ..capture_report import Report
from ..footage import unicode_text
from ..installed import machine, versions
from ..kinematics.foot_skin import under_floor
from ..kinematics.sequences import runs
from ..motion import Motion
from ..notices import REASONS, Notice, TimeText, counted
from ..review_spans import FAR_SHARE, Span, body_confidence, body_sigma_m, find_review_spans
from . import page
from .page import Markup, Picture, Progress, overlay_pictures
from .plots import Axis, Curve, band_plot, line_plot
from .plots import Span as MarkedSpan
from .viewer_data import shown_rows, viewer_data

CONTACTS = ("left heel", "left toe", "right heel", "right toe")  # the columns of `foot_contact`
_SHORT = {
    "unseen": "not seen",
    "far": "far from the footage",
    "unsure": "low confidence",
    "floor": "under the floor",
    "swing": "limb swings",
    "lean": "leans",
    "floating": "floats",
    "leap": "leaps",
    "spin": "spins",
    "snap": "limb snaps",
    "warned": "warning",
}
_MAX_SPANS = 60  # that the page lists
_GAP_S = 0.25  # between spans that are listed as one
_SPEED_WINDOW_S = 0.5  # over which a speed is measured, so that jitter does not count
_CONTACT = 0.5  # probability from which a heel or toe counts as in contact


@dataclass(frozen=True)
class CapturedClip:
    """What the page is about: the footage, what the capture found in it, and the command that made
    it.
    """

    video: Path
    motions: Sequence[Motion]
    body: Body
    report: Report
    command: str
    wanted: FootageRange | None = None


def write_capture_page(path: Path, clip: CapturedClip, progress: Progress | None = None) -> None:
    """Write the page about a capture. The write is atomic: a failure leaves an earlier file as it
    was.

    :param progress: called with (pictures done, pictures expected).
    :raises OutputError: the file cannot be written.
    :raises VideoError: the footage cannot be read.
    :raises ShapeError: a motion does not have the joints of the body.
    """
    rows = shown_rows(clip.motions)
    pictures = overlay_pictures(clip.video, clip.motions, clip.body, rows, clip.wanted, progress)
    content = unicode_text(capture_page(clip, rows, pictures)).encode()
    write_result(path, content)


def capture_page(
    clip: CapturedClip, rows: NDArray[np.int64], pictures: Sequence[Picture]
) -> Markup:
    """Return the page about a capture.

    :param rows: (n,) rows of the motions that the page shows.
    :param pictures: of the overlay.
    """
    name = Path(clip.video).name
    first = clip.motions[0]
    captions = [
        f"frame {first.frames[rows[p.row]]}, {first.timestamps[rows[p.row]]:.2f} s"
        for p in pictures
    ]
    spans = [_review(motion, clip.body) for motion in clip.motions]
    colors = [page.person_color(n) for n in range(len(clip.motions))]
    warnings = clip.report.warnings
    thinned = (
        ""
        if len(rows) == len(first)
        else f"Of this long clip, one frame in {rows[1]} is shown in 3D."
    )
    now = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M")
    content = [
        page.header(name, f"Motion capture by Scope, {now}", header_facts(clip)),
        page.stage(len(rows), first.image_size.tolist()),
        page.strip(pictures, captions),
        page.section(
            "Over time",
            *over_time(clip.motions, marked_spans(clip.motions, spans, warnings)),
            note=thinned,
        ),
        page.section(
            "Warnings",
            *warning_list(warnings, first.footage_speed),
            review_table(clip.motions, spans),
        ),
        page.section("Figures", figures_table(clip.motions, clip.body)),
        page.section(
            "How it was made",
            page.command_line(clip.command),
            page.fact_list(
                {
                    "Machine": machine(),
                    "Versions": versions(),
                    "Networks on": clip.report.execution,
                },
                single=True,
            ),
        ),
    ]
    return page.document(
        f"{name} – Scope", content, viewer_data(clip.motions, clip.body, rows, colors)
    )


def header_facts(clip: CapturedClip) -> dict[str, str]:
    """Return the facts at the head of the page."""
    report = clip.report
    motion = clip.motions[0]
    rate = motion.mocap_framerate
    # Frames may be missing or unevenly spaced; the last one is shown as long as others.
    duration_s = float(motion.timestamps[-1] - motion.timestamps[0]) + 1.0 / rate
    width, height = motion.image_size.tolist()
    return {
        "Duration": f"{duration_s:.2f} s, {counted(len(motion), 'frame')} at {rate:.6g} per second",
        "Image": f"{width} × {height}",
        "People": counted(report.people, "person", "people"),
        "Preset": report.quality,
        "Body": report.body,
        "Camera": report.camera,
        "Reprojection error": f"{report.reprojection_px:.1f} px",
        "Speed": f"{report.fps['total']:.1f} frames per second",
    }


def over_time(motions: Sequence[Motion], marked: Sequence[MarkedSpan] = ()) -> list[Markup]:
    """Return the plots over time: confidence, reprojection error, contact of the feet, and the face
    if it was captured.

    :param marked: intervals of time that the plots mark; their kinds are keys of ``_SHORT``.
    """
    times = motions[0].timestamps
    x_axis = time_axis(times)
    people = [(m, page.person_color(n), _name(n, motions)) for n, m in enumerate(motions)]
    legend = {name: color for _, color, name in people} if len(people) > 1 else None
    confidence = [
        Curve(times, body_confidence(motion).astype(float), color, name)
        for motion, color, name in people
    ]
    error = [
        Curve(times, np.where(m.has_residual, m.residual_px, np.nan).astype(float), color, name)
        for m, color, name in people
    ]
    far = FAR_SHARE * float(motions[0].image_size.max())
    known = [float(np.nanmax(curve.y)) for curve in error if np.isfinite(curve.y).any()]
    top = 1.1 * max([1.0, *known])
    plots = [
        (
            "Confidence",
            line_plot(confidence, x_axis, Axis(0, 1), label="Confidence over time", spans=marked),
        ),
        (
            "Reprojection error in pixels",
            line_plot(
                error,
                x_axis,
                Axis(0, top),
                label="Reprojection error over time",
                threshold=far,
                spans=marked,
            ),
        ),
    ]
    areas = {
        _SHORT[reason]: f"var(--{reason})" for reason in sorted({span.kind for span in marked})
    }
    figures = [page.plot_figure(title, svg, legend, areas) for title, svg in plots]
    for motion, color, name in people:
        of_whom = f", {name}" if len(people) > 1 else ""
        contacts = motion.foot_contact.T.astype(float)
        bands = {f"Contact of the feet{of_whom}": list(zip(CONTACTS, contacts, strict=True))}
        if motion.face:
            bands[f"Face{of_whom}"] = face_rows(motion)
        for title, rows in bands.items():
            svg = band_plot(rows, times, x_axis, label=title, color=color)
            figures.append(page.plot_figure(title, svg))
    return figures


def face_rows(motion: Motion) -> list[tuple[str, Float64Array]]:
    """Return the shares of a face over time: name and values (T,) from 0 to 1."""
    names = motion.face["expression_names"].tolist()
    weights = motion.face["expressions"].astype(float)
    shown_names = {
        "jaw open": "jawOpen",
        "left eye shut": "eyeBlinkLeft",
        "right eye shut": "eyeBlinkRight",
    }
    rows = [
        (label, weights[:, names.index(name)])
        for label, name in shown_names.items()
        if name in names
    ]
    return [*rows, ("confidence", motion.face["expression_confidence"].astype(float))]


def marked_spans(
    motions: Sequence[Motion], spans: Sequence[Sequence[Span]], warnings: Sequence[Notice]
) -> list[MarkedSpan]:
    """Return what the plots mark: the spans of each motion that should be reviewed, and the times
    in warnings.
    """
    times = motions[0].timestamps
    speed = motions[0].footage_speed
    marked = [_marked(span, times, n, motions) for n, of_one in enumerate(spans) for span in of_one]
    for warning in warnings:
        named = [part.seconds / speed for part in warning.parts() if isinstance(part, TimeText)]
        marked += [
            MarkedSpan(time, time, "warned", str(warning))
            for time in named
            if times[0] <= time <= times[-1]
        ]
    return marked


def time_axis(times: Float64Array) -> Axis:
    """Return the axis of frames at times (T,), in seconds."""
    first = float(times[0])
    last = float(times[-1])
    return Axis(first, last if last > first else first + 1.0, unit="s")


def warning_list(warnings: Sequence[Notice], footage_speed: float = 1.0) -> list[Markup]:
    """Return the warnings as the command line prints them; a time in one moves the page there.

    :param footage_speed: of the motions, whose clock the page has; warnings say times in the
        footage as it plays.
    """
    if not warnings:
        return [Markup('<p class="none">None.</p>\n')]
    items = []
    for warning in warnings:
        parts = [
            page.seek_button(part.text, part.seconds / footage_speed)
            if isinstance(part, TimeText)
            else escape(part)
            for part in warning.parts()
        ]
        items.append(f"<li>{''.join(parts)}</li>")
    return [Markup(f'<ul class="warnings">{"".join(items)}</ul>\n')]


def review_table(motions: Sequence[Motion], spans: Sequence[Sequence[Span]]) -> Markup:
    """Return a table of the frames that should be reviewed; empty if there are none."""
    rows: list[list[str | Markup]] = []
    for n, (motion, of_one) in enumerate(zip(motions, spans, strict=True)):
        for span in of_one:
            first = float(motion.timestamps[span.first])
            last = float(motion.timestamps[span.last])
            frames = f"{motion.frames[span.first]} to {motion.frames[span.last]}"
            rows.append(
                [
                    page.seek_button(f"{first:.2f} to {last:.2f} s", first),
                    frames,
                    REASONS[span.reason],
                ]
            )
            if len(motions) > 1:
                rows[-1].append(_name(n, motions))
    if not rows:
        return Markup("")
    more = len(rows) - _MAX_SPANS
    head = ("Time", "Frames", "To review", *(("Person",) if len(motions) > 1 else ()))
    said = f'<p class="note">and {more} more</p>' if more > 0 else ""
    return Markup(page.table(head, rows[:_MAX_SPANS], markup_columns=(0,)) + said)


def figures_table(motions: Sequence[Motion], body: Body) -> Markup:
    """Return the table of the motions' figures, one column for each person."""
    columns = [motion_figures(motion, body) for motion in motions]
    rows = [[name, *(column[name] for column in columns)] for name in columns[0]]
    return page.table(("", *(_name(n, motions).capitalize() for n in range(len(motions)))), rows)


def _review(motion: Motion, body: Body) -> list[Span]:
    return find_review_spans(motion, _GAP_S, under_floor(motion, body))


def _marked(span: Span, times: Float64Array, person: int, motions: Sequence[Motion]) -> MarkedSpan:
    who = f"{_name(person, motions)}: " if len(motions) > 1 else ""
    return MarkedSpan(
        float(times[span.first]), float(times[span.last]), span.reason, who + REASONS[span.reason]
    )


def _name(person: int, motions: Sequence[Motion]) -> str:
    return f"person {person + 1}" if len(motions) > 1 else "the person"


def motion_figures(motion: Motion, body: Body) -> dict[str, str]:
    """Return what a user may ask about a motion: name of the figure to its value with its unit."""
    seen = motion.valid
    pelvis = motion.trans.astype(float) + body.rest_joints(motion.betas.astype(float))[0]
    steps = np.linalg.norm(np.diff(pelvis[:, :2], axis=0), axis=1)
    is_step = seen[:-1] & seen[1:]  # where nobody was seen, the motion is filled in
    is_step[motion.scene_starts - 1] = False
    error = motion.residual_px[motion.has_residual]
    contact = motion.foot_contact[seen] > _CONTACT
    sigma_m = body_sigma_m([motion])
    review = np.zeros(len(motion), bool)
    for span in find_review_spans(motion, under_floor=under_floor(motion, body)):
        review[span.first : span.last + 1] = True
    return {
        "Frames seen": f"{int(seen.sum())} of {len(motion)}",
        "Height": height_text(body.stature(motion.betas.astype(float)), motion.height_sigma_m),
        "Path over the floor": f"{steps[is_step].sum():.2f} m",
        "Highest speed": f"{highest_speed(pelvis[:, :2], motion.times_with_gaps, seen):.2f} m/s",
        "Pelvis height": f"{pelvis[seen, 2].min():.2f} to {pelvis[seen, 2].max():.2f} m"
        if seen.any()
        else "–",
        "Reprojection error, mean": f"{error.mean():.1f} px" if len(error) else "–",
        "Reprojection error, 95th percentile": f"{np.percentile(error, 95):.1f} px"
        if len(error)
        else "–",
        "Confidence, mean": f"{body_confidence(motion)[seen].mean():.2f}",
        "Standard deviation of joints, median": f"{100 * sigma_m:.1f} cm"
        if np.isfinite(sigma_m)
        else "–",
        "Left foot in contact": f"{100 * contact[:, :2].any(axis=1).mean():.0f} % of frames",
        "Right foot in contact": f"{100 * contact[:, 2:].any(axis=1).mean():.0f} % of frames",
        "Frames to review": f"{int(review.sum())}",
    }


def height_text(height_m: float, sigma_m: float) -> str:
    """Return a stature in centimetres, with its standard deviation where that is known."""
    if not np.isfinite(sigma_m):
        return f"{100 * height_m:.0f} cm"
    digits = 0 if sigma_m >= 0.01 else 1
    return f"{100 * height_m:.{digits}f} ± {100 * sigma_m:.{digits}f} cm"


def highest_speed(points: Float64Array, times: Float64Array, seen: BoolArray) -> float:
    """Return the highest mean speed of points (T, 2) at times (T,) over half a second in which all
    were seen (T,), or over the longest part of less.
    """
    if not seen.any():
        return 0.0
    ends = np.searchsorted(times, times + _SPEED_WINDOW_S - 1e-6)
    is_whole = ends < len(times)
    unseen = np.cumsum(~seen)
    is_whole[is_whole] = unseen[ends[is_whole]] == (unseen - ~seen)[is_whole]
    first = np.flatnonzero(is_whole)
    if not len(first):
        start, end = max(runs(seen), key=lambda run: run[1] - run[0])
        first = np.array([start])
        ends[start] = end - 1
    distance = np.linalg.norm(points[ends[first]] - points[first], axis=1)
    return float((distance / np.maximum(times[ends[first]] - times[first], 1e-9)).max())
