# SPDX-License-Identifier: GPL-3.0-or-later
"""Train the lifting network of ``scope_addon/capture/perception/lifter.py`` on the body, posed by
motion recordings.

``train`` draws batches (``dataset``: poses from ``augment``, a camera, and detector errors from
``detector_noise``), fits ``network``, which ``measure`` evaluates and calibrates, and ``export``
writes the ONNX file. ``motions`` and ``split`` need no PyTorch.
"""
