# SPDX-License-Identifier: GPL-3.0-or-later
"""Body files that users bring themselves: SMPL (.npz, .pkl), SMPL+H, SMPL-X and STAR, all treated
as hostile input.

body_file.py          load_body(which) -> Body: the built-in ones, our own format, users' models
arrays.py             what a body file's arrays must hold
regular_file.py       no pipes, no devices, nothing too large
npz.py                reading .npz files of any origin
model_file.py         load_model(path) -> Body: which reader, which family, shapes checked
skeletons.py          joint names, trees and vertex numbers of the SMPL family
archive.py            the wanted arrays of a .npz, without unpickling
restricted_pickle.py  Python's unpickler, kept from importing or calling what the file names
pickled_values.py     what it builds instead: arrays, sparse matrices, chumpy arrays
keypoints.py          detector keypoints for a mesh that has none
landmarks.py          face, foot and fingertip points from vertex numbers or from geometry
"""

from .body_file import load_body
from .model_file import is_motion, is_user_model, load_model

__all__ = ["is_motion", "is_user_model", "load_body", "load_model"]
