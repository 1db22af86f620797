# SPDX-License-Identifier: GPL-3.0-or-later
"""A capture as one HTML page for its user: overlay, 3D view, plots, warnings and figures, readable
offline.
"""
