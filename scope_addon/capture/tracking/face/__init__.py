# SPDX-License-Identifier: GPL-3.0-or-later
"""The face over time: tracking, and the calm motion of what the networks report."""
