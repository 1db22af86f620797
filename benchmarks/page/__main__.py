# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/report [OPTIONS] [OUT.html]`: run what this machine can run, and write one page about
it.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from ...scope_addon.atomic_write import atomic_path, reason
from ...scope_addon.errors import SetupError, exit_status
from ...scope_addon.installed import machine, versions
from ...scope_addon.motion import Motion
from ...scope_addon.output_paths import check_output
from ...scope_addon.report import page
from ...scope_addon.report.capture_page import figures_table, over_time
from ...scope_addon.report.page import overlay_pictures
from ...scope_addon.report.viewer_data import shown_rows, viewer_data
from ...scope_addon.untrusted.body_file import load_body
from ...solver.body import Body
from ...solver.errors import InputError, ScopeError
from ..frames import ROOT
from .commands import (
    LONG,
    Command,
    Outcome,
    clips,
    commands,
    motion_files,
    run,
    run_capture,
    truth_of,
    worst_clips,
)
from .content import load_text, minutes_text, outcome_section
from .curves import Curves, read_curves
from .failures import KNOWN, KnownFailure, worst_moments
from .recorded import FILE, Run, read_run, set_aside, write_run
from .shots import strips

FOLDER = ROOT / "build" / "report"
INTERRUPTED = 130


def main() -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(prog="report", description="One page about this machine.")
    parser.add_argument(
        "out", nargs="?", type=Path, metavar="OUT.html", default=FOLDER / "report.html"
    )
    parser.add_argument(
        "--quick", action="store_true", help="a few minutes: fewer repetitions, fewer clips"
    )
    parser.add_argument(
        "--resume", action="store_true", help="go on with an interrupted run, quick or not"
    )
    parser.add_argument(
        "--recorded", type=Path, metavar="FOLDER", help="of an earlier run: write its page again"
    )
    parser.add_argument(
        "--curves", type=Path, metavar="CSV", help="digitized speedups of others, drawn beside ours"
    )
    args = parser.parse_args()
    try:
        FOLDER.mkdir(parents=True, exist_ok=True)
        check_output(args.out, (".html",))
        curves = read_curves(args.curves) if args.curves else {}
        folder = args.recorded or FOLDER
        done = read_run(folder) if args.recorded else measure(args.quick, args.resume)
        content = report_page(folder, done, curves)
        with atomic_path(args.out) as temporary:
            temporary.write_text(content, encoding="utf-8")
    except ScopeError as error:
        print(f"report: {error}", file=sys.stderr)
        return exit_status(error)
    except KeyboardInterrupt:
        kept = "--resume goes on, --recorded build/report shows what there is"
        print(
            f"report: interrupted; {kept if (FOLDER / FILE).is_file() else 'nothing is kept yet'}",
            file=sys.stderr,
        )
        return INTERRUPTED
    except OSError as error:
        print(f"report: cannot write {args.out}: {reason(error)}", file=sys.stderr)
        return 1
    print(f"{args.out}: {args.out.stat().st_size / 1e6:.1f} MB")
    return 0


def measure(quick: bool, resume: bool = False) -> Run:
    """Run the commands; return what they gave, which is kept in `FOLDER` too, after each of them.

    :param quick: leave out what takes long.
    :param resume: keep what an interrupted run gave, and run what it lacks, quick or not as it
        began.
    :raises SetupError: the first clip cannot be captured.
    :raises InputError: there is no run to go on with.
    """
    if resume:
        done = read_run(FOLDER)
        note_revision(done.facts)
    else:
        set_aside(FOLDER)  # the first capture removes the motion of its first clip
        done = Run([], [], now(), facts(other_load()), quick)
    for name, video in clips(done.quick):
        if name in [each[0] for each in done.captured]:
            continue
        outcome = run_capture(video, FOLDER / f"{name}.npz", say)
        if not done.captured and outcome.status:
            last = outcome.said.strip().splitlines()[-1:] or ["it said nothing"]
            raise SetupError(
                f"{outcome.command.text} failed ({last[0]}); mend that and run this again"
            )
        done.captured.append((name, video, outcome))
        write_run(FOLDER, done)
    for command in commands(done.quick):
        if command not in [each.command for each in done.measured]:
            done.measured.append(run(command, FOLDER, say))
            write_run(FOLDER, done)
    for name, video, _ in worst_clips(done.measured):
        if name not in [each[0] for each in done.captured]:
            done.captured.append((name, video, run_capture(video, FOLDER / f"{name}.npz", say)))
            write_run(FOLDER, done)
    return done


def note_revision(facts: dict[str, str]) -> None:
    """Add the checkout's commit to the facts of a run that goes on, unless an earlier part of it is
    of this commit.
    """
    by = [each for each in facts.get("Resumed by revision", "").split(", ") if each]
    if revision() not in (facts.get("Revision"), *by):
        facts["Resumed by revision"] = ", ".join([*by, revision()])


def now() -> str:
    """Return the local time, to the minute."""
    return datetime.now().astimezone().strftime("%Y-%m-%d %H:%M")


