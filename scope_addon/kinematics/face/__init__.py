# SPDX-License-Identifier: GPL-3.0-or-later
"""The face of the built-in bodies: expressions, teeth and tongue."""
