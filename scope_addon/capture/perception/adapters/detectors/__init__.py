# SPDX-License-Identifier: GPL-3.0-or-later
"""Person detectors: the output layouts of YOLO and MMDeploy exports."""
