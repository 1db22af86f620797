# SPDX-License-Identifier: GPL-3.0-or-later
"""Around the plain observation of a clip: what was found is kept on disk, so that a capture that
was killed goes on; long clips are observed in windows, also by several processes.
"""
