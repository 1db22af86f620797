# SPDX-License-Identifier: GPL-3.0-or-later
"""Clips are observed window by window: a short one is one; those of a long one may be observed at
the same time.
"""
