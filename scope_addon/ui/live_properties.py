# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of live captures, stored with the scene; and what is never saved: the running live
capture, the message of the last one, what cameras have told, and names and passwords of streams.
"""

from __future__ import annotations

import re
from typing import Any, ClassVar

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, PointerProperty, StringProperty
from bpy.types import Context, PropertyGroup

from ..footage import display_address, has_login
from ..options import Place
from .declared_properties import PATH_OPTIONS, with_options
from .file_field import path_text
from .job_operator import JobState

_VIDEO = {"name": "Video", "description": "Video of a person, which is played in real time"}
_addresses: dict[str, str] = {}  # whole ones, by what is left of them without their secrets
_SECRET = re.compile(r"[?#;&][^=]*(auth|key|login|pass|pw|secret|sig|token|user)[^=]*=", re.I)


def _forget_message(_settings: PropertyGroup, _context: Context) -> None:
    """Clear the error message, which was about another source."""
    state.message = ""


def _cameras(_settings: PropertyGroup, _context: Context, typed: str) -> list[str]:
    """Return the cameras whose number or name contains what was typed, with formats where these are
    known.
    """
    from ..job.live_cameras import list_cameras

    told = {
        (camera.number, camera.name): camera for camera in state.cameras.values() if camera.formats
    }
    labels = [told.get((c.number, c.name), c).label for c in list_cameras()]
    return [label for label in labels if typed.lower() in label.lower()]


def _keep_login(settings: PropertyGroup, _context: Context) -> None:
    """Take name and password out of the address, so that no .blend file contains them."""
    state.message = ""
    address = take_login(settings.stream)
    if address != settings.stream:
        settings.stream = address


@with_options(Place.LIVE_PANEL)
class SCOPE_PG_live(PropertyGroup):
    """The settings of live captures: the source, and the declared options."""

    source: EnumProperty(
        name="Source",
        items=(
            ("CAMERA", "Camera", "A camera of this computer", 0),
            ("STREAM", "Stream", "A network camera or another stream", 1),
            ("FILE", "File", "A video that is played in real time", 2),
        ),
        default="CAMERA",
        options=set(),
        update=_forget_message,
        description="Source of the images",
    )
    camera: StringProperty(
        name="Camera",
        default="0",
        options=set(),
        update=_forget_message,
        search=_cameras,
        search_options={"SUGGESTION"},
        description="Number of the camera, 0 for the first; on Linux also its device, such as "
        "/dev/video2",
    )
    stream: StringProperty(
        name="Address",
        options=set(),
        update=_keep_login,
        description="Address of the stream, such as rtsp://192.168.1.20/stream; name and password "
        "in it are kept until "
        "Blender ends, and never saved",
    )
    file: StringProperty(
        subtype="FILE_PATH", options=PATH_OPTIONS, update=_forget_message, **_VIDEO
    )
    file_text: path_text("file", **_VIDEO)
    with_rig: BoolProperty(
        name="Rig Follows",
        default=False,
        options=set(),
        description="Make the rig of the Retarget section follow as well",
    )
    countdown_s: IntProperty(
        name="Countdown (s)",
        default=0,
        min=0,
        max=60,
        soft_max=10,
        options=set(),
    )
    keep_footage: BoolProperty(
        name="Keep Footage",
        default=False,
        options=set(),
        description="Write the recorded images of a camera or stream as a video beside the .blend "
        "file, from which a "
        "more accurate motion of the same take can be captured",
    )
    with_scene: BoolProperty(
        name="Play Scene",
        default=False,
        options=set(),
        description="Play the scene's animation from the First Frame while recording",
    )


CLASSES = (SCOPE_PG_live,)


def attach() -> None:
    """Add the settings to every scene."""
    bpy.types.Scene.scope_live = PointerProperty(type=SCOPE_PG_live)


def detach() -> None:
    """Remove the settings."""
    del bpy.types.Scene.scope_live


class _State(JobState):
    """The running live capture, a LiveJob, and what cameras have told."""

    asking: Any = None  # a FormatsProcess, while a camera is asked for its formats
    cameras: ClassVar[dict[int, Any]] = {}  # that were asked, each a Camera, by number


state = _State()


def take_login(address: str) -> str:
    """Return an address without names, passwords and keys, and remember the whole one."""
    whole = address.strip()
    scheme, separator, public = whole.partition("://")
    if not separator:
        return address
    if has_login(public):
        place, mark, query = public.partition("?")
        is_before = "@" in place  # a password may have a question mark
        public = place.rpartition("@")[2] + mark + query if is_before else public.rpartition("@")[2]
    public = f"{scheme}://{public}"
    if _SECRET.search(public):
        public = display_address(public)
    if public == whole:
        return address
    _addresses[public] = whole
    return public


def with_login(address: str) -> str:
    """Return an address with what was taken out of it."""
    return _addresses.get(address, address)


def forget_logins() -> None:
    """Forget all of them."""
    _addresses.clear()
