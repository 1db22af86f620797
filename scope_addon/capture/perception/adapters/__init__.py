# SPDX-License-Identifier: GPL-3.0-or-later
"""Networks of the user's own: each kind of graph has a file that recognises it and reads its outputs."""
