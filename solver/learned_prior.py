# SPDX-License-Identifier: Apache-2.0
"""The joint-state prior learned from motion capture: one flow for each joint, by name, read from
assets/prior.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .arrays import as_array, as_arrays, described
from .body_file import as_path, kept_arrays
from .errors import InvalidValueError, ModelFileError
from .part import Array
from .residuals import joint_flow
from .validation import check_count, check_list, check_type, check_weight

BUILT_IN = Path(__file__).resolve().parent.parent / "assets" / "prior" / "joint_prior.npz"


@dataclass(frozen=True)
class JointPrior:
    """Parameters (n, SIZE) of residuals/joint_flow.py for the joints ``names`` (n,), in SMPL's rest
    axes.
    """

    names: tuple[str, ...]
    parameters: Array

    def __post_init__(self) -> None:
        """Check the parameters.

        :raises ShapeError: they are not (n, SIZE), with one row for each name.
        :raises InvalidValueError: the names are not a list of strings.
        """
        check_list(self.names, "Names of the joint prior", "joint")
        for k, name in enumerate(self.names):
            check_type(name, str, f"Name {k} of the joint prior")
        object.__setattr__(self, "names", tuple(self.names))
        shape = len(self.names), joint_flow.SIZE
        object.__setattr__(
            self, "parameters", as_array(self.parameters, shape, "Parameters of the joint prior")
        )

    def of(self, joint: str) -> Array:
        """Return the parameters (SIZE,) of a joint.

        :raises InvalidValueError: the prior has no joint of that name.
        """
        known = ", ".join(self.names)
        if not isinstance(joint, str):
            raise InvalidValueError(
                f"joint must be a name, but is {described(joint)}; the prior has {known}."
            )
        if joint not in self.names:
            raise InvalidValueError(f"The prior has no joint {joint!r}; it has {known}.")
        row: Array = self.parameters[self.names.index(joint)]
        return row

    def tables(
        self, joint_names: Sequence[str], weights: Mapping[str, float] | None = None
    ) -> tuple[Array, Array]:
        """Return the tables of residuals/joint_flow.py for the joints of a body (K+1,) that have a
        prior.

        :param weights: w by joint name, 1 for joints that are missing.
        :return: (n, INTS) int64 and (n, FLOATS) float64.
        :raises InvalidValueError: a weight is negative or not a number, or `joint_names` is not a
            list of strings.
        """
        check_list(joint_names, "joint_names", "part")
        check_type(weights, (Mapping, type(None)), "weights")
        for name, weight in (weights or {}).items():
            check_weight(weight, f"The weight of {name!r}")
        for k, joint in enumerate(joint_names):
            check_type(joint, str, f"joint_names[{k}]")
        rows = [(i, name) for i, name in enumerate(joint_names) if i > 0 and name in self.names]
        w = np.array(
            [1.0 if weights is None else float(weights.get(name, 1.0)) for _, name in rows]
        )
        parameters = np.array([self.of(name) for _, name in rows]).reshape(
            len(rows), joint_flow.SIZE
        )
        return joint_flow.pack(np.array([i for i, _ in rows], np.int64), parameters, w)

    def sample(self, joint: str, count: int, rng: np.random.Generator) -> Array:
        """Return states (count, 3, 3) of a joint drawn from its prior.

        :raises InvalidValueError: the prior has no joint of that name, `count` is not a whole
            number of at least 0, or `rng` is not a numpy `Generator`.
        """
        check_count(count, "count", 0)
        check_type(rng, np.random.Generator, "rng")
        return joint_flow.invert(self.of(joint), rng.standard_normal((count, 3)))

    def log_density(self, joint: str, Omega: Array) -> Array:
        """Return the log density (...) of states (..., 3, 3) against the normalized Haar measure,
        in nats.

        :raises InvalidValueError: the prior has no joint of that name.
        :raises ShapeError: the states have another shape.
        """
        Omega = as_arrays(Omega, (3, 3), "Omega")
        return joint_flow.log_density(self.of(joint), Omega)


def load_joint_prior(path: str | Path = BUILT_IN) -> JointPrior:
    """Read a prior written by tools/train_prior.

    File: joint_names (n,) str, parameters (n, SIZE) f64, layers and hidden ().

    :raises ModelFileError: the file is missing, or no prior that the solver can evaluate.
    :raises InvalidValueError: `path` is neither a string nor a path.
    """
    path = as_path(path, "path, the file of a joint prior,").absolute()
    try:
        status = path.stat()
        changed = status.st_mtime_ns, status.st_size
    except (OSError, ValueError):  # `read_arrays` says what is wrong
        changed = 0, 0
    arrays = kept_arrays(path, "joint prior", changed)
    expected = {"layers": joint_flow.LAYERS, "hidden": joint_flow.HIDDEN}
    for key in ("joint_names", "parameters", *expected):
        if key not in arrays:
            raise ModelFileError(
                f"{path}: the joint prior has no array '{key}'; write it with tools/train_prior"
            )
    for key, value in expected.items():
        if arrays[key].shape != () or int(arrays[key]) != value:
            raise ModelFileError(
                f"{path}: the joint prior has {key} = {arrays[key]}, but the "
                f"solver evaluates {value}"
            )
    names = tuple(str(name) for name in np.ravel(arrays["joint_names"]))
    parameters = np.array(arrays["parameters"], dtype=np.float64, order="C")
    if parameters.shape != (len(names), joint_flow.SIZE) or not np.isfinite(parameters).all():
        raise ModelFileError(
            f"{path}: parameters of the joint prior must be finite and of shape ({len(names)}, "
            f"{joint_flow.SIZE}), "
            f"but have shape {parameters.shape}"
        )
    return JointPrior(names, parameters)
