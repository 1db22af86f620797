# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures in a separate process: the request, the worker, the parent's side, and the cache. Never
imports bpy.

The parent sends one JSON request; the worker answers with JSON lines on stdout:

    {"event": "progress", "stage": str, "done": int, "total": int}     total 0: unknown
    {"event": "preview", "file": str, "width": int, "height": int, "frame": int}
    {"event": "result", "motions": [file name, ...], "report": {...}}
    {"event": "error", "message": str}

The worker ends when its stdin is closed, which also happens when the parent ends.
"""
