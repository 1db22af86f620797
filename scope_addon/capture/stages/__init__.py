# SPDX-License-Identifier: GPL-3.0-or-later
"""The stages of a capture, one module each; `pipeline` gives their order."""
