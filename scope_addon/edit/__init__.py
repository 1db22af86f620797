# SPDX-License-Identifier: GPL-3.0-or-later
"""Work on a motion after its capture, in plain numpy: smoothing, spans, floor, root motion, loops, keys. Never bpy."""
