# SPDX-License-Identifier: GPL-3.0-or-later
"""Video in, motion out. OpenCV and onnxruntime live here; bpy never does."""
