# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of decoded frames to what the networks know, such as HDR to SDR."""
