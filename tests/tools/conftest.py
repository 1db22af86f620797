# SPDX-License-Identifier: GPL-3.0-or-later
"""The body's source, which takes seconds to read and to shape."""

from __future__ import annotations

import os
import pickle
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from scope.tools.build_body import population
from scope.tools.build_body.build import ShapedMesh, shape_mesh
from scope.tools.build_body.geometry.growth import with_growth
from scope.tools.build_body.source import fetch_wheel
from scope.tools.build_body.survey_targets import SurveyTargets, read_survey_targets


@pytest.fixture(scope="module")
def shaped() -> ShapedMesh:
    return shape_mesh()


@pytest.fixture(scope="module")
def targets(shaped: ShapedMesh) -> SurveyTargets:
    return read_survey_targets(fetch_wheel(), shaped.source)


@pytest.fixture(scope="module")
def one_solver(shaped: ShapedMesh, targets: SurveyTargets) -> Iterator[None]:
    """One solver for all people: to make it takes a second, and to solve changes nothing in it."""
    solver = population._Solver(shaped.source, targets)

    def made_before(source: Any, given: Any) -> population._Solver:
        assert source is shaped.source
        assert given is targets
        return solver

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(population, "_Solver", made_before)
        yield


@pytest.fixture(scope="module")
def grown(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> ShapedMesh:
    """The mesh with growth, without the targets of its source, which are nine tenths of it: once
    for all processes.
    """
    folder = tmp_path_factory.getbasetemp()
    # this process's folder lies in the one of the whole run
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    path = folder / "grown.pickle"
    if path.is_file():
        return pickle.loads(path.read_bytes())  # type: ignore[no-any-return]
    request.getfixturevalue("one_solver")
    made = with_growth(request.getfixturevalue("shaped"), request.getfixturevalue("targets"))
    made = replace(made, source=replace(made.source, targets={}))
    draft = tmp_path_factory.mktemp("body") / path.name
    draft.write_bytes(pickle.dumps(made, pickle.HIGHEST_PROTOCOL))
    os.replace(draft, path)
    return made
