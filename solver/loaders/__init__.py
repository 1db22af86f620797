# SPDX-License-Identifier: GPL-3.0-or-later
"""Body files that users bring themselves: SMPL (.npz, .pkl), SMPL+H, SMPL-X and STAR, all treated
as hostile input.

body_file.py   load_body(which) -> Body: the built-in ones, our own format, users' models
model_file.py  load_model(path) -> Body: which reader, which family, shapes checked
arrays.py      what a body file's arrays must hold
keypoints.py   the SMPL family's joints and vertex numbers, and keypoints for a mesh without any
files.py       what is checked before a file is read, and the arrays of .npz files of any origin
pickles.py     Python's unpickler, kept from importing or calling what the file names
"""

from .body_file import load_body
from .model_file import is_motion, is_user_model, load_model

__all__ = ["is_motion", "is_user_model", "load_body", "load_model"]
