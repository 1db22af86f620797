# SPDX-License-Identifier: GPL-3.0-or-later
"""The mesh of the body: vertices, materials, skinning weights."""
