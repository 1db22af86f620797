# SPDX-License-Identifier: GPL-3.0-or-later
"""The shape from masks and keypoints as in a capture: garments fatten a body up to a limit, however
wide they are.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scope.benchmarks.ablation import LANDMARKS_AS_LIFTED, WITHOUT_OFFSETS, replaced
from scope.benchmarks.scenes.garments import (
    COAT_M,
    SKIRT_M,
    Garment,
    coat,
    girths_m,
    mass_kg,
    skirt,
)
from scope.scope_addon.capture.camera.intrinsics import Camera
from scope.scope_addon.capture.fitting import outline
from scope.scope_addon.capture.fitting.outline import fit_shape_to_outline, usable_masks
from scope.scope_addon.capture.fitting.prepared_track import prepare_track
from scope.scope_addon.capture.fitting.stature import mean_shape
from scope.scope_addon.capture.tracking.track import Track
from scope.solver import Body

from ..silhouettes import K, seen_in

# what they may add
GIRTH_M = {"skirt": 0.078, "coat": 0.23}
MASS_KG = {"skirt": 5.0, "coat": 22.0}
HEMS = (0.5, 1.0, 2.0, 3.0)  # times as far off the body as the garment's own


@pytest.fixture(scope="module")
def seen() -> dict[object, Track]:
    """What was drawn already, by garment, hem and seed."""
    return {}


def added_by(
    body: Body, seen: dict[object, Track], seed: int | None, name: str = "", times: float = 0.0
) -> tuple[float, float]:
    """The larger gain of waist and hips, metres, and of mass, kg, of the captured shape over the
    true one.
    """
    betas = shape_of(body, seed)
    key = (name, times, seed)
    if key not in seen:
        seen[key] = seen_in(body, betas, garment_of(body, betas, name, times) if name else None)
    camera = Camera(K, np.zeros(5), "test")
    with replaced([LANDMARKS_AS_LIFTED, WITHOUT_OFFSETS]):
        prepared = prepare_track(body, seen[key], camera)
    found = fit_shape_to_outline(prepared, usable_masks(prepared), None).beta
    girth = np.subtract(girths_m(body, found), girths_m(body, betas)).max()
    return float(girth), mass_kg(body, found) - mass_kg(body, betas)


def shape_of(body: Body, seed: int | None) -> NDArray[np.float64]:
    mean = mean_shape(body)
    return mean if seed is None else mean + np.random.default_rng(seed).uniform(-1.2, 1.2, body.P)


def garment_of(body: Body, betas: NDArray[np.float64], name: str, times: float) -> Garment:
    make, (top, hem) = (skirt, SKIRT_M) if name == "skirt" else (coat, COAT_M)
    return make(body, betas, (top if name == "skirt" else times * top, times * hem))


def test_a_body_without_garments_keeps_its_girths(body: Body, seen: dict[object, Track]) -> None:
    girth, mass = added_by(body, seen, 0)
    assert abs(girth) < 0.03
    assert abs(mass) < 3.0


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), [("skirt", None), ("coat", 0)])
def test_garments_fatten_a_body_up_to_a_limit_however_wide_they_are(
    body: Body, seen: dict[object, Track], name: str, seed: int | None
) -> None:
    added = [added_by(body, seen, seed, name, times) for times in HEMS]
    assert max(girth for girth, _ in added) < GIRTH_M[name]
    assert max(mass for _, mass in added) < MASS_KG[name]
    # what is wider than bodies counts less
    assert added[-1][1] < 0.8 * max(mass for _, mass in added)


def test_as_much_weight_inside_the_mask_as_outside_exceeds_the_limits(
    body: Body, seen: dict[object, Track], monkeypatch: pytest.MonkeyPatch
) -> None:
    """So the limits tell that clothes explain some of what the body lacks."""
    monkeypatch.setattr(outline, "INSIDE_WEIGHT", outline.OUTSIDE_WEIGHT)
    girth, mass = added_by(body, seen, 0, "skirt", 1.0)
    assert girth > GIRTH_M["skirt"]
    assert mass > MASS_KG["skirt"]


def test_squares_instead_of_a_robust_kernel_exceed_the_limits(
    body: Body, seen: dict[object, Track], monkeypatch: pytest.MonkeyPatch
) -> None:
    """So the limits tell that contours far from the body count little."""
    monkeypatch.setattr(outline, "OUTSIDE_SIGMA_M", 10.0)
    monkeypatch.setattr(outline, "_WIDTHS_M", {})
    monkeypatch.setattr(outline, "_WIDTH_M", 10.0)
    assert added_by(body, seen, None, "coat", 3.0)[1] > MASS_KG["coat"]
