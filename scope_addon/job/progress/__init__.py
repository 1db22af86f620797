# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a capture is, and how long it still takes."""
