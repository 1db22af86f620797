# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys that follow the corrections of the captured motion, and the keys from before them."""
