# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that gives the scene the frame rate of the footage after a capture."""

from __future__ import annotations

import bpy
from bpy.types import ID, Context, Object, Scene

from ..errors import UsageError
from ..notices import Notice, notice
from ..scene.datablocks import holds
from ..scene.stored_values import parse_spans, spans_text, start_frame, stored_rate
from .captured_person import (
    body_of,
    captured_people,
    library_of,
    motion_if_stored,
    people_in,
    retargeted_from,
)
from .captures import people_of, shown_capture
from .reporting import ReportingOperator, add_warning, refuse, rpt_, stored_warning

_SAME = 0.01  # frames per second
_WHOLE = 1e-5  # how far the keys' distance may be from whole frames, of which thousands add up
# Warnings that another frame rate settles.
_OF_RATE = ("scene_rate", "scene_rate_multiple", "footage_drifts")


def rate_warnings(scene_rate: float, rate: float, what: str = "footage") -> list[Notice]:
    """Return the warning that a scene keeps another frame rate than a motion has, and where its
    keys lie, if so.

    :param scene_rate: frames per second of the scene.
    :param rate: frames per second of the motion; 0 for a still image.
    :param what: has the other rate: a key of ``notices.PHRASES``.
    """
    if not rate > 0 or abs(rate - scene_rate) <= _SAME:
        return []
    apart = scene_rate / rate
    if apart > 1.5 and abs(apart - round(apart)) < _WHOLE:
        return [
            notice(
                "scene_rate_multiple",
                scene_rate=scene_rate,
                what=what,
                rate=rate,
                apart=round(apart),
            )
        ]
    return [notice("scene_rate", scene_rate=scene_rate, what=what, rate=rate)]


def differs(scene: Scene) -> bool:
    """Return whether the shown capture's footage has another frame rate than the scene"""
    rate = scene.scope.result.footage_rate
    return bool(rate > 0 and abs(rate - scene.render.fps / scene.render.fps_base) > _SAME)


def keyed_for(scene: Scene) -> float:
    """Return the frame rate that captured motion was keyed for, that of the shown capture first,
    if the scene has another one; otherwise 0.

    Blender's importer of FBX files, for example, sets the scene's frame rate, which changes the
    speed of all keys; so does a motion that is imported with its rate. A person may be appended
    from a file of another rate.
    """
    now = scene.render.fps / scene.render.fps_base
    capture = shown_capture(scene)
    people = [*(people_of(capture) if capture else ()), *people_in(scene)]
    rates = [stored_rate(person, now) for person in people]
    return next((rate for rate in rates if abs(rate - now) > _SAME), 0.0)


def _has_motion_rate(scene: Scene) -> bool:
    """Return whether `_motion_rate` may find one, without reading a motion"""
    result = scene.scope.result
    return result.footage_rate > 0 or (result.people == 0 and bool(people_in(scene)))


def _motion_rate(scene: Scene) -> float:
    """Return the frame rate of the shown capture's motion, 0 of a still image

    A capture that the command line has written into a .blend file, or a person who was appended
    without the collection, has no result that says so; the stored motion does, or else the keys.
    """
    result = scene.scope.result
    if result.footage_rate > 0 or result.people:
        return float(result.footage_rate)
    capture = shown_capture(scene)
    for person in (capture and people_of(capture)) or people_in(scene):
        motion = motion_if_stored(person)
        if motion is None:
            return stored_rate(person, 0.0)
        if len(motion) > 1:
            return float(motion.mocap_framerate)
    return 0.0


