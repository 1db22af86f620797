# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of a live capture alone."""

from __future__ import annotations

from pathlib import Path

from .capture import QUALITIES
from .record import Argument, Option, Place, Property

MAX_PEOPLE = 4
_LIVE = Place.LIVE | Place.LIVE_WORKER

LIVE_OPTIONS = (
    Option(
        "live_quality",
        str,
        "fast",
        _LIVE | Place.LIVE_PANEL,
        "speed versus accuracy",
        choices=QUALITIES[:2],
        argument=Argument("--quality"),
        blender=Property("quality"),
    ),
    Option(
        "live_people",
        int,
        1,
        _LIVE | Place.LIVE_PANEL,
        "maximum number of people to follow; each one takes time",
        minimum=1,
        maximum=MAX_PEOPLE,
        argument=Argument("--people", "N"),
        blender=Property("people", "People"),
    ),
    Option(
        "list_formats",
        bool,
        False,
        Place.LIVE,
        "print the camera's name and formats, and capture nothing; on macOS, the camera is opened "
        "for that",
    ),
    Option(
        "record",
        Path,
        None,
        Place.LIVE,
        "motion file (.npz) to write at the end",
        argument=Argument(metavar="OUT"),
    ),
    Option(
        "keep_footage",
        Path,
        None,
        _LIVE,
        "video (.mp4) to which the recorded images are written",
        argument=Argument(metavar="VIDEO"),
    ),
    Option(
        "preview",
        bool,
        False,
        Place.LIVE,
        "serve a page on this computer that shows the footage with the skeletons over it",
    ),
    Option(
        "json_port",
        int,
        None,
        Place.LIVE,
        "TCP port on which poses are served as lines of JSON; 0: any free one",
        minimum=0,
        maximum=65535,
        argument=Argument(metavar="N"),
    ),
    Option(
        "listen",
        str,
        "127.0.0.1",
        Place.LIVE,
        "address on which --json-port listens; 0.0.0.0: every network that the computer is in",
        argument=Argument(metavar="ADDRESS"),
    ),
    Option(
        "vmc",
        str,
        None,
        Place.LIVE,
        "receiver of the poses in the VMC protocol, such as 127.0.0.1:39539",
        argument=Argument(metavar="HOST:PORT"),
    ),
    Option(
        "reconnect_s",
        float,
        2.0,
        _LIVE,
        "pause before an interrupted stream or camera is opened again; 0: the capture ends",
        unit="s",
        minimum=0.0,
        maximum=3600.0,
        argument=Argument("--reconnect", "SECONDS"),
    ),
)
