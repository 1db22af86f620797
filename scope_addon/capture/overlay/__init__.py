# SPDX-License-Identifier: GPL-3.0-or-later
"""The captured bodies drawn over the footage."""
