# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench WHAT [--quick] [--json FILE]`: measure, print, write. `--help` lists what there
is.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy: everything is measured in one thread

from ..scope_addon.atomic_write import atomic_path  # noqa: E402
from . import frames, report  # noqa: E402
from .solver import clip_comparison, clip_steps, peers, plain, plots, startup, steps  # noqa: E402

OUT = frames.CACHE
ELSEWHERE = {  # imported where they are wanted: some need packages that others do not
    "perception": (".perception.perception", "perception"),
    "ablation": (".ablation", "ablation"),
    "choices": (".perception.choices", "choices"),
    "renders": (".perception.renders", "renders"),
    "scenes": (".scenes.accuracy", "scenes"),
    "stills": (".stills", "stills"),
    "smplify": (".smplify.comparison", "smplify"),
    "outline": (".perception.outline", "outline"),
    "faces": (".perception.face_conditions", "faces_and_conditions"),
    "blender": (".blender", "blender"),
    "cluster": (".cluster", "cluster"),
    "two_people": (".two_people.accuracy", "two_people"),
    "travelling": (".drawn.travelling", "travelling"),
    "views": (".drawn.views", "views"),
    "climbs": (".climbs.accuracy", "climbs"),
    "live": (".live.live", "live"),
}
LIVE_PARTS = ("rate", "offline", "simulated", "world", "hour")


def solver(quick: bool) -> dict[str, Any]:
    """Measure everything about the solver; return the figures and print them as they come."""
    rounds = 20 if quick else 100
    figures: dict[str, Any] = steps.target_table(rounds)
    figures |= startup.startup()
    experiments: dict[str, list[dict[str, float]]] = {}
    for number, terms in ((1, None), (2, None), (3, None), (3, 600)):
        suffix = f"_N{terms}" if terms else ""
        rows = experiments[f"{number}{suffix}"] = steps.experiment(
            number, 5 if quick else 40, terms
        )
        print(report.experiment_lines(number, rows), end="\n\n", flush=True)
        plots.plot_experiment(OUT, number, rows, suffix)
    figures["experiments"] = experiments
    figures["many_joints"] = steps.many_joints(3 if quick else 20)
    print(report.joint_lines(figures["many_joints"]), end="\n\n", flush=True)
    figures["plain"] = plain.against_plain(rounds)
    ratios = [[name, f"{ratio:.2f}"] for name, ratio in figures["plain"].items()]
    print(report.table(("without solver/fast", "times as long"), ratios), end="\n\n", flush=True)
    figures["clip"] = clip_steps.clip_table(3 if quick else 10)
    figures["clip_gradients"] = clip_steps.against_gradients(1 if quick else 5)
    figures["clip_dense"] = clip_comparison.against_dense(3 if quick else 20)
    figures["clip_frames"] = clip_comparison.against_frames(1 if quick else 5)
    figures["clip_outlines"] = clip_comparison.with_outlines(3 if quick else 10)
    for key, title in report.CLIP_TABLES.items():
        print(f"{title}\n\n{report.rows_table(figures[key])}", end="\n\n", flush=True)
    figures |= _real_frames(quick)
    figures["peers"] = {} if quick else peers.run_all()
    print(report.target_lines(figures), end="\n\n")
    if figures["peers"]:
        measured = list(figures["peers"].items())
        print(
            report.table(
                ("one iteration, K=23 P=10 N=120, µs", "measured, or the reason why not"), measured
            ),
            end="\n\n",
        )
    print(f"Plots are in {OUT}")
    return figures


def _real_frames(quick: bool) -> dict[str, Any]:
    """Return cold_frame_ms, warm_frame_ms and the convergence report."""
    names = frames.QUICK_CLIPS if quick else frames.CLIPS
    if not frames.DATA.is_dir():
        print(
            f"{frames.DATA} does not exist: no real frames were measured; put the clips there",
            file=sys.stderr,
        )
        return {"cold_frame_ms": None, "warm_frame_ms": None, "convergence": []}
    clips = frames.load_clips(names)
    rows = []
    figures = {}
    for tolerance in frames.TOLERANCES:
        for kind, outcome in frames.measure(clips, tolerance, every=5 if quick else 1).items():
            rows.append({"kind": kind, "tolerance": tolerance, **outcome.summary()})
            if tolerance == frames.REPORTED:
                figures[f"{kind}_frame_ms"] = rows[-1]["milliseconds"]
    print(report.frame_lines(rows), end="\n\n", flush=True)
    batch = frames.throughput(clips)
    print(
        f"Batch of cold frames: {batch['one_thread']:.0f} per second in one thread, "
        f"{batch['all_cores']:.0f} on "
        f"{batch['cores']} cores, {batch['ratio']:.2f} x",
        end="\n\n",
    )
    return {**figures, "convergence": rows, "batch": batch}


def main() -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(prog="bench")
    parser.add_argument("what", choices=["solver", *ELSEWHERE])
    parser.add_argument(
        "--quick", action="store_true", help="fewer repetitions, the default preset alone"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures as JSON")
    alone = parser.add_argument_group("live alone")
    alone.add_argument(
        "--part",
        action="append",
        choices=LIVE_PARTS,
        help="what to measure; default: rate and offline",
    )
    alone.add_argument(
        "--minutes",
        type=float,
        default=60.0,
        help="of footage for the parts world and hour; default: 60",
    )
    args = parser.parse_args()
    if args.part and args.what != "live":
        parser.error("--part is for live alone")
    if args.what == "solver":
        figures = solver(args.quick)
    else:
        module, function = ELSEWHERE[args.what]
        more = {"parts": args.part or (), "minutes": args.minutes} if args.what == "live" else {}
        figures = getattr(import_module(module, __package__), function)(args.quick, **more)
    if args.json:
        with atomic_path(args.json) as temporary:
            temporary.write_text(json.dumps(figures, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
