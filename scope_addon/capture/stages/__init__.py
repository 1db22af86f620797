# SPDX-License-Identifier: GPL-3.0-or-later
"""The stages of a capture, one module each, in the order of ``pipeline.py``."""
