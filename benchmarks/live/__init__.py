# SPDX-License-Identifier: GPL-3.0-or-later
"""Live captures: rate and latency, accuracy against the offline capture, and whether anything
drifts in an hour.

- ``clips.py``: footage that goes on for as long as it is wanted
- ``observed.py``: what the networks find in it, once, for as many frames as are wanted
- ``measures.py``: how two motions of the same footage differ
- ``paced.py``: live captures on a simulated machine of known speed
- ``rate.py``, ``offline.py``, ``endurance.py``: the measurements
- ``live.py``: the command, and its tables
"""
