# SPDX-License-Identifier: GPL-3.0-or-later
"""Two people in front of four cameras: Pose2Sim's man, and a computer-generated woman beside
him.
"""
