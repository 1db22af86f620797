# SPDX-License-Identifier: GPL-3.0-or-later
"""Which files are footage, by their names. Imports nothing, so that menus and command lines can ask."""

VIDEO_SUFFIXES = (
    *(".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".wmv", ".mts", ".m2ts", ".ts", ".3gp", ".gif"),
)
PICTURE_SUFFIXES = (".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff", ".bmp")
FOOTAGE_SUFFIXES = VIDEO_SUFFIXES + PICTURE_SUFFIXES
