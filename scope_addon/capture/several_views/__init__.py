# SPDX-License-Identifier: GPL-3.0-or-later
"""Several cameras that film the same people: their clocks, their places, and one motion from all
of them.
"""
