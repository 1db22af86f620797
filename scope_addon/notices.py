# SPDX-License-Identifier: GPL-3.0-or-later
"""What users should know about a result: the code of every warning, its English sentence, and how
the values in it are written.

A part of Scope that warns returns a ``Notice``, made by ``notice("cuts", footage=..., times=...)``.
Whoever shows it writes the sentence: ``str`` in English, ``text`` in another language, ``parts``
with the times in the footage apart. ``counted`` is for messages in English alone. Standard library
only.
"""

from __future__ import annotations

import string
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple

MAX_TIMES = 4  # that are listed in a sentence
MAX_NAMES = 6
OTHER = "other"  # the code of a sentence that is none of ours, such as an error's message

Value = str | int | float | list[float] | list[str]
Translate = Callable[[str], str]

# In braces, the names of values. After a colon, how a value is written: as Python does it, or
# - who: of whom the warning is; 0 is the only person, n the n-th one
# - whose: the same before a sentence, and nothing for the only person
# - frames: a count with its noun
# - times: a list of times in the footage, in seconds
# - names: a list of names, the first few of them
# - phrase: one of the phrases below, by its key.
SENTENCES = {
    OTHER: "{text}",
    # footage
    "assumed_frame_rate": "{footage}: images have no frame rate, so 30 frames per second were "
    "assumed; set another with --fps on the command line",
    "changed_footage": "{footage} has been changed since a capture of it was stopped, so that one "
    "was not continued, and everything was captured anew",
    "range_of_image": "{footage} is a single image: a start, an end, a frame rate, a speed or a "
    "treadmill has no effect",
    "first_of_animation": "{footage} is an animation of {images} images, and only the first was "
    "captured; convert it to an .mp4 or a .gif to capture all of them",
    "mirrored": "{footage} is mirrored by its metadata, which Blender ignores; there, switch on "
    "Flip {axis} of the camera's background image",
    "variable_frame_rate": "{footage} has a variable frame rate: most of it {rate:.5g} frames per "
    "second, on average {average:.5g}. The keys have the exact times of its frames, so some lie "
    "between the scene's frames",
    "slow_motion": "{footage} was recorded {speed:g} times as fast as it plays, so the motion "
    "has its true speed; capture with --speed 1 for the speed at which it plays",
    "frame_rate_above_footage": "{footage} has {rate:g} frames per second; {wanted:g} would "
    "repeat some, so each was used once",
    "uneven_frames": "{footage} has {rate:.5g} frames per second, so {wanted:.5g} per second "
    "cannot be evenly spaced. The keys have the exact times of its frames, so some lie between the "
    "scene's frames; with --fps {even:.5g} they are evenly spaced",
    "repeated_frames": "{percent:.0f} % of the frames of {footage} repeat the one before, as after "
    "a conversion to a higher frame rate, so the motion is jerky; capture with --fps {rate:g} on "
    "the command line",
    "frozen_frames": "{footage} shows one picture for up to {longest_s:.1f} s {times:times} and "
    "then goes on, as where a recording stalls, so the person stands still there; capture the "
    "parts before and after separately, with a start and end time",
    "frame_size_changes": "the frame size changes within {footage}; all frames were scaled to the "
    "first one's",
    "decoding_stopped": "decoding {footage} stopped after {decoded} of about {total} frames; the "
    "file may be damaged or incomplete",
    "frames_lacking": "{footage} lacks frames {times:times}, for up to {longest_s:.1f} s: parts of "
    "the file may be damaged or missing, or nothing moved while a screen was recorded; the motion "
    "there is a guess",
    "growing_file": "{footage} grew while it was read; capture it again once it is written "
    "completely",
    "missing_images": "{footage}: {missing} numbers between {first} and {last} have no image; the "
    "time of these frames was kept free",
    "consecutive_images": "{footage}: {missing} numbers between {first} and {last} have no image, "
    "so the images were read as consecutive frames",
    # networks
    "preset_of_own_network": "{network} replaces the built-in keypoint networks, so the quality "
    "preset has no effect",
    "provider_missing": "{provider} was requested, but this onnxruntime has only {available}; the "
    "networks run on the CPU",
    "provider_failed": "{provider} cannot run the networks ({reason}); they run on the CPU instead",
    "too_many_threads": "{threads} threads were requested, but there are only {cores} cores",
    # several cameras
    "view_without_place": "{footage} was not used: nobody in it moves like the person of the first "
    "video for a second; all videos must show the same moment",
    "uncertain_offset": "{footage}: another offset than {offset_s:.1f} s between the clocks of the "
    "cameras would fit nearly as well; clap once at the beginning, or move irregularly",
    "weak_place": "{footage}: the angle between this camera and the first one is known to "
    "{degrees:.0f} degrees only; walk around, so that you fill more of both images",
    "not_in_view": "{footage} does not show {person:who}, or was not recognized",
    "unseen_in_view": "{footage} does not show {person:who} {times:times}, or shows somebody else, "
    "so that the other cameras alone tell the motion there",
    "view_contradicts": "{footage} contradicts the other cameras about {person:who} {times:times}, "
    "and was left out there",
    "calibration_contradicts": "{calibration} does not fit {footage}: {person:who} is not where "
    "the other cameras see them; a camera was moved or zoomed since, or they are in another order",
    "calibration_scale": "{calibration} makes {person:who} {factor:.2f} times as large as adults "
    "are; unless that is so, its translations are not in metres, as after calibrating with a wrong "
    "size of the board",
    "sound_contradicts": "{footage}: the clock of this camera is {offset_s:.1f} s ahead of the "
    "first one's by the motion, which was used, but {sound_s:.1f} s by the sound; either the sound "
    "was added later, or this camera shows somebody else",
    "only_in_view": "{footage}: people whom the first video does not show, or who were not "
    "recognized in it, were left out: {others}",
    # the captured people
    "cuts": "{footage} cuts to another scene {times:times}: capture each scene separately, with a "
    "start and end time",
    "left_out": "{footage} shows more people than were captured: at least {others} more, one of "
    "them at {place} (x, y in pixels, @ seconds). Capture everyone, or choose the one to be "
    "captured with Person, --person {place} on the command line",
    # of one who was chosen, or of several cameras, whose captures have no Person
    "left_out_of_views": "{footage} shows more people than were captured: at least {others} more, "
    "one of them at {place} (x, y in pixels, @ seconds). Capture everyone, --people all on the "
    "command line",
    "seen_briefly": "{footage} shows people too briefly to capture them with the others: at least "
    "{others}, one of them at {place} (x, y in pixels, @ seconds). Capture that part alone, with a "
    "start and end time",
    # of several cameras, whose captures turn all videos alike
    "turned_view": "{footage}: the person lies or stands on the head in the picture from beginning "
    "to end. If this camera was turned, turn its video with another program first, because Turn "
    "turns those of all cameras",
    "turned_footage": "{footage}: the person lies or stands on the head in the picture from "
    "beginning to end. If the camera was turned, capture with Turn, --rotate {degrees} on the "
    "command line",
    "heights_for_one": "{footage}: {heights} heights were given, but one person was found",
    "heights_for_several": "{footage}: {heights} heights were given, but {people} people were "
    "found",
    "unseen_frames": "{footage}: {person:who} was not seen in {unseen} of {total:frames}; these "
    "are filled in",
    "unseen_legs": "{footage}: the legs of {person:who} were not seen, so their motion is a guess",
    "no_hands": "{footage}: no hands of {person:who} were found; come closer, or show the palms to "
    "the camera more often",
    "no_face": "{footage}: the face of {person:who} was not found; come closer, and look towards "
    "the camera",
    "guessed_up": "{footage}: no edges in this picture show which way is up, so it follows from "
    "the people's posture alone, and the result may lean by {degrees:.0f} degrees or more: check "
    "it from the side, and rotate it if it does",
    "other_floor": "{footage}: {person:who} stands up to {height_m:.1f} m {side:phrase} the floor "
    "{times:times}, so {cause:phrase}",
    "step": "{footage}: the feet of {person:who} rest {height_cm:.0f} cm {side:phrase} the floor "
    "{times:times}, as on a step; they were put on it. For stairs and slopes, capture with uneven "
    "ground",
    "under_floor": "{footage}: a foot of {person:who} is up to {depth_cm:.0f} cm under the floor "
    "in {under} of {total:frames}",
    # the camera
    "strides": "{footage}: the legs of {person:who} walk, but neither the body nor the background "
    "moves accordingly {times:times}: either on a treadmill, then capture with Treadmill, or the "
    "camera moves before a background that does not show it. No foot was held in place there; "
    "check how far the person travels",
    "unknown_travel": "{footage}: the camera travels, but how far is unknown, because neither a "
    "floor nor feet at rest are seen; it was left in place, so the people's paths are wrong",
    "travel_by_feet": "{footage}: the camera travels, and how far follows from the people's steps "
    "alone, because no floor is seen in the background, so their paths may be a third too short, "
    "or more; check how far they travel",
    "travel_by_lens": "{footage}: the camera travels, and its focal length is a guess, so the "
    "people's paths may be wrong by {percent:.0f} %; give the focal length or the field of view",
    "turn_by_lens": "{footage}: the camera turns by {degrees:.0f} degrees, if its focal length is "
    "as assumed; if not, straight paths become arcs, and people lean; give the focal length or the "
    "field of view (--focal-mm or --fov on the command line)",
    "lost_turn": "{footage}: the camera's rotation is unknown {times:times}, because too little of "
    "the background could be followed; the people's rotation and paths may be wrong from there on",
    "zoom": "{footage}: the lens zooms, but by how much is not known everywhere, because the "
    "camera also travels, or too little of the background is seen, so people may come nearer or go "
    "away wrongly; capture the parts without zoom separately, with a start and end time",
    "path_contradicts": "{path} does not fit {footage}: its camera turns otherwise than the "
    "background, by {degrees:.0f} degrees or more in half of the frames; it is that of another "
    "clip, or its times are not those of the footage",
    "given_floor": "{footage}: in the world of the given camera, the feet rest at z = "
    "{height_m:.2f} m; the capture was moved so that they rest at 0, with its own camera: move it "
    "by as much, or give the person's height if the floor should be at 0",
    "review": "{person:whose}{reason:phrase}",
    "implausible": "{footage}, {times:times}: {person:whose}{reason:phrase}",
    "bent_knees": "{footage}: no knee of {person:who} is ever straight while standing or walking; "
    "check the knees from the side, and give the person's height and the lens if they are known",
    # the scene
    "no_expressions": "the body '{body}' has no expressions, so it does not show the face, which "
    "is in the motion file; the built-in bodies do",
    "scene_unit": "the scene's unit is {unit_m:g} m, but the capture is in metres: scale the new "
    "objects by {scale:g}, or set Unit Scale to 1 in the scene's properties; exported files have "
    "the true size",
    "time_stretched": "the scene plays everything at {speed:g} times its speed, also the motion, "
    "as its output properties stretch time from {old} to {new}; set both to the same number for "
    "the true speed",
    "scene_rate": "the scene keeps its {scene_rate:.5g} frames/s, the {what:phrase} has "
    "{rate:.5g}: keys lie between frames; Match Frame Rate changes the scene's rate and moves them",
    "scene_rate_multiple": "the scene keeps its {scene_rate:.5g} frames/s, the {what:phrase} has "
    "{rate:.5g}: keys are {apart} frames apart; Match Frame Rate changes the scene's rate and "
    "moves them",
    "pixel_aspect": "the footage's pixels are not square, and the pixel aspect belongs to the "
    "scene, not the camera: set the scene's resolution from the footage, as Compare with Footage "
    "does, for an exact overlay",
    "missing_footage": "{footage} no longer exists, so the camera shows no footage",
    "undecodable_footage": "Blender cannot decode {footage}, so the camera shows no footage",
    "footage_size": "Blender shows {footage} at {width} x {height}, but it was captured at "
    "{captured_width} x {captured_height}: turn or scale the camera's background image",
    "footage_drifts": "the background image drifts from the motion by up to {frames:.0f} frames, "
    "because the scene does not have the footage's constant frame rate and the lens distorts; the "
    "motion keeps its speed",
    "image_numbers": "Blender cannot show the image sequence from {first} on, because images are "
    "missing, or their numbers are too large or not the last ones in their names, so the camera "
    "shows that image only; number the files consecutively, at the end of their names, to show all",
    # files
    "left_over": "these files are of another capture, not part of this result: {files:names}; "
    "remove what you do not need",
    # a rig
    "guessed_bones": "these bones of '{rig}' were guessed from its rest pose alone: {bones:names}; "
    "check the result",
    "still_parts": "the bone map of '{rig}' has no bones for {parts:names}, which stay as they are "
    "at rest; add bones for them to the map",
    "odd_bones": "these bones of '{rig}' {reason:phrase}: {bones:names}; check the bone map",
    "face_not_retargeted": "the face was not retargeted: {reason}",
    "driven_keys": "drivers move these shape keys of '{mesh}', so they do not show the "
    "expressions: {keys:names}; remove the drivers",
    "blocked_bones": "these bones of '{rig}' cannot follow the motion: {bones:names}; mute the "
    "constraints or drivers that control them, such as IK, or put the bones that control them "
    "into the list",
    "stretched_rig": "'{rig}' has another scale along each axis, which turns its limbs away from "
    "the captured ones: apply the scale of the rig and its meshes (Ctrl A), or scale it evenly",
    "mirrored_rig": "{file} holds '{rig}' mirrored by its negative scale, which Blender's "
    "importer, and perhaps others, show wrongly: apply the scale of the rig and its meshes (Ctrl "
    "A) before retargeting",
    "outdated_rig": "'{rig}' has the motion that '{person}' had before it was changed: press "
    "Retarget for the present one, and export again",
    "posed_bones": "the pose of these bones of '{rig}', which are not in the list, moves or turns "
    "the motion: {bones:names}; clear it in Pose Mode (Alt G, Alt R, Alt S) for the motion as "
    "captured",
    "nla_bones": "NLA tracks of '{rig}' move or turn bones that are not in the list, and the "
    "motion with them: {bones:names}; mute these tracks for the motion as captured",
    "unlisted_fingers": "fingers were captured, but the bone map of '{rig}' has none of the bones "
    "below {hands:names}, which stay as they are: add the fingers to the map",
    "kept_action": "the action '{action}' was edited after Retarget wrote it: it is kept in the "
    "file, but '{rig}' has the new one",
    "modifiers_left_out": "{file} does not show '{mesh}' as its modifiers do: {modifiers:names}; "
    "apply or remove these, and export again",
    "bends_left_out": "{file} lacks the bends of these bones of '{rig}', as no such file can hold "
    "B-bones: {bones:names}; set their Segments to 1 to see what the file shows",
    "shape_keys_left_out": "{file} lacks these shape keys of '{mesh}', with which its modifiers "
    "make other faces: {keys:names}; remove such modifiers, or change the keys, and export again",
    # an imported motion
    "other_gender": "the motion is of a {gender} body, but '{body}' is {body_gender}",
    "other_body": "the poses were applied as they are to Scope's own body, whose rest pose and "
    "proportions differ from SMPL's; with your SMPL, SMPL+H or SMPL-X file as the body, the motion "
    "is exact",
    "other_model": "the file's body is of another model than '{body}', so its shape was left out "
    "and the feet were put on the floor; with your file of that model as the body, the motion is "
    "exact",
    "parts_left_out": "the body '{body}' has no {parts}, whose motion was left out",
    "arrays_left_out": "these arrays of the file do not hold one rotation for each frame, and were "
    "left out: {arrays:names}",
    "rate_not_stated": "the file states no frame rate; {rate:g} frames per second were assumed",
    "rate_stated": "the file states {stated:g} frames per second, which were used, not {given:g}",
    "frames_without_poses": "the file has no poses {times:times}, for up to {longest_s:.1f} s: the "
    "motion there is a guess",
    "no_translation": "the file holds no translation: the pelvis stays in place",
    "other_unit": "{file}: {array} is in {unit}, as only then the feet stand still on the floor, "
    "so it was converted to metres",
    "unsure_up": "the file's up axis is not clear from the motion; {axis} was assumed",
    "other_skeleton": "limbs have the directions of the file's skeleton, but the body keeps its "
    "proportions; distances were multiplied by {scale:.5g}, the ratio of the legs' lengths",
    "missing_joints": "the file has no joints for {parts:names}, which only follow the rest",
    "no_rest_pose": "the file's rest pose is not that of a standing person, so its frame {frame} "
    "was taken for one with level feet and hanging or spread arms; check feet, hands and head",
    "odd_joints": "these joints of the file cannot be what their names say: {joints:names}; check "
    "the result",
    "other_up": "{axis} points up in the file; the motion was placed on the floor by its feet",
}

