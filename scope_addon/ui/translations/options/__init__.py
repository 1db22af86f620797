# SPDX-License-Identifier: GPL-3.0-or-later
"""Labels and tooltips of the options of a capture."""
