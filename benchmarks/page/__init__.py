# SPDX-License-Identifier: GPL-3.0-or-later
"""One HTML page about this machine: what the benchmarks print here, as tables, with plots, overlays
and a 3D view.
"""
