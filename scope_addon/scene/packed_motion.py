# SPDX-License-Identifier: GPL-3.0-or-later
"""The captured motion inside the .blend file.

The motion file's bytes are a custom property of a text datablock, to which a custom property of the
armature points. Blender therefore saves, appends and links the text together with the armature,
duplicates of the armature share it, and it is removed with the last of them. Bytes on the armature
itself would be copied with each duplicate and each evaluation of the object; nothing evaluates or
copies a text, and undo stores it again only if it changes.
"""

from __future__ import annotations

from dataclasses import replace

import bpy
from bpy.types import Object, Text

from ...solver.errors import ScopeError
from ..edit.clip import Clip
from ..errors import MotionFileError, UsageError
from ..motion import Motion
from ..scene_gaps import with_scene_gaps
from .stored_values import start_frame

MOTION = "scope_motion"  # property of the armature: the text
_CONTENT = "motion"  # property of the text: bytes of the motion file
# property of the text: bytes of ``character/uncorrected_keys.py``
_KEYS = "uncorrected_keys"
_LARGEST_BYTES = 1 << 30  # packed; an hour at 60 frames per second takes a tenth
_NOTE = """\
The captured motion of '{name}', which Scope stores in the custom property '{content}' of this text.
Smoothing and the export of motion files start from it. It is deleted with the armature.
"""


def pack_motion(armature: Object, content: bytes, keys: bytes = b"") -> None:
    """Store a motion file's bytes with the armature. Duplicates of the armature keep the motion
    that they have.

    :param keys: bytes of the armature's ``UncorrectedKeys``.

    A former text that nothing else uses is not saved with the file; until then, undo and a failed
    operator restore it.
    """
    text = bpy.data.texts.new(f"{armature.name} motion")
    text.from_string(_NOTE.format(name=armature.name, content=_CONTENT))
    text[_CONTENT] = content
    if keys:
        text[_KEYS] = keys
    armature[MOTION] = text
    # texts have one when they are new, and would stay in the file for ever
    text.use_fake_user = False


def stored_motion(armature: Object) -> Motion:
    """Return the motion that is stored with the armature. A .blend file may be hostile: nothing is
    unpickled.

    :raises UsageError: the armature stores none.
    :raises MotionFileError: what it stores is damaged or not a motion.
    """
    stored = armature.get(MOTION)
    if isinstance(stored, Text):
        content = stored.get(_CONTENT)
        name = f"the motion in the text '{stored.name}'"
        if not isinstance(content, bytes):
            raise MotionFileError(
                f"{name} was removed or changed; undo that, or capture the footage again"
            )
        if len(content) > _LARGEST_BYTES:
            raise MotionFileError(
                f"{name} has {len(content) >> 20} MiB, too much for a motion; capture again"
            )
        return Motion.load(name, content)
    raise UsageError(
        f"the captured motion of '{armature.name}' is not stored in this .blend file; capture the "
        "footage again, or import its .npz file"
    )


def apart_at_cuts(armature: Object, clip: Clip, rate: float) -> Clip:
    """Return the keys of an armature with gaps in their times at the cuts of the footage, so that
    they can be filtered; as they are where the motion is lost.

    :param rate: scene frames per second.
    """
    try:
        cuts_s = stored_motion(armature).cuts_s
    except ScopeError:
        return clip
    return replace(clip, times=with_scene_gaps(clip.times, cuts_s + start_frame(armature) / rate))


def stored_keys(armature: Object) -> object:
    """Return the bytes of the armature's ``UncorrectedKeys`` as they are stored; None if there are
    none.
    """
    stored = armature.get(MOTION)
    return stored.get(_KEYS) if isinstance(stored, Text) else None


def motion_texts(armatures: list[Object]) -> list[Text]:
    """Return the texts that hold the armatures' motions."""
    found = [armature.get(MOTION) for armature in armatures]
    return list(dict.fromkeys(text for text in found if isinstance(text, Text)))
