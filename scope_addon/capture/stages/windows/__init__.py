# SPDX-License-Identifier: GPL-3.0-or-later
"""Long clips, which are observed window by window: by one process in order, or by several at the same time."""
