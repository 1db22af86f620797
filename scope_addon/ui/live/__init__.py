# SPDX-License-Identifier: GPL-3.0-or-later
"""Live captures: the panel section, its operators and settings, and the running capture."""
