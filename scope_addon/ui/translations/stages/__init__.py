# SPDX-License-Identifier: GPL-3.0-or-later
"""Stages of a capture and how long they take, in each language."""