# Why frames should be reviewed.
REASONS = {
    "unseen": "not visible: the pose is filled in",
    "far": "the body is far from the footage: check these frames",
    "unsure": "low confidence: check these frames",
    "floor": "a foot is under the floor",
    "swing": "a hand or foot swings through in depth: check these frames from the side",
    "lean": "leans farther than anybody can stand: check these frames from the side",
    "floating": "floats above the floor: check these frames",
    "leap": "moves faster than anybody can: the footage may leave out what happened, or somebody "
    "else is followed from there on",
    "spin": "turns faster than anybody can: check these frames",
    "snap": "a hand or foot moves faster than anybody can: check these frames",
}
_SEVERAL_FLOORS = (
    "the clip has more than one floor: capture the part that matters, with a start and end time, "
    "or with uneven ground"
)
PHRASES = REASONS | {
    "above": "above",
    "below": "below",
    "footage": "footage",
    "motion": "motion",
    # what is wrong about bones at rest
    "segments": "differ too much in length to be one limb",
    "upwards": "do not lead down at rest",
    "sides": "are not equally long on both sides",
    "lying": "do not stand upright at rest",
    # why somebody is not on the floor
    "several_floors": _SEVERAL_FLOORS,
    "estimated_heights": "either somebody is taller or smaller than estimated: give everybody's "
    f"height; or {_SEVERAL_FLOORS}",
    "given_heights": "either the heights are given in another order than the people, the most "
    f"prominent first; or {_SEVERAL_FLOORS}",
}
# The parts of sentences that ``who``, ``frames`` and ``times`` stand for.
THE_PERSON = "the person"
PERSON = "person {number}"
ONE_FRAME = "{count} frame"
FRAMES = "{count} frames"
AT_TIME = "at {seconds} s"
MORE_TIMES = "{count} more times"
AND = "and"
PARTS = (THE_PERSON, PERSON, ONE_FRAME, FRAMES, AT_TIME, MORE_TIMES, AND)


