# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes and motions to files: .glb, .fbx, .blend, .bvh, .usdc."""
