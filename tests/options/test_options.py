# SPDX-License-Identifier: GPL-3.0-or-later
"""One declaration of every option: command line, worker and pipeline agree on names, defaults,
choices and ranges.
"""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys

import pytest
from scope.scope_addon import options as declarations
from scope.scope_addon.capture.options import (
    CaptureOptions,
    capture_options,
    check_options,
    parse_offsets,
)
from scope.scope_addon.capture.perception.sessions import CHOICES, LANDMARK_NETWORK_OF_QUALITY
from scope.scope_addon.cli import build_parser, main
from scope.scope_addon.command_line.arguments import (
    non_default_arguments,
    option_values,
)
from scope.scope_addon.errors import UsageError
from scope.scope_addon.job.request import JobRequest
from scope.scope_addon.options import OPTIONS, Argument, Option, Place, option, options_at
from scope.scope_addon.options.capture import AUTO, OFF, ON
from scope.scope_addon.retarget.rig_source import ROOTS
from scope.solver.body_file import load_body

# Listed again on purpose, because users' scripts rely on the flags.
FLAGS = """
--quality --people --person --start --end --rotate --mirror --crop --fps --speed --body --hands
--face --height --focal-mm --fov --calibration --offset --camera-path
--no-smoothing
--uneven-ground --treadmill --belt-speed
--shape-keys --bvh-unit --skeleton --deform-bones --file-per-person --retarget --rig-object
--bone-map --expression-map
--retarget-root --detector --keypoints --provider --threads --json --quiet
""".split()
EXTRA = Option(
    "stride",
    int,
    1,
    Place.COMMAND_LINE | Place.WORKER,
    "capture every Nth frame",
    minimum=1,
    argument=Argument(metavar="N"),
)


@pytest.fixture(scope="module")
def body():
    return load_body("scope")


def parsed(*argv):
    return build_parser().parse_args(["capture", *argv])


def test_the_flags_do_not_change(capsys):
    assert [each.flag for each in options_at(Place.COMMAND_LINE)] == FLAGS
    assert len({each.name for each in OPTIONS}) == len(OPTIONS)
    with pytest.raises(SystemExit):
        parsed("--help")
    shown = capsys.readouterr().out.split()
    assert set(FLAGS) <= set(shown)
    assert all(each.help for each in OPTIONS)


def test_defaults_are_of_the_declared_type():
    for each in options_at(Place.WORKER):
        assert each.type_error(each.default) == "", each.name
        assert each.range_error(each.default) == "", each.name


def test_command_line_and_worker_have_the_same_defaults():
    values = option_values(parsed())
    request = JobRequest("walk.mp4").values
    assert set(request) == {each.name for each in options_at(Place.WORKER)}
    assert {name: values[name] for name in request} == request
    assert capture_options(values) == capture_options(request) == CaptureOptions()


def test_the_typed_fields_of_the_pipeline_are_the_declared_options():
    fields = {field.name for field in dataclasses.fields(CaptureOptions)}
    # wanted: start, end, fps, rotate and mirror; part: crop; chosen: person; offsets_s: offset;
    # known_calibration: of one of several cameras; window_s: of long clips, which the parts of one
    # on several machines have in common
    others = {"wanted", "part", "chosen", "known_calibration", "offsets_s", "window_s"}
    assert fields == {each.name for each in options_at(Place.CAPTURE)} | others
    for each in options_at(Place.CAPTURE | Place.WORKER):
        assert getattr(CaptureOptions(), each.name) == each.default


def test_the_choices_are_those_of_the_code_behind_them():
    assert set(option("quality").values) == set(LANDMARK_NETWORK_OF_QUALITY)
    assert set(option("provider").values) == set(CHOICES)
    assert set(option("hands").values) == {OFF, AUTO, ON}
    assert option("retarget_root").values == ROOTS


@pytest.mark.parametrize(
    ("name", "step"), [("focal_mm", 0.01), ("fov_deg", 0.01), ("threads", 1), ("people", 1)]
)
def test_the_declared_range_is_what_the_capture_accepts(body, name, step):
    declared = option(name)
    for limit, outside in ((declared.minimum, -step), (declared.maximum, step)):
        if limit is None:
            continue
        check_options(body, CaptureOptions(**{name: limit}))
        with pytest.raises(UsageError):
            check_options(body, CaptureOptions(**{name: limit + outside}))


def test_heights_of_more_people_than_can_be_are_refused(capsys):
    assert main(["capture", "--height", ",".join(["170"] * 101)]) == 2
    assert "must give at most 100 heights, not 101" in capsys.readouterr().err


