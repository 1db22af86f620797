# SPDX-License-Identifier: GPL-3.0-or-later
"""File formats of motion capture.

- ``asf_amc.py``: Acclaim skeleton and motion files (CMU)
- ``expmap.py``: comma-separated exponential-map values on the CMU skeleton
- ``deepmimic.py``: DeepMimic's humanoid motions (JSON)
- ``bvh.py``: joint positions of .bvh files
"""
