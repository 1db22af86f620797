# SPDX-License-Identifier: GPL-3.0-or-later
"""The output files of a capture: checks before the capture starts, writing, and the summary."""

from __future__ import annotations

import os
from argparse import Namespace
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...solver.body import Body
from ...solver.body_file import ASSETS
from ..confinement import confine_capture, folders_of
from ..errors import UsageError
from ..footage import display_text, files_of_footage, is_url
from ..installed import check_installed
from ..motion import Motion
from ..notices import Notice, counted
from ..options import option
from ..output_paths import WITHOUT_SCENE, check_output, files_of_people, left_over
from ..scene.export.without_scene import write_without_scene
from .blender_module import bounded_import, load_blender

if TYPE_CHECKING:
    from ..retarget.rig_source import RigSource

OVERLAY_SUFFIXES = (".mp4", ".png", ".jpg")
REPORT_SUFFIXES = (".html",)
CALIBRATION_SUFFIXES = (".toml",)


def default_outputs(video: Path) -> list[Path]:
    """Return the outputs of a capture without ``-o``: a motion file and a character next to the
    video.

    For footage that comes with Scope they lie in the current folder. Nothing is written into
    Scope's own folder, which the next version replaces, and which may not be writable.

    :raises UsageError: the current folder is a part of Scope's own.
    """
    folder = video.parent if video.name not in ("", "..") else Path(os.path.abspath(video)).parent
    if _is_shipped(folder):
        folder = Path()
        if _is_shipped(folder):
            raise UsageError(
                f"{folder.resolve()} belongs to Scope and is replaced with it; choose "
                "an output with -o"
            )
    return [folder / f"{stem_of(video)}{suffix}" for suffix in (".npz", ".glb")]


def stem_of(path: Path) -> str:
    """Return the name of a file without its suffix, or the whole name of a folder, also of
    ``.``.
    """
    whole = Path(os.path.abspath(path))
    return whole.name if whole.is_dir() else whole.stem


def _is_shipped(folder: Path) -> bool:
    return folder.resolve().is_relative_to(ASSETS.resolve())


# Arguments and options that name footage, or another file to read.
FOOTAGE = ("video", "source")
VIEWS = "views"
# They decide what is written, not what is captured.
OF_RIGS = ("retarget", "bone_map", "expression_map")
OTHER_INPUTS = (
    *("motion", "body", "calibration", "camera_path", *OF_RIGS, "detector", "keypoints"),
)

# Arguments that name a file to write beside the results.
OTHER_OUTPUTS = ("overlay", "report", "save_calibration", "finished_file", "record", "keep_footage")


def files_to_read(values: Mapping[str, Any]) -> list[Path]:
    """Return every existing file that a command's arguments and options name: all that they read
    and none may write.

    :param values: of arguments and options, by their names.
    """
    files: list[Path] = []
    footage = [values.get(name) for name in FOOTAGE]
    views = values.get(VIEWS)  # of a batch, only whether there are any
    for value in [*footage, *(views if isinstance(views, list) else ())]:
        if value is not None and not is_url(value):
            files += files_of_footage(Path(value))
    return [*filter(os.path.isfile, files), *files_of_options(values)]


def files_of_options(values: Mapping[str, Any]) -> list[Path]:
    """Return the existing files that are read besides footage; see `files_to_read`."""
    files: list[Path] = []
    for name in OTHER_INPUTS:
        value = values.get(name)
        for path in map(Path, value if isinstance(value, list) else [value] if value else []):
            # A network's description lies beside it.
            files += [path, path.with_suffix(".json")] if path.suffix == ".onnx" else [path]
            if name == "calibration":
                from ..capture.camera.calibration_tables import files_of_calibration

                files += files_of_calibration(path)
    return [path for path in files if os.path.isfile(path)]