def test_a_request_gives_the_same_options_as_the_command_line(tmp_path):
    argv = ["--people", "all", "--start", "00:01", "--height", "175,162", "--hands"]
    argv += ["--no-smoothing", "--fps", "12", "--fov", "60", "--threads", "2"]
    argv += ["--detector", str(tmp_path / "a.onnx"), "--calibration", str(tmp_path / "lens.json")]
    request = JobRequest(
        "walk.mp4",
        people="all",
        start="1",
        heights_m=[1.75, 1.62],
        fps="12",
        fov_deg=60.0,
        threads=2,
        hands="on",
        smoothing=False,
        detector=str(tmp_path / "a.onnx"),
        calibration=str(tmp_path / "lens.json"),
    )
    travelled = JobRequest.from_json(request.to_json())
    options = capture_options(option_values(parsed(*argv)))
    assert capture_options(travelled.values) == options
    assert (options.people, options.wanted.start_s, options.wanted.fps) == ("all", 1.0, 12)
    assert (options.fov_deg, options.smoothing, options.focal_mm) == (60.0, False, None)


@pytest.mark.parametrize(
    ("argv", "hands", "video"),
    [
        ([], "off", None),
        (["--hands"], "on", None),
        (["--hands", "walk.mp4"], "on", "walk.mp4"),
        (["--hands", "off", "walk.mp4"], "off", "walk.mp4"),
        (["--hands=auto", "walk.mp4"], "auto", "walk.mp4"),
        (["--hands", "--", "auto"], "on", "auto"),
    ],
)
def test_the_flag_of_hands_may_come_without_a_value(argv, hands, video):
    args = parsed(*argv)
    assert (args.hands, args.video and str(args.video)) == (hands, video)


@pytest.mark.parametrize("flag", ["--hand", "--qual"])
def test_flags_are_not_abbreviated(flag):
    """An abbreviated --hands would take the footage for its value."""
    with pytest.raises(UsageError, match=f"unrecognized arguments: {flag}"):
        parsed(flag, "walk.mp4")


def test_a_batch_passes_on_only_arguments_that_were_given():
    argv = ["batch", ".", "--out", ".", "--jobs", "2", "--json", "--quiet", "--no-smoothing"]
    argv += ["--people", "all", "--height", "175,162", "--quality", "best"]  # which is the default
    given = non_default_arguments(build_parser().parse_args(argv))
    assert given == {"--no-smoothing": None, "--people": "all", "--height": "175,162"}


def test_a_new_option_needs_only_its_record(monkeypatch, capsys):
    monkeypatch.setattr(declarations, "OPTIONS", (*OPTIONS, EXTRA))
    args = parsed("--stride", "3")
    assert option_values(args)["stride"] == 3
    assert non_default_arguments(args) == {"--stride": "3"}
    with pytest.raises(SystemExit):
        parsed("--help")
    assert "capture every Nth frame (default: 1)" in " ".join(capsys.readouterr().out.split())
    request = JobRequest("walk.mp4", stride=3)
    assert json.loads(request.to_json())["stride"] == 3
    assert JobRequest.from_json(request.to_json()).values == request.values
    assert JobRequest("walk.mp4").values["stride"] == 1
    with pytest.raises(UsageError, match="stride must be int, not 'x'"):
        JobRequest("walk.mp4", stride="x")
    assert EXTRA.range_error(0) == "must be at least 1, not 0"


def test_enumerations_number_every_choice_once():
    """Files may hold the number of a choice that was removed, so no other one gets it."""
    for each in OPTIONS:
        for choices in (each.choices, each.blender.choices):
            numbers = [choice.number for choice in choices]
            assert numbers == sorted(set(numbers)), each.name


def test_the_declarations_load_nothing_but_the_standard_library():
    code = (
        "import importlib.util, sys\n"
        "before = set(sys.modules)\n"
        "import scope.scope_addon.options\n"
        "loaded = {n.split('.')[0] for n in set(sys.modules) - before} - "
        "set(sys.stdlib_module_names)\n"
        "print(sorted(loaded))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd="/"
    )
    assert done.stdout.strip() == "['scope']"


def test_offsets_are_seconds_or_auto():
    assert parse_offsets("1.25") == (1.25,)
    assert parse_offsets("-0.5, auto,+2") == (-0.5, None, 2.0)
    for text in ("1,", "x", "1;2", "nan", "1e3"):
        with pytest.raises(UsageError, match="is not a list of offsets"):
            parse_offsets(text)
