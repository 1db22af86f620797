# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's own SMPL and SMPL-X files, by which data sets state ground truth, and the regressor of
joints.

Like every body of Scope, they are used without pose correctives, on both sides of a comparison:
these move vertices near bent joints, never the joints of the skeleton.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.untrusted.body_file import load_body
from ...solver.body import Body
from ...solver.rotations import exp
from .files import DatasetError, read_matrix
from .joint_sets import REGRESSED17
from .subjects import PosedBody

# Names under which the publisher's files are known, by model and gender.
_SUFFIXES = (".npz", ".pkl")
_LETTERS = {"neutral": "neutral", "male": "m", "female": "f"}
_STEMS: dict[tuple[str, str], tuple[str, ...]] = {
    ("smplx", gender): (f"SMPLX_{gender.upper()}",) for gender in _LETTERS
}
for _gender, _letter in _LETTERS.items():
    _old = tuple(
        f"basic{m}odel_{_letter}_lbs_10_207_0_v1.{v}"
        for m, v in (("M", "0.0"), ("m", "0.0"), ("m", "1.0"))
    )
    _STEMS["smpl", _gender] = (f"SMPL_{_gender.upper()}", *_old)


class Models:
    """The user's body files and regressor.

    :param folder: of SMPL and SMPL-X files; None if the user has none.
    :param regressor: a .npy file of 17 rows, which gives `REGRESSED17` from SMPL's vertices; None
        for none.
    :raises DatasetError: the folder does not exist, or the regressor cannot be used.
    """

    def __init__(self, folder: Path | None = None, regressor: Path | None = None) -> None:
        if folder is not None and not folder.is_dir():
            raise DatasetError(
                f"{folder} is not a folder; give the one with the files of SMPL or SMPL-X"
            )
        self.folder = folder
        self.regressor = (
            None if regressor is None else read_matrix(regressor, (len(REGRESSED17), None))
        )
        self._load = cache(load_body)

    def body(self, model: str, gender: str, dataset: str) -> Body:
        """Return a body of the user's.

        :param model: ``smpl`` or ``smplx``.
        :param dataset: what needs it, for the message.
        :raises DatasetError: there is no such file.
        :raises ModelFileError: it cannot be used.
        """
        names = [f"{stem}{suffix}" for stem in _STEMS[model, gender] for suffix in _SUFFIXES]
        if self.folder is None:
            raise DatasetError(
                f"the ground truth of {dataset} is stated as parameters of {model.upper()}: give "
                "the folder of its "
                f"files, with {names[0]} in it, as --smpl FOLDER"
            )
        found = [path for path in (self.folder / name for name in names) if path.is_file()]
        if not found:
            raise DatasetError(
                f"{self.folder} holds none of {', '.join(names)}, which {dataset} needs"
            )
        return self._load(found[0])

    def regressor_for(self, body: Body) -> NDArray[np.float64] | None:
        """Return the regressor (17, V) if it is for this body's vertices."""
        fits = self.regressor is not None and self.regressor.shape[1] == len(body.v_template)
        return self.regressor if fits else None


def pose_body(
    body: Body,
    poses: NDArray[np.float64],
    betas: NDArray[np.float64],
    trans: NDArray[np.float64],
    regressor: NDArray[np.float64] | None = None,
) -> PosedBody:
    """Return a body posed by SMPL's parameters: pelvis = J_0(β) + trans.

    :param poses: (T, 3J) axis-angle; joints beyond J rest.
    :param betas: (B,); coefficients that the body or the file lacks are zero.
    :param trans: (T, 3) metres.
    :param regressor: (17, V).
    """
    shape = np.zeros(body.P)
    shape[: min(body.P, len(betas))] = betas[: body.P]
    vectors = np.zeros((len(poses), body.K + 1, 3))
    given = poses.reshape(len(poses), -1, 3)[:, : body.K + 1]
    vectors[:, : given.shape[1]] = given
    return PosedBody(body, shape, exp(vectors), body.rest_joints(shape)[0] + trans, regressor)
