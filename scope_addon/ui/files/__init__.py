# SPDX-License-Identifier: GPL-3.0-or-later
"""Files in the interface: their fields and browsers, and those that are dropped into a viewport."""
