# SPDX-License-Identifier: GPL-3.0-or-later
"""A captured body, and a rig, that follow a live capture without keys."""
