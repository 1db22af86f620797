# SPDX-License-Identifier: GPL-3.0-or-later
"""Hands from frame to frame: whose they are, and which of those that are seen badly are
believed.
"""