class TimeText(NamedTuple):
    """A time in the footage, as a sentence says it."""

    text: str
    seconds: float


@dataclass(frozen=True)
class Notice:
    """Something that a user should know: a key of ``SENTENCES``, and the values in its sentence."""

    code: str
    values: Mapping[str, Value] = field(default_factory=dict)

    def __hash__(self) -> int:
        """Return a hash for sets of notices; values, which may be lists, have none."""
        return hash(self.code)

    def __str__(self) -> str:
        """Return the English sentence."""
        return self.text(str)

    def text(self, translate: Translate) -> str:
        """Return the sentence in the language of ``translate``, which takes English texts."""
        parts = self.parts(translate)
        return "".join(part.text if isinstance(part, TimeText) else part for part in parts)

    def parts(self, translate: Translate = str) -> list[str | TimeText]:
        """Return the sentence as its texts and the times in the footage between them.

        :raises KeyError: the code is unknown, or a value is missing.
        :raises ValueError: a number or time is not one that the sentence can show.
        :raises TypeError: a value does not have the type that the sentence needs.
        """
        parts: list[str | TimeText] = []
        for literal, name, spec, _ in string.Formatter().parse(translate(SENTENCES[self.code])):
            parts.append(literal)
            if name is not None:
                parts += _written(self.values[name], spec or "", translate)
        return parts

    def as_json(self) -> dict[str, Any]:
        """Return the notice for a file or another process."""
        return {"code": self.code, "values": dict(self.values)}


