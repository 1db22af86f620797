# SPDX-License-Identifier: GPL-3.0-or-later
"""The notebook runs from its first cell to its last, and shows what its text says."""

from __future__ import annotations

import ast
import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

NOTEBOOK = Path(__file__).resolve().parents[2] / "docs" / "first_capture.ipynb"


class Shown:
    """What Jupyter would show: the arguments of an object of IPython.display."""

    def __init__(self, content: str, **settings: Any) -> None:
        self.content = content


@pytest.fixture
def display(monkeypatch: pytest.MonkeyPatch) -> None:
    """IPython's display, which is not among the packages for tests."""
    module = ModuleType("IPython.display")
    for name in ("HTML", "IFrame", "Video"):
        setattr(module, name, type(name, (Shown,), {}))
    monkeypatch.setitem(sys.modules, "IPython", ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", module)


def run(cells: list[dict[str, Any]], names: dict[str, Any]) -> list[Any]:
    """Run the cells of code as Jupyter does; return the value of each one's last line."""
    values = []
    for cell in cells:
        if cell["cell_type"] == "code":
            tree = ast.parse("".join(cell["source"]))
            last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
            exec(compile(tree, "cell", "exec"), names)
            if isinstance(last, ast.Expr):
                values.append(eval(compile(ast.Expression(last.value), "cell", "eval"), names))
    return values


@pytest.mark.slow
@pytest.mark.usefixtures("display")
def test_the_notebook_captures_shows_fits_and_plots(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    content = json.loads(NOTEBOOK.read_text("utf-8"))
    assert all(not cell.get("outputs") for cell in content["cells"])
    cells = json.loads(json.dumps(content["cells"]).replace("END_S = 1.0", "END_S = 0.1"))
    names: dict[str, Any] = {}
    video, page, plot = run(cells, names)
    for shown in (video, page):
        assert Path(shown.content).stat().st_size > 1000
    fit = names["fit"]
    # In camera axes, z is the depth; one camera shows it least.
    deviations = np.sqrt(np.diagonal(fit.covariance_from_root[0], axis1=1, axis2=2))[1:]
    assert (deviations[:, 2].mean() > deviations[:, :2].mean(axis=0)).all()
    assert plot.content.count("<ellipse") == 2 * (names["body"].K + 1)
    drawn = fit.t_world_part[0] @ names["motion"]["intrinsics"].T
    truth = names["motion"]["joints_cam"][len(names["motion"]["frames"]) // 2]
    truth = truth @ names["motion"]["intrinsics"].T
    off_px = np.linalg.norm((drawn / drawn[:, 2:] - truth / truth[:, 2:])[:, :2], axis=1)
    assert off_px.mean() < 40  # of a person of some 500 pixels, from the image alone
