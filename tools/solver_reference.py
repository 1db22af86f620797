# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m scope.tools.solver_reference``: write docs/solver_api.md from the solver's source.

Every name of ``scope.solver.__all__`` appears exactly once, with its parameters and docstring. A
test compares the page with this tool's output.
"""

from __future__ import annotations

import ast
import inspect
import sys
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .. import solver
from ..solver import rotations

PAGE = Path(__file__).resolve().parents[1] / "docs" / "solver_api.md"
_INTRODUCTION = """\
# The solver: API

Everything here is importable from `scope.solver`, which needs numpy and numba only. `pip install
CHECKOUT`, with the folder of this repository, installs it in an environment of your own (Python
3.11 or newer), with its bodies and joint prior; Scope is in no package index. The first fit
compiles the solver, for a minute or two. [Mathematics](solver_mathematics.md) explains the
equations, and the [glossary](glossary.md) the terms. This page is written by `python -m
scope.tools.solver_reference` from the docstrings; edit those.

Lengths are in metres and angles in radians. Camera axes are OpenCV's (x right, y down, z forward).
Pixels are those of the image that the intrinsics belong to. There are K joints besides the root, P
shape coefficients, M keypoints of the body and N measurements.

## Example

```python
from scope import solver

body = solver.load_body("scope")  # or your own SMPL.npz
index = list(body.keypoint_set("coco").values())[:17]  # COCO's 17 points
keypoints = solver.Keypoints2D(index, pixels, confidence)
fit = solver.fit(body, solver.Measurements(K, keypoints2d=keypoints))
fits = solver.fit_batch(body, frames)  # independent frames, on all cores
clip = solver.fit_clip(body, frames)  # one shape for all frames
motion = solver.fit_motion(body, frames, times)  # and little acceleration between them
print(fit.status, fit.t_camera_part, fit.state.beta)  # why it stopped, joints in camera axes, shape
```

`K` is the (3, 3) camera matrix, `pixels` (17, 2), `confidence` (17,), `frames` a list of
`Measurements` and `times` their times in seconds. For several calibrated cameras, a frame is a list
of one `View` for each. `fit_motion(body, [measurements], [0.0], covariance=True)` gives the
covariance of the joints of a single frame. Results can be pickled, and their arrays saved with
`np.savez`; `State(*arrays)` is where a later fit can start (`init`). `solver/examples/` fits 3D
joints, 2D keypoints, a marker set, an SMPL+H hand and a clip from three cameras, and refines a
regression network's output:

