# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of importing motion files."""

from __future__ import annotations

from .record import Argument, Choice, Option, Place, Property

UP_AXES = (
    Choice("auto", "Automatic", "The axis along which the person is upright", 0),
    Choice("z", "Z", "Z points up, as in AMASS", 1),
    Choice("y", "Y", "Y points up, as in AIST++ and most engines", 2),
    Choice(
        "camera",
        "Camera (-Y)",
        "Y points down, as in the camera's axes of pose estimation networks",
        3,
    ),
)

IMPORT_OPTIONS = (
    Option(
        "up_axis",
        str,
        "auto",
        Place.IMPORT,
        "which way is up in the file; files written by Scope have z up",
        choices=UP_AXES,
        argument=Argument("--up"),
        blender=Property(label="Up"),
    ),
    Option(
        "motion_rate",
        float,
        0.0,
        Place.IMPORT,
        "frames per second, if the file does not state them; 0: 30",
        unit="frames per second",
        minimum=0.0,
        maximum=1000.0,
        argument=Argument(
            "--rate",
            "N",
            help="frames per second, if the file does not state them",
            default_text="30",
        ),
        blender=Property(label="Frame Rate"),
    ),
)
