# SPDX-License-Identifier: GPL-3.0-or-later
"""The Capture tab: settings, the modal job, its preview and its result."""
