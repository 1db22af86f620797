# SPDX-License-Identifier: GPL-3.0-or-later
"""Converting motions to Blender data. Uses bpy, but neither OpenCV nor onnxruntime."""
