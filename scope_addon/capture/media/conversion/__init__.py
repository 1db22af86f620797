# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of decoded frames to what the networks know: HDR to SDR, fields to whole images."""
