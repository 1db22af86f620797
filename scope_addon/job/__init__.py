# SPDX-License-Identifier: GPL-3.0-or-later
"""Capturing in a process of its own: request, worker, its parent's side, and the cache. Never bpy.

The parent writes one JSON request; the worker answers with JSON lines on stdout:

    {"event": "progress", "stage": str, "done": int, "total": int}     total 0: unknown
    {"event": "preview", "file": str, "width": int, "height": int, "frame": int}
    {"event": "result", "motions": [file name, ...], "report": {...}}
    {"event": "error", "message": str}

and dies when its stdin is closed, which happens whenever the parent does.
"""
