# SPDX-License-Identifier: GPL-3.0-or-later
"""Live captures in a process of their own: poses come through its pipe, and commands go to it."""
