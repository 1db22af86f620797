# SPDX-License-Identifier: GPL-3.0-or-later
"""The body model and the sparse constrained solver. numpy and numba only.

body = load_body("scope")
fit(body, Measurements(intrinsics, keypoints2d=Keypoints2D(indices, pixels, confidence))) -> Fit

A name's module is imported when the name is first used: numba takes a third of a second to load,
and the errors, the body files and the command line do without it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import rotations as rotations
    from .body import Body
    from .errors import (
        InputError,
        InvalidValueError,
        ModelFileError,
        ScopeError,
        ScopeWarning,
        ShapeError,
        UnitsWarning,
    )
    from .fitting.batch import fit_batch, fit_clips
    from .fitting.clip import carry, fit_clip
    from .fitting.frame_solver import FrameSolver, fit, fit_tree
    from .fitting.residual_check import check_residual
    from .learned_prior import JointPrior, load_joint_prior
    from .loaders import load_body
    from .measurements import (
        Floor,
        FootContacts,
        Keypoints2D,
        Keypoints3D,
        Measurements,
        OrientationField,
        PosePriors,
    )
    from .motion.fit import MotionFit, fit_motion
    from .motion.prior import MotionPrior, StandingPoints
    from .motion.views import View
    from .options import COLD_STAGES, WARM_STAGES, Options, Priors, Stage, Weights, default_priors
    from .residuals.registry import register_residual
    from .state import ClipFit, Fit, State, Status
    from .temporal import Temporal, with_previous
    from .tree import BodyArrays, Tree, make_tree


__all__ = [
    "COLD_STAGES",
    "WARM_STAGES",
    "Body",
    "BodyArrays",
    "ClipFit",
    "Fit",
    "Floor",
    "FootContacts",
    "FrameSolver",
    "InputError",
    "InvalidValueError",
    "JointPrior",
    "Keypoints2D",
    "Keypoints3D",
    "Measurements",
    "ModelFileError",
    "MotionFit",
    "MotionPrior",
    "Options",
    "OrientationField",
    "PosePriors",
    "Priors",
    "ScopeError",
    "ScopeWarning",
    "ShapeError",
    "Stage",
    "StandingPoints",
    "State",
    "Status",
    "Temporal",
    "Tree",
    "UnitsWarning",
    "View",
    "Weights",
    "carry",
    "check_residual",
    "default_priors",
    "fit",
    "fit_batch",
    "fit_clip",
    "fit_clips",
    "fit_motion",
    "fit_tree",
    "load_body",
    "load_joint_prior",
    "make_tree",
    "register_residual",
    "with_previous",
]

# What is imported from which module, as above. mypy compares the imports above with `__all__`, and
# a test these.
_HOMES = {
    "body": "Body",
    "tree": "BodyArrays Tree make_tree",
    "errors": "InputError InvalidValueError ModelFileError ScopeError ScopeWarning ShapeError "
    "UnitsWarning",
    "fitting.batch": "fit_batch fit_clips",
    "fitting.clip": "carry fit_clip",
    "fitting.frame_solver": "FrameSolver fit fit_tree",
    "fitting.residual_check": "check_residual",
    "learned_prior": "JointPrior load_joint_prior",
    "loaders": "load_body",
    "measurements": "Floor FootContacts Keypoints2D Keypoints3D Measurements OrientationField "
    "PosePriors",
    "motion.fit": "MotionFit fit_motion",
    "motion.prior": "MotionPrior StandingPoints",
    "motion.views": "View",
    "options": "COLD_STAGES WARM_STAGES Options Priors Stage Weights default_priors",
    "residuals.registry": "register_residual",
    "state": "ClipFit Fit State Status",
    "temporal": "Temporal with_previous",
}
_MODULE_OF = {name: module for module, names in _HOMES.items() for name in names.split()}

if not TYPE_CHECKING:  # or a name that does not exist would pass

    def __getattr__(name: str) -> Any:
        """Import a name of `__all__`, or the module `rotations`, when it is first used (PEP
        562).
        """
        if name == "rotations":
            return import_module(f".{name}", __name__)
        if name not in _MODULE_OF:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(import_module(f".{_MODULE_OF[name]}", __name__), name)
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__, "rotations"})
