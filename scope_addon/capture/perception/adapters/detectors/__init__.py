# SPDX-License-Identifier: GPL-3.0-or-later
"""Person detectors: exports of YOLO and MMDeploy."""