def refuse_inputs(paths: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Refuse to write a file that is read, by whatever path or link.

    :param paths: that are going to be written.
    :param inputs: existing files.
    :raises UsageError: a path is one of the inputs.
    """
    read: set[tuple[object, ...]] = set()
    for each in inputs:
        read.update(_identities(each))
    for path in paths:
        try:
            written = _identities(path)
        except OSError:
            continue  # it does not exist yet
        if read.intersection(written):
            raise UsageError(f"{path} is the input itself; choose another name")


def _identities(path: Path) -> list[tuple[object, ...]]:
    """Return what two paths of a file have in common.

    A disk may take capital and small letters for the same, and give the file a number for each way
    of writing its name, as exFAT does in user space: then size, time and letters are the same.

    :raises OSError: there is no such file.
    """
    status = path.stat()
    name = os.path.realpath(path).casefold()
    return [
        (status.st_dev, status.st_ino),
        (status.st_dev, name, status.st_size, status.st_mtime_ns),
    ]


def check_outputs(
    outputs: list[Path],
    inputs: Mapping[str, Any],
    overlay: Path | None = None,
    report: Path | None = None,
    calibration: Path | None = None,
) -> None:
    """Check, before the capture starts, that the outputs, overlay, page and calibration can be
    written after it.

    :param inputs: values of the command's arguments and options; see `files_to_read`.
    :raises UsageError: an output has an unknown suffix, is a folder, or is what is read.
    :raises OutputError: see `check_output`.
    """
    for path in outputs:
        check_output(path)
    if overlay:
        check_output(overlay, OVERLAY_SUFFIXES)
    if report:
        check_output(report, REPORT_SUFFIXES)
    if calibration:
        check_output(calibration, CALIBRATION_SUFFIXES)
    written = [*outputs, *filter(None, (overlay, report, calibration))]
    for path in outputs:
        written += files_of_people(path)
    refuse_inputs(written, files_to_read(inputs))


def confine(args: Namespace, outputs: list[Path], *, connects: bool = False) -> None:
    """Confine this process before it decodes what others have made, if it is the command's own
    rather than Blender's, or that of a program which calls the command line.

    :param outputs: result files.
    :param connects: whether the command needs a network.
    """
    if not args.own_process:
        return
    values = vars(args)
    written = [*outputs, *(values[name] for name in OTHER_OUTPUTS if values.get(name))]
    folders = [folder for path in written for folder in folders_of(path)]
    if values.get("windows_folder"):
        folders.append(args.windows_folder)
    own_networks = values.get("detector") or values.get("keypoints")
    confine_capture(folders, connects=connects, starts_programs=bool(own_networks))


def check_blender(outputs: list[Path]) -> None:
    """Check that bpy is installed if an output needs it, as all do except those of
    `WITHOUT_SCENE`.

    :raises SetupError: it is not installed; the message gives the command that installs it.
    """
    if any(path.suffix.lower() not in WITHOUT_SCENE for path in outputs):
        check_installed(["bpy"])


def distinct_paths(outputs: list[Path]) -> list[Path]:
    """Return the paths without duplicates of the same file, such as ``out/case.npz`` and
    ``out/x/../case.npz``.
    """
    by_real_path: dict[str, Path] = {}
    for path in outputs:
        by_real_path.setdefault(os.path.normcase(os.path.realpath(path)), path)
    return list(by_real_path.values())


def _check_output_options(args: Namespace, outputs: list[Path]) -> None:
    """Check that each option which says how an output is written has such an output.

    :raises UsageError: it has none.
    """
    suffixes = {path.suffix.lower() for path in outputs}.difference(WITHOUT_SCENE)
    if args.skeleton != option("skeleton").default:
        if args.retarget:
            raise UsageError(
                "--skeleton names the bones of Scope's own body, and a rig keeps its own: give "
                "either --skeleton or --retarget"
            )
        if not suffixes - {".blend"}:
            raise UsageError(
                "--skeleton needs an output whose bones it can name, such as -o OUT.fbx; motion "
                "files and .blend files keep Scope's names"
            )
    if args.shape_keys != option("shape").default:
        if args.retarget:
            raise UsageError(
                "--shape-keys says how the shape of Scope's own body is stored, and a rig keeps "
                "its own: give either --shape-keys or --retarget"
            )
        if not suffixes - {".bvh"}:
            raise UsageError(
                "--shape-keys needs an output with the body's mesh, such as -o OUT.glb, or "
                "--formats glb in a batch"
            )
    if args.deform_bones and not (args.retarget and suffixes & {".fbx", ".glb"}):
        raise UsageError(
            "--deform-bones leaves out bones of a rig in .fbx and .glb files: give --retarget RIG "
            "and -o OUT.fbx, or --formats fbx in a batch"
        )
    if args.bvh_unit != option("bvh_unit").default and ".bvh" not in suffixes:
        raise UsageError(
            "--bvh-unit needs an output in .bvh: give -o OUT.bvh, or --formats bvh in a batch"
        )


def checked_rigs(
    args: Namespace, outputs: list[Path], fingers: bool, face: bool
) -> list[RigSource]:
    """Check the user's rigs before the capture starts and return them; none without --retarget.

    :param fingers: whether the motion has fingers.
    :param face: whether it has expressions.
    :raises ScopeError: a rig cannot be used, or the arguments contradict each other.
    """
    _check_output_options(args, outputs)
    of_rigs = _arguments_of_rigs(args, outputs, face)
    if not of_rigs:
        return []
    from ..retarget.rig_source import rig_source

    rigs = [
        rig_source(path, name or "", bones, expressions)
        for path, name, bones, expressions in zip(args.retarget, *of_rigs, strict=True)
    ]
    load_blender()
    from ..scene.rig_file import check_rig

    written = [*outputs, *filter(None, (getattr(args, "overlay", None),))]
    checked = []
    for rig in rigs:
        with bounded_import(rig.path):
            referred = check_rig(rig, fingers=fingers)
        refuse_inputs(written, referred)
        checked.append(replace(rig, files=referred))
    return checked


def _arguments_of_rigs(args: Namespace, outputs: list[Path], face: bool) -> list[list[Any]]:
    """Return names, bone maps and expression maps of the user's rigs, each a list with an entry for
    each rig; nothing without --retarget.

    :param face: whether the motion has expressions.
    :raises UsageError: the arguments contradict each other, or the outputs.
    """
    of_rigs = {
        "--rig-object": args.rig_object,
        "--bone-map": args.bone_map,
        "--expression-map": args.expression_map,
    }
    count = len(args.retarget or ())
    if not count:
        of_rigs["--retarget-root"] = args.retarget_root != option("retarget_root").default
        for flag, value in of_rigs.items():
            if value:
                raise UsageError(f"{flag} applies to a rig: give the rig's file with --retarget")
        return []
    if args.expression_map and not face:
        raise UsageError(
            f"--expression-map maps expressions, which {args.motion} does not have: leave it out"
            if args.command == "import"
            else "--expression-map maps expressions, which only --face captures: give it too"
        )
    scene_files = [p for p in outputs if p.suffix.lower() not in WITHOUT_SCENE]
    if not scene_files:
        raise UsageError(
            "--retarget needs an output that can contain a rig, such as -o OUT.glb; a "
            "motion file cannot"
        )
    if count > 1 and args.command == "batch":
        raise UsageError("a batch takes one rig: run it again with the next one")
    if count > 1 and count != len(scene_files):
        raise UsageError(
            f"{count} rigs need {count} outputs, one for each in the same order, but there "
            f"{'is' if len(scene_files) == 1 else 'are'} {len(scene_files)}; give -o for each rig"
        )
    for flag, values in of_rigs.items():
        if values and len(values) != count:
            raise UsageError(
                f"{flag} is given {len(values)} times for {counted(count, 'rig')}: give it once "
                "for each rig, in the same order, or not at all"
            )
    return [values or [None] * count for values in of_rigs.values()]


def write_outputs(
    outputs: list[Path],
    motions: list[Motion],
    body: Body,
    video: Path,
    args: Namespace,
    rigs: Sequence[RigSource] = (),
    views: Sequence[Path] = (),
) -> tuple[list[Path], list[Notice]]:
    """Write every output; bpy is loaded only if an output needs a scene.

    :param rigs: one for all outputs that can contain a rig, or one for each of these.
    :param views: videos of the motions' further cameras.
    :return: the paths of the files, and warnings.
    :raises OutputError: a file cannot be written.
    """
    motion_files = [p for p in outputs if p.suffix.lower() in WITHOUT_SCENE]
    scene_files = [p for p in outputs if p not in motion_files]
    written: list[Path] = []
    warnings: list[Notice] = []
    for path in motion_files:
        written += write_without_scene(path, motions, [body] * len(motions))
    if scene_files:
        load_blender()
        from ..scene.build import NEW_SCENE
        from ..scene.export.export import ExportOptions, export_motions

        footage = _footage(video, args)
        options = replace(
            NEW_SCENE,
            name=display_text(stem_of(video)),
            shape=args.shape_keys,
            view_footage=[_shown_file(view, args) for view in views],
        )
        if not motions[0].image_size.any():  # imported, and never seen by a camera
            options = replace(options, resolution="keep", active_camera=False, with_camera=False)
        separate = ExportOptions(
            separate=args.file_per_person,
            bvh_unit=args.bvh_unit,
            deform_bones=args.deform_bones,
            skeleton=args.skeleton,
        )
        if rigs:
            from ..scene.rig_file import export_on_rig

            shares = [scene_files] if len(rigs) == 1 else [[path] for path in scene_files]
            for rig, paths in zip(rigs, shares, strict=True):
                files, more = export_on_rig(
                    motions,
                    body,
                    paths,
                    rig,
                    options,
                    footage,
                    root=args.retarget_root,
                    export_options=separate,
                )
                written += files
                warnings += more
        else:
            files, warnings = export_motions(motions, body, scene_files, footage, options, separate)
            written += files
    if others := left_over(outputs, written):
        warnings = [*warnings, others]
    return written, warnings


def _footage(video: Path, args: Namespace) -> Path | None:
    """Return the footage to show; None for an imported motion."""
    return None if args.command == "import" else _shown_file(video, args)


def _shown_file(footage: Path, args: Namespace) -> Path:
    """Return the file that Blender shows: of numbered pictures, the first one."""
    from ..capture.media.image_sequence import find_sequence

    sequence = find_sequence(footage, args.fps is not None)
    return sequence.paths[0] if sequence else footage


def summary(report: dict[str, Any]) -> str:
    """Describe a capture in one line. Distances are as wrong as an assumed lens is."""
    lens = report["camera"]
    if lens.startswith("assumed"):
        lens += " (give a known lens by --fov or --focal-mm)"
    people = counted(report["people"], "person", "people")
    return (
        f"{people}, {counted(report['frames'], 'frame')}, {report['fps']['total']:.1f} frames/s, "
        f"reprojection error {report['reprojection_px']:.1f} px, networks on "
        f"{report['execution']}; camera: {lens}; wrote {', '.join(report['outputs'])}"
    )
