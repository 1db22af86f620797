# SPDX-License-Identifier: GPL-3.0-or-later
"""Trains the lifting network of ``scope_addon/capture/perception/lifter.py`` on our body, posed by motion recordings.

``train`` draws batches (``dataset``: poses from ``augment``, a camera, and what a detector makes of it from
``detector_noise``), fits ``network``, and ``export`` writes the ONNX file. ``evaluate`` measures it.
"""
