# SPDX-License-Identifier: GPL-3.0-or-later
"""Adapters of the user's own networks: person detectors (exports of YOLO and MMDeploy) and keypoint
networks.
"""
