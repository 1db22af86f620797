# SPDX-License-Identifier: GPL-3.0-or-later
"""What the networks have found so far, on disk for a capture that is killed."""