```sh
.venv/bin/python -m scope.solver.examples.from_markers
```
"""
# Headings, and the names below each. Names not listed here come last.
_SECTIONS = {
    "Body models": ("load_body", "Body", "BodyArrays", "Tree", "make_tree"),
    "Measurements": (
        "Measurements",
        "Keypoints2D",
        "Keypoints3D",
        "OrientationField",
        "PosePriors",
        "FootContacts",
        "Floor",
        "View",
        "StandingPoints",
    ),
    "Fitting": (
        "fit",
        "fit_batch",
        "fit_clip",
        "fit_clips",
        "fit_motion",
        "FrameSolver",
        "fit_tree",
        "carry",
    ),
    "Residuals of your own": ("register_residual", "check_residual"),
    "Options and priors": (
        "Options",
        "Stage",
        "Weights",
        "COLD_STAGES",
        "WARM_STAGES",
        "Priors",
        "default_priors",
        "JointPrior",
        "load_joint_prior",
        "Temporal",
        "with_previous",
        "MotionPrior",
    ),
    "Results": ("Fit", "ClipFit", "MotionFit", "State", "Status"),
}
_ERRORS = "Errors"
_ROTATIONS = "Rotations"
_OTHER = "Other names"


def reference() -> str:
    """Return the page as Markdown."""
    listed = [name for names in _SECTIONS.values() for name in names]
    errors = sorted(name for name in solver.__all__ if _is_error(getattr(solver, name)))
    sections = {
        heading: [n for n in names if n in solver.__all__] for heading, names in _SECTIONS.items()
    }
    sections[_ERRORS] = [name for name in errors if name not in listed]
    sections[_OTHER] = sorted(set(solver.__all__) - set(listed) - set(errors))
    parts = [_INTRODUCTION]
    for heading, names in sections.items():
        if names:
            parts += [f"## {heading}\n", *(_entry(name, getattr(solver, name)) for name in names)]
    parts.append(f"## {_ROTATIONS}\n\nFunctions of `scope.solver.rotations`.\n")
    parts += [_entry(f"rotations.{name}", function) for name, function in _functions(rotations)]
    return "\n".join(parts)


def _entry(name: str, value: Any) -> str:
    """Return the heading of one name and, as a block of text, its parameters and docstring."""
    if inspect.isclass(value):
        lines = _class(value)
    elif inspect.isfunction(inspect.unwrap(value)):
        lines = _function(inspect.unwrap(value))
    else:
        kind = (
            f"tuple of {len(value)} {type(value[0]).__name__}"
            if isinstance(value, tuple)
            else type(value).__name__
        )
        lines = [f"{name.split('.')[-1]}: {kind}"]
    text = "\n".join(lines).rstrip()
    return f"### {name}\n\n```text\n{text}\n```\n"


def _function(function: Any) -> list[str]:
    """Return signature and docstring."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(tree, ast.FunctionDef)
    return [*_signature(tree), *_documentation(tree)]


def _class(cls: type) -> list[str]:
    """Return the docstring, fields with their comments, and public methods and properties that have
    a docstring.
    """
    source = textwrap.dedent(inspect.getsource(cls)).splitlines()
    tree = ast.parse("\n".join(source)).body[0]
    assert isinstance(tree, ast.ClassDef)
    lines = [cls.__name__, *_documentation(tree)]
    fields = [node for node in tree.body if isinstance(node, ast.AnnAssign | ast.Assign)]
    if fields:
        lines.append("")
    for assignment in fields:
        lines += source[assignment.lineno - 1 : assignment.end_lineno]
    for node in tree.body:
        if (
            isinstance(node, ast.FunctionDef)
            and not node.name.startswith("_")
            and ast.get_docstring(node)
        ):
            lines += ["", *_indented(_signature(node)), *_indented(_documentation(node))]
    return lines


def _signature(node: ast.FunctionDef) -> list[str]:
    """Return the name with its parameters and result, in one line where it fits."""
    names = {d.id for d in node.decorator_list if isinstance(d, ast.Name)}
    result = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    if names & {"property", "cached_property"}:
        return [f"{node.name}{result}"]
    arguments = node.args
    if "staticmethod" not in names and arguments.args and arguments.args[0].arg in ("self", "cls"):
        arguments.args = arguments.args[1:]
    line = f"{node.name}({ast.unparse(arguments)}){result}"
    return textwrap.wrap(
        line, 112, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False
    )


def _documentation(node: ast.FunctionDef | ast.ClassDef) -> list[str]:
    """Return the docstring, indented."""
    text = ast.get_docstring(node)
    return _indented(text.splitlines()) if text else []


def _functions(module: Any) -> list[tuple[str, Any]]:
    """Return the public functions that take arrays; kernels are called by other kernels only."""
    return [
        (name, value)
        for name, value in vars(module).items()
        if inspect.isfunction(value)
        and value.__module__ == module.__name__
        and not name.startswith("_")
    ]


def _is_error(value: Any) -> bool:
    return inspect.isclass(value) and issubclass(value, BaseException)


def _indented(lines: Iterable[str]) -> list[str]:
    return [f"    {line}".rstrip() for line in lines]


def main() -> int:
    """Write the page."""
    PAGE.write_text(reference(), encoding="utf-8")
    print(f"{PAGE}: {len(solver.__all__)} names")
    return 0


if __name__ == "__main__":
    sys.exit(main())
