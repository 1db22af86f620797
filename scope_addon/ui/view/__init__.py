# SPDX-License-Identifier: GPL-3.0-or-later
"""Looking at results: through the solved camera, at warnings, after undo."""
