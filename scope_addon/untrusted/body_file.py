# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies from files of anyone: built-in ones by name, and users' models, .npz or .pkl.

A file is read here so that nothing in it is run and no more memory is taken than it has a right to;
``solver.body_file`` checks its arrays as it makes a ``Body`` of them.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ...solver.body_file import BUILT_IN, CHOICE, as_path, scope_body
from ...solver.body_file import load_body as load_trusted_body
from ...solver.errors import ModelFileError
from ...solver.names import BODY_JOINTS
from ...solver.smpl_family import REQUIRED, smpl_body
from .files import npz_keys, read_npz
from .pickles import read_pickle, to_array

_NUMERIC = (*REQUIRED, "shapedirs")
_TEXT = ("gender", "joint_names")


def load_body(which: str | Path = "scope") -> Body:
    """Load a body by name, from a .npz in the format of ours, or a user's model, as
    ``solver.load_body`` does; of a pickle nothing is run.

    :raises ModelFileError: the file is missing, not a person's body, or contradicts itself.
    :raises InvalidValueError: `which` is neither a name nor a path.
    """
    if str(which) in BUILT_IN:
        return load_trusted_body(which)
    path = as_path(which, "which, the name or file of a body,")
    # unlike Path.is_file also of names that are too long for the system
    if not os.path.isfile(path):
        raise ModelFileError(f"body '{which}' was not found: {CHOICE}")
    body = load_model(path) if is_user_model(path) else _load_own(path)
    if missing := [name for name in BODY_JOINTS if name not in body.joint_names]:
        raise ModelFileError(f"{path} has no joints {', '.join(missing)}: {CHOICE}")
    return body


def _load_own(path: Path) -> Body:
    """Load a body from a file in the format of ours.

    :raises ModelFileError: the file is not a body, or contradicts itself.
    """
    if is_motion(path):
        raise ModelFileError(
            f"{path} is a motion file, which holds how a body moves, not the body itself: {CHOICE}"
        )
    data = read_npz(path, ModelFileError, "body file")
    return replace(scope_body(data, path), file=str(path.resolve()))


def is_user_model(path: Path) -> bool:
    """Whether a file is one for ``load_model``: a pickle, or a .npz with a joint regressor. Cheap;
    reads no array.

    :raises ModelFileError: the file cannot be read.
    """
    if path.suffix.lower() in (".pkl", ".pickle"):
        return True
    return "J_regressor" in npz_keys(path, ModelFileError, "body file")


def is_motion(path: Path) -> bool:
    """Whether a .npz holds poses and no body, as AMASS's files and our own motions do. Cheap; reads
    no array.

    :raises ModelFileError: the file cannot be read.
    """
    keys = npz_keys(path, ModelFileError, "body file")
    return {"poses", "trans"} <= keys and "v_template" not in keys


def load_model(path: str | Path) -> Body:
    """Load a user's SMPL, SMPL+H, SMPL-X or STAR file, .npz or .pkl: see ``solver.smpl_family``.
    The file may be hostile; nothing in it is run.

    :raises ModelFileError: missing, unreadable, not a body, contradicts itself, or asks for more
        than arrays.
    """
    path = Path(path)
    if not path.is_file():
        raise ModelFileError(
            f"{path} does not exist; choose an SMPL, SMPL+H, SMPL-X or STAR file (.npz or .pkl)"
        )
    arrays = _read_tables(path)
    try:
        body = smpl_body(arrays, path)
    except MemoryError as cause:
        raise ModelFileError(
            f"{path} is too large for this computer's memory; choose a smaller body file"
        ) from cause
    return replace(body, file=str(path.resolve()))


def _read_tables(path: Path) -> dict[str, NDArray[Any]]:
    if npz_keys(path, ModelFileError, "body file"):
        wanted = (*_NUMERIC, *_TEXT, "posedirs")
        arrays = read_npz(path, ModelFileError, "body file", wanted=wanted)
        posedirs = arrays.pop("posedirs", np.zeros(())).shape
    else:
        content = read_pickle(path)
        try:
            arrays = {key: to_array(content[key]) for key in _NUMERIC if key in content}
            posedirs = to_array(content["posedirs"]).shape if "posedirs" in content else ()
            if isinstance(content.get("gender"), str | bytes):
                arrays["gender"] = to_array(content["gender"])
        except (ModelFileError, ValueError, TypeError, IndexError, OverflowError) as cause:
            raise ModelFileError(
                f"{path} cannot be used as a body: {cause}; get it from its publisher again"
            ) from None
    if posedirs:  # of which only the last extent is used
        arrays["posedirs"] = np.zeros((0, posedirs[-1]))
    return arrays
