# SPDX-License-Identifier: GPL-3.0-or-later
"""Scope: markerless motion capture. Imports nothing until it is asked to, so that ``scope.solver`` needs no bpy."""
