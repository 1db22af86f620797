# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendered scenes of many people, with exact ground truth, and the accuracy of captures of them.

- ``people.py``: a moving person: motion, shape, size, clothes, hair
- ``scene.py``: people in front of a camera, what stands around, and the ground truth
- ``draw.py``: random scenes, reproducible by their number
- ``surroundings.py``, ``render.py``: the scenes in Blender
- ``accuracy.py``, ``statistics.py``: errors by groups of people and frames, with confidence
    intervals
"""
