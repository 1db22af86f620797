# SPDX-License-Identifier: GPL-3.0-or-later
"""The finished motion of a track, of which all frames are fitted together."""