def report_page(folder: Path, done: Run, curves: Curves) -> str:
    """Return the page of a run.

    :param folder: the run's, with the motion files of its clips.
    :param curves: digitized speedups of others.
    :raises InputError: the motion of the run's first clip is not there.
    """
    shown = motions_of(folder, done.captured[0][0])[:1] if done.captured else []
    if not shown:
        raise InputError(
            f"{folder} holds no motion of its first clip; run ./scripts/report again, "
            "without --resume"
        )
    body = load_body("scope")
    (motion,) = shown
    video = done.captured[0][1]
    rows = shown_rows([motion])
    pictures = overlay_pictures(video, [motion], body, rows)
    captions = [
        f"frame {motion.frames[rows[p.row]]}, {motion.timestamps[rows[p.row]]:.2f} s"
        for p in pictures
    ]
    why = {name: text for name, _, text in worst_clips(done.measured)}
    minutes = sum(outcome.seconds for outcome in done.everything) / 60
    lacking = ", ".join(command.text for command in left_out(done))
    note = f"Left out of this run: {lacking}." if lacking else ""
    content = [
        page.header(
            "Scope on this machine",
            done.time,
            done.facts | {"Measured in": f"{minutes:.0f} minutes"},
        ),
        page.stage(len(rows), motion.image_size.tolist()),
        page.strip(pictures, captions),
        page.section("The capture above", *over_time([motion]), figures_table([motion], body)),
        *(capture_section(folder, *each, body, why.get(each[0], "")) for each in done.captured),
        *(outcome_section(each, curves) for each in done.measured),
        page.section("Commands and their costs", *costs(done.everything), note=note),
    ]
    return page.document(
        "Scope on this machine", content, viewer_data([motion], body, rows, [page.person_color(0)])
    )


def costs(outcomes: Sequence[Outcome]) -> list[page.Markup]:
    """Return the table of what each command cost, with the sum, and how to read it."""
    rows: list[list[str | page.Markup]] = [
        [
            page.command_text(each.command.text),
            minutes_text(each.seconds),
            minutes_text(each.processor_seconds),
            load_text(each.load),
        ]
        for each in outcomes
    ]
    known = [each.processor_seconds for each in outcomes if each.processor_seconds is not None]
    # A sum of some, beside the elapsed time of all, would mislead.
    spent = sum(known) if len(known) == len(outcomes) else None
    rows.append(
        ["all", minutes_text(sum(each.seconds for each in outcomes)), minutes_text(spent), ""]
    )
    head = ("command", "elapsed, min:s", "processor time, min:s", "load, mean")
    note = (
        "Processor time is that of all threads and of all processes that a command started; on a "
        "busy machine, elapsed "
        "times are longer than on an idle one, processor time hardly. The load is the mean number "
        "of processes that "
        "ran or waited for a core, the command's own included. Clips that were rendered before are "
        "used again; "
        "rendering them is not included."
    )
    return [page.table(head, rows, markup_columns=(0,), numbers=True), page.paragraph(note)]


def left_out(done: Run) -> list[Command]:
    """Return the commands that a run has not measured, of its own and of those that a whole one
    has.
    """
    measured = [outcome.command for outcome in done.measured]
    return [each for each in dict.fromkeys([*commands(done.quick), *LONG]) if each not in measured]


def other_load() -> str:
    """Describe how busy the machine is with other work: its times then are not those of an idle
    one.
    """
    if not hasattr(os, "getloadavg"):
        return "not known on this system"
    return (
        f"{os.getloadavg()[0]:.1f} processes on {os.cpu_count()} cores; more than a tenth of a "
        f"core distorts times"
    )


def facts(load: str) -> dict[str, str]:
    """Return the facts at the head of the page.

    :param load: of the machine before the first command.
    """
    return {
        "Machine": machine(),
        "Versions": versions(),
        "Revision": revision(),
        "Load before": load,
    }


def revision() -> str:
    """Return the checkout's commit, and whether files differ from it."""
    command = ("git", "describe", "--always", "--dirty")
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "not a checkout"


def motions_of(folder: Path, name: str) -> list[Motion]:
    """Return the people of a captured clip, the most prominent first."""
    return [Motion.load(path) for path in motion_files(folder, name)]


def capture_section(
    folder: Path, name: str, video: Path, outcome: Outcome, body: Body, why: str = ""
) -> page.Markup:
    """Return the section of a captured clip: figures, strips of footage, overlay and side view, and
    its failures.

    Of a clip that could not be captured, it says what the capture said.

    :param why: it is shown, in a sentence.
    """
    if outcome.status:
        said = outcome.said.strip().splitlines()[-1:] or ["It said nothing."]
        note = f"{why} The capture ended with status {outcome.status}.".strip()
        return page.section(
            f"Clip {name}",
            page.command_line(outcome.command.text),
            page.paragraph(said[0]),
            note=note,
        )
    motions = motions_of(folder, name)
    report = outcome.figures
    truth = truth_of(video)
    shown = {
        "People": str(len(motions)),
        "Frames": f"{report['frames']} at {report['frame_rate'][0] / report['frame_rate'][1]:.6g} "
        "per second",
        "Preset": report["quality"],
        "Camera": report["camera"],
        "Reprojection error": f"{report['reprojection_px']:.1f} px",
        "Speed": f"{report['fps']['total']:.1f} frames per second, networks on "
        f"{report['execution']}, mean load "
        f"{load_text(outcome.load)}",
    }
    return page.section(
        f"Clip {name}",
        page.command_line(outcome.command.text),
        page.fact_list(shown),
        strips(video, motions, body),
        *([worst_moments(motions[0], truth, body)] if truth else []),
        *(known_failure(video, motions, body, KNOWN[name]) if name in KNOWN else []),
        *([page.list_of(report["warnings"])] if report["warnings"] else []),
        note=f"{why} Footage, overlay, and the same frames seen from the side; people who were not "
        "seen are faint.",
    )


def known_failure(
    video: Path, motions: Sequence[Motion], body: Body, failure: KnownFailure
) -> list[page.Markup]:
    """Return what is wrong in a part of a clip, and the strips of it."""
    return [
        page.paragraph(failure.what),
        strips(video, motions, body, failure.first_s, failure.last_s),
    ]


def say(text: str) -> None:
    """Print a message."""
    print(f"report: {text}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
