# SPDX-License-Identifier: GPL-3.0-or-later
"""Crop the pictures of docs/guide.md and docs/live.md (assets/guide) from the screenshots of a real
Blender, and join those of the tour to the README's moving picture.
"""

from pathlib import Path

import cv2
from scope.tools.readme_pictures.animation import LARGEST_BYTES, write_webp

# Name of the picture: screenshot, and the part of it to show (left, top, right, bottom in pixels).
PICTURES = {
    "footage": ("2_footage_chosen", (1000, 60, 1330, 280)),
    "capturing": ("9_body_over_footage", (700, 60, 1330, 560)),
    "live": ("23_live_recording", (400, 25, 1330, 800)),
    "result": ("6_result", (1000, 60, 1330, 886)),
    "compared": ("7_compared_with_footage", (0, 25, 1330, 900)),
    "export": ("8_export_window", (230, 165, 1370, 850)),
    "preferences": ("11_preferences", (830, 36, 1518, 572)),
}
_SCALE = 0.6  # of wide pictures
_MAX_BYTES = 60_000
_TOUR_SIZE = (880, 550)  # of a screen of 1600 x 1000
_TOUR_RATE = 7.5  # pictures a second: every fourth frame of the sample
ROOT = Path(__file__).resolve().parents[3]

made = []
for name, (screenshot, (left, top, right, bottom)) in PICTURES.items():
    whole = cv2.imread(str(ROOT / "build" / "screenshots" / f"{screenshot}.png"))
    if whole is None:  # the part of ./scripts/blender that takes it was not run
        continue
    picture = whole[top:bottom, left:right]
    if picture.shape[1] > 1000:
        picture = cv2.resize(picture, None, fx=_SCALE, fy=_SCALE, interpolation=cv2.INTER_AREA)
    for quality in range(85, 20, -5):
        jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
        if len(jpeg) <= _MAX_BYTES:
            break
    (ROOT / "assets" / "guide" / f"{name}.jpg").write_bytes(jpeg)
    made.append(name)
tour = sorted((ROOT / "build" / "screenshots").glob("tour_*.png"))
if tour:
    frames = []
    for path in tour:
        small = cv2.resize(cv2.imread(str(path)), _TOUR_SIZE, interpolation=cv2.INTER_AREA)
        frames.append(cv2.cvtColor(small, cv2.COLOR_BGR2RGB))
    webp = ROOT / "assets" / "pictures" / "blender.webp"
    write_webp(webp, frames, _TOUR_RATE, LARGEST_BYTES["blender"])
    made.append(webp.name)
print(f"New in assets/guide: {', '.join(made)}. Look at them.")