def notice(code: str, **values: Value) -> Notice:
    """Return the notice of this code with these values."""
    return Notice(code, values)


def notice_from(record: object) -> Notice:
    """Return the notice of a record as of ``Notice.as_json``. Of anything else, and of a record
    that makes no sentence, it says that it is damaged.
    """
    with suppress(KeyError, ValueError, TypeError, AttributeError, OverflowError):
        found = Notice(record["code"], dict(record["values"]))  # type: ignore[index]
        str(found)
        return found
    return notice(OTHER, text="a warning of this result is damaged; capture again to see it")


def _written(value: Value, spec: str, translate: Translate) -> list[str | TimeText]:
    """Return how a sentence writes one of its values."""
    if spec == "who":
        return [_person(value, translate)]
    if spec == "whose":
        return [f"{_person(value, translate)}: " if value else ""]
    if spec == "frames":
        return [translate(ONE_FRAME if value == 1 else FRAMES).format(count=value)]
    if spec == "phrase":
        return [translate(PHRASES[str(value)])]
    if spec in ("times", "names"):
        if not isinstance(value, list):
            raise TypeError(f"{spec} must be a list, not {value!r}")
        if spec == "times":
            return _times([float(each) for each in value], translate)
        listed = ", ".join(f"'{name}'" for name in value[:MAX_NAMES])
        return [listed + (" …" if len(value) > MAX_NAMES else "")]
    return [format(value, spec)]