class SCOPE_OT_match_frame_rate(ReportingOperator):
    """Set the scene to the motion's frame rate"""

    bl_description = (
        "Set the scene to the motion's frame rate. Captures keep their speed, other animation "
        "keeps its frames"
    )
    bl_idname = "scope.match_frame_rate"
    bl_label = "Match Frame Rate"

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a capture with a frame rate, and that everything to move is stored in this
        file.
        """
        scene = context.scene
        if not _has_motion_rate(scene):
            return refuse(cls, "The scene contains no captured video or imported motion")
        for block in (scene, *captured_people(context)):
            if (library := _library(block)) is not None:
                return refuse(
                    cls,
                    "'{name}' is linked from {file}: make it local",
                    name=block.name,
                    file=library.filepath,
                )
        return True

    def work(self, context: Context) -> str:
        """Change the rate and move the captures in time."""
        from ..scene.character.keys import bake_whole_frames, read_clip
        from ..scene.character.root_object import root_object
        from ..scene.match_rate import change_rate, other_animation
        from ..scene.timing import keyed_rate, scene_rate
        from ..scene.transaction import all_or_nothing

        scene = context.scene
        people = captured_people(context)
        former = scene_rate(scene)
        rate = _motion_rate(scene)
        if not rate > 0:
            raise UsageError(
                "the captured picture has no frame rate; set the one that you want in Output > "
                "Format"
            )
        rate = _exact(rate)
        bodies = {person: body_of(person) for person in people if person.get("scope_resampled")}
        for person, body in bodies.items():  # which fails without keys, before anything is changed
            read_clip(person, body, former)
        keyed = {person: keyed_rate(person, scene) for person in people}
        # keys can be moved without the motion, too
        motions = {person: motion_if_stored(person) for person in people}
        sources = {obj: retargeted_from(scene, obj) for obj in scene.objects}
        rigs = [(obj, person) for obj, person in sources.items() if person in people]
        cameras = [obj for obj in scene.objects if obj.type == "CAMERA"]
        roots = [root for obj in sources if (root := root_object(obj)) is not None]
        keys = {
            keys
            for obj in scene.objects
            if (keys := getattr(obj.data, "shape_keys", None)) and keys.library is None
        }
        actions = [action for action in bpy.data.actions if action.library is None]
        moved = [*people, *(rig for rig, _ in rigs), *cameras, *roots]
        with all_or_nothing(scene, *moved, keys=list(keys), actions=actions):
            warnings = change_rate(scene, rate, motions, rigs)
            for person, body in bodies.items():
                bake_whole_frames(person, body, rate)
        _update_results(scene, rate, keyed, warnings)
        if other_animation(scene, people, rigs):
            return rpt_(
                "The scene has {rate:.5g} frames/s; animation that was not captured plays "
                "{factor:.3g} times as fast",
                rate=rate,
                factor=rate / former,
            )
        return rpt_("The scene has {rate:.5g} frames/s, like the motion", rate=rate)


def _library(block: ID) -> bpy.types.Library | None:
    return library_of(block) if isinstance(block, Object) else block.library


def _exact(rate: float) -> float:
    """Return the rate that Blender will store, which single precision has rounded"""
    from ..scene.timing import blender_rate

    fps, base = blender_rate(rate)
    return fps / base


def _update_results(
    scene: Scene, rate: float, keyed: dict[Object, float], warnings: list[Notice]
) -> None:
    """Move the frames that results name, and replace the warnings about the frame rate"""
    from ..scene.match_rate import retimed
    from ..scene.timing import Retiming

    for collection in scene.collection.children_recursive:
        result = collection.scope_result
        person = next((p for p in keyed if holds(collection, p)), None)
        if person is None:
            continue
        retiming = Retiming(start_frame(person), rate / keyed[person])
        shown = result.warnings
        for index in reversed(range(len(shown))):
            if stored_warning(shown[index]).code in _OF_RATE:
                shown.remove(index)
            elif shown[index].spans:
                spans = parse_spans(shown[index].spans)
                shown[index].spans = spans_text(retimed(spans, retiming))
        if not person.get("scope_resampled"):  # which has keys on every frame
            what = "footage" if result.footage else "motion"
            for warning in rate_warnings(rate, result.footage_rate, what):
                add_warning(result, warning)
    for warning in dict.fromkeys(warnings):
        add_warning(scene.scope.result, warning)


CLASSES = (SCOPE_OT_match_frame_rate,)
