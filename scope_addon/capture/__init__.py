# SPDX-License-Identifier: GPL-3.0-or-later
"""From video to motion. Uses OpenCV and onnxruntime, never bpy."""

import os

from ..footage import MAX_PIXELS

# OpenCV reads this once, while it is loaded, and compares it with an image's header before it takes
# memory for it.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MAX_PIXELS))