def _person(number: Value, translate: Translate) -> str:
    return translate(PERSON).format(number=number) if number else translate(THE_PERSON)


def _times(times_s: list[float], translate: Translate) -> list[str | TimeText]:
    """Write times as "at 2.0 s and at 4.1 s"; if there are many, only the first few."""
    listed: list[str | TimeText] = []
    for time_s in times_s[:MAX_TIMES]:
        seconds = f"{time_s:.1f}"
        listed.append(TimeText(translate(AT_TIME).format(seconds=seconds), float(seconds)))
    more = len(times_s) - len(listed)
    if more:
        listed.append(translate(MORE_TIMES).format(count=more))
    written = listed[:1]
    for index, time in enumerate(listed[1:], 2):
        written += [f" {translate(AND)} " if index == len(listed) else ", ", time]
    return written


def and_more(listed: Sequence[str], count: int, between: str = ", ") -> str:
    """Return texts in a row, and how many of ``count`` are left out: ``a, b and 3 more``."""
    more = count - len(listed)
    return between.join(listed) + (f" and {more} more" if more > 0 else "")


def counted(count: int, noun: str, nouns: str = "") -> str:
    """Return a number with its noun: ``1 frame``, ``2 frames``, ``0 people``.

    :param noun: for 1.
    :param nouns: for every other number; if empty, ``noun`` and an s.
    """
    return f"{count} {noun}" if count == 1 else f"{count} {nouns or noun + 's'}"
