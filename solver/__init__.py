# SPDX-License-Identifier: GPL-3.0-or-later
"""The body model and the sparse constrained solver. numpy and numba only.

body = load_body("scope")
fit(body, Measurements(intrinsics, keypoints2d=Keypoints2D(indices, pixels, confidence))) -> Fit
"""

from .body import Body
from .compiled.tree import BodyArrays, Tree, make_tree
from .errors import InputError, InvalidValueError, ModelFileError, ScopeError, ScopeWarning, ShapeError, UnitsWarning
from .fitting.batch import fit_batch, fit_clips
from .fitting.clip import carry, fit_clip
from .fitting.frame_solver import FrameSolver, fit, fit_tree
from .learned_prior import JointPrior, load_joint_prior
from .loaders import load_body
from .measurements import Floor, FootContacts, Keypoints2D, Keypoints3D, Measurements, OrientationField, PosePriors
from .motion.fit import MotionFit, fit_motion
from .motion.prior import MotionPrior, StandingPoints
from .motion.views import View
from .options import COLD_STAGES, WARM_STAGES, Options, Priors, Stage, Weights, default_priors
from .residuals.registry import register_residual
from .state import ClipFit, Fit, State, Status
from .temporal import Temporal, with_previous

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
