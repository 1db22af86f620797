# SPDX-License-Identifier: Apache-2.0
"""Fits of one frame, of many frames, and of a clip with one shape."""
