# SPDX-License-Identifier: GPL-3.0-or-later
"""What a capture, editing and retargeting all need of a skeleton over time: axes, contact, smoothing, paths."""
