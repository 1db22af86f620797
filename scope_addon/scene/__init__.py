# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion in, Blender data out. bpy lives here; OpenCV and onnxruntime never do."""
