# SPDX-License-Identifier: GPL-3.0-or-later
"""From video to motion. Uses OpenCV and onnxruntime, never bpy."""
