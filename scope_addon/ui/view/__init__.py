# SPDX-License-Identifier: GPL-3.0-or-later
"""Viewing results: through the estimated camera, at warnings, after undo."""
