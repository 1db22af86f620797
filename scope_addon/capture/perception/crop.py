# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of the picture in which people are looked for."""

from __future__ import annotations

import re
from dataclasses import dataclass

from ...arrays import Uint8Array
from ...errors import UsageError

MIN_SIDE_PX = 32  # of a part; in a smaller one nobody is found


@dataclass(frozen=True)
class Crop:
    """A rectangle of the upright picture: its top left corner, width and height in pixels."""

    x: int
    y: int
    width: int
    height: int

    def cut(self, image_rgb: Uint8Array) -> Uint8Array:
        """Return this part of a picture (H, W, 3), as a view of its pixels."""
        return image_rgb[self.y : self.y + self.height, self.x : self.x + self.width]

    def check(self, width: int, height: int) -> None:
        """Check that the part lies within a picture of this size.

        :raises UsageError: it does not.
        """
        if self.x + self.width > width or self.y + self.height > height:
            raise UsageError(
                f"--crop {self} reaches beyond the footage, which has {width} x {height} pixels"
            )

    def __str__(self) -> str:
        """Write the part as the option has it."""
        return f"{self.x},{self.y},{self.width},{self.height}"


def parse_crop(text: str) -> Crop:
    """Parse "x,y,width,height" in pixels.

    :raises UsageError: the text is not four whole numbers, or the part is too small.
    """
    numbers = [number.strip() for number in text.split(",")]
    if len(numbers) != 4 or not all(re.fullmatch("[0-9]{1,6}", number) for number in numbers):
        raise UsageError(
            f"{text[:60]!r} is not a part of the picture: give x, y, width and height in pixels, "
            "such as 600,0,720,1080"
        )
    crop = Crop(*map(int, numbers))
    if min(crop.width, crop.height) < MIN_SIDE_PX:
        raise UsageError(f"--crop {crop} is too small: give at least {MIN_SIDE_PX} pixels a side")
    return crop
