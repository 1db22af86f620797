# SPDX-License-Identifier: GPL-3.0-or-later
"""Accuracy and speed of whole captures."""
