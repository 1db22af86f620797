# SPDX-License-Identifier: GPL-3.0-or-later
"""The door for files that others have made: each is checked here once, before it is used."""
