# SPDX-License-Identifier: GPL-3.0-or-later
"""The captured character: armature, mesh, shape keys, keyframes."""
