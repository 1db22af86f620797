# SPDX-License-Identifier: Apache-2.0
"""The body model and the sparse constrained solver. numpy and numba only.

body = load_body("scope")
fit(body, Measurements(intrinsics, keypoints2d=Keypoints2D(indices, pixels, confidence))) -> Fit

A name's module is imported when the name is first used: numba takes a third of a second to load,
and the errors, the body files and the command line do without it.
"""

import ast
import tomllib
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # the public names and their modules, in the only place that lists them
    from . import kernels as kernels
    from . import rotations as rotations
    from .body import Body as Body
    from .body_file import load_body as load_body
    from .errors import InputError as InputError
    from .errors import InvalidValueError as InvalidValueError
    from .errors import ModelFileError as ModelFileError
    from .errors import ScopeError as ScopeError
    from .errors import ScopeWarning as ScopeWarning
    from .errors import ShapeError as ShapeError
    from .errors import UnitsWarning as UnitsWarning
    from .fitting.clip import carry as carry
    from .fitting.clip import fit_clip as fit_clip
    from .fitting.derivatives import SolutionDerivatives as SolutionDerivatives
    from .fitting.derivatives import solution_derivatives as solution_derivatives
    from .fitting.derivatives import solution_gradient as solution_gradient
    from .fitting.frame_solver import FrameSolver as FrameSolver
    from .fitting.frame_solver import fit as fit
    from .fitting.frame_solver import fit_batch as fit_batch
    from .fitting.frame_solver import fit_tree as fit_tree
    from .fitting.normal_equations import GaussNewtonStep as GaussNewtonStep
    from .fitting.normal_equations import NormalEquations as NormalEquations
    from .fitting.normal_equations import check_residual as check_residual
    from .fitting.normal_equations import gauss_newton_step as gauss_newton_step
    from .fitting.normal_equations import linearize as linearize
    from .learned_prior import JointPrior as JointPrior
    from .learned_prior import load_joint_prior as load_joint_prior
    from .measurements import Floor as Floor
    from .measurements import FootContacts as FootContacts
    from .measurements import Keypoints2D as Keypoints2D
    from .measurements import Keypoints3D as Keypoints3D
    from .measurements import Measurements as Measurements
    from .measurements import OrientationField as OrientationField
    from .measurements import PosePriors as PosePriors
    from .motion.fit import MotionFit as MotionFit
    from .motion.fit import fit_motion as fit_motion
    from .motion.prior import MotionPrior as MotionPrior
    from .motion.prior import StandingPoints as StandingPoints
    from .motion.views import View as View
    from .options import COLD_STAGES as COLD_STAGES
    from .options import WARM_STAGES as WARM_STAGES
    from .options import Options as Options
    from .options import Priors as Priors
    from .options import Stage as Stage
    from .options import Weights as Weights
    from .options import default_priors as default_priors
    from .points import frames_of as frames_of
    from .residuals.registry import register_residual as register_residual
    from .state import ClipFit as ClipFit
    from .state import Fit as Fit
    from .state import State as State
    from .state import Status as Status
    from .tree import BodyArrays as BodyArrays
    from .tree import Tree as Tree
    from .tree import make_tree as make_tree

    __all__: list[str]
    __version__: str

if not TYPE_CHECKING:

    def _modules_of_names() -> dict[str, str]:
        """Return the module of each public name: what a type checker imports above."""
        tree = ast.parse(Path(__file__).read_text("utf-8"))
        imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        return {
            alias.name: node.module or alias.name
            for node in imports
            if node.level
            for alias in node.names
        }

    _MODULE_OF = _modules_of_names()
    __all__ = sorted(name for name, module in _MODULE_OF.items() if name != module)

    def __getattr__(name: str) -> Any:
        """Import a public name, or one of the modules above, when it is first used (PEP 562)."""
        if name == "__version__":
            return _version()
        if name not in _MODULE_OF:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        module = import_module(f".{_MODULE_OF[name]}", __name__)
        value = module if name == _MODULE_OF[name] else getattr(module, name)
        globals()[name] = value
        return value

    def _version() -> str:
        """Return the version of Scope: the extension's manifest states it, the wheel's metadata."""
        manifest = Path(__file__).parents[1] / "blender_manifest.toml"
        if manifest.is_file():
            return str(tomllib.loads(manifest.read_text("utf-8"))["version"])
        from importlib import metadata  # which takes long to load, as Blender starts

        try:
            return metadata.version("scope-solver")
        except metadata.PackageNotFoundError:
            return metadata.version("scope-mocap")

    def __dir__() -> list[str]:
        return sorted({*globals(), *_MODULE_OF, "__version__"})
