# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the poses of a live capture go."""
