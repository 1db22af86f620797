# SPDX-License-Identifier: GPL-3.0-or-later
"""Every block of the solver's page runs, and finds the person whose measurements it is given."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scope.solver import load_body, rotations
from scope.solver.names import COCO
from scope.solver.residuals import external

from ..untrusted.conftest import make_tables
from . import person

PAGE = Path(__file__).resolve().parents[2] / "docs" / "solver_api.md"
BLOCKS = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text("utf-8"), re.M | re.S)
FRAMES = 6


@pytest.fixture(scope="module")
def seen():
    """What the page says that its variables hold, of a person who moves, without noise."""
    body = load_body("scope")
    coco = [body.point(f"coco/{name}") for name in COCO[:17]]
    first = person.pose(body, seed=3)
    truth = []
    for f in range(FRAMES):
        turn = rotations.exp(0.02 * f * np.ones((body.K, 3)))
        state = replace(first, Omega=first.Omega @ turn)
        truth.append(person.place(body, state))
    clip = np.array([body.keypoints(R, t, first.beta, coco) for R, t in truth])
    cameras = []
    for angle in (0.0, 1.2, -1.4):
        R = rotations.exp([0.0, angle, 0.0])
        pivot = np.array([0.0, 0.0, 4.0])
        t = pivot - R @ pivot
        pixels = np.array([person.project(points @ R.T + t) for points in clip])
        cameras.append((person.INTRINSICS, R, t, pixels))
    pixels = cameras[0][3]
    return {
        "intrinsics": person.INTRINSICS,
        "joints": truth[0][1],
        "pixels": pixels[0],
        "confidence": np.full(17, 0.9),
        "clip_pixels": pixels,
        "times": np.arange(FRAMES) / 30.0,
        "cameras": cameras,
        "truth": np.array([t for _, t in truth]),
    }


def off_mm(found, truth):
    return 1e3 * np.linalg.norm(found - truth, axis=-1).mean()


def from_joints(found, seen):
    assert off_mm(found["fit"].t_camera_part, seen["joints"]) < 5.0


def from_pixels(found, seen):
    """One view does not fix how far away a person is, but what is seen."""
    joints = found["fit"].t_camera_part
    apart = person.project(joints[1:22]) - person.project(seen["joints"][1:22])
    assert np.linalg.norm(apart, axis=1).mean() < 15.0
    assert off_mm(joints - joints[0], seen["joints"] - seen["joints"][0]) < 100.0


def from_clip(found, seen):
    for joints in (
        np.array([frame.t_camera_part for frame in found["clip"].frames]),
        found["motion"].t_world_part,
    ):
        assert off_mm(joints - joints[:, :1], seen["truth"] - seen["truth"][:, :1]) < 80.0
    assert len(found["clip"].beta) == 10


def from_cameras(found, seen):
    assert off_mm(found["motion"].t_world_part[:, :22], seen["truth"][:, :22]) < 15.0
    assert found["motion"].joint_covariance.shape == (FRAMES, 24, 3, 3)


def with_own_residual(found, seen):
    hand = found["hand"]
    assert abs(found["fit"].t_camera_part[hand, 1] - seen["joints"][hand, 1]) < 0.005


def with_own_body(found, seen):
    """The tiny body has other proportions than the person."""
    assert found["smpl_pose"].shape == (23, 3)
    assert off_mm(found["fit"].t_camera_part, seen["joints"]) < 100.0


def with_own_tree(found, seen):
    turn = np.linalg.norm(rotations.log(found["fit"].state.Omega[0]))
    assert turn == pytest.approx(np.pi / 2, abs=1e-4)


def of_the_solution(found, seen):
    """The loss of a fit with a slightly larger weight says the same."""
    heavier = replace(found["solver"].Weights(), shape=1.05)
    stages = [found["solver"].Stage(heavier, 0.0, 200)]
    options = found["solver"].Options(stages=stages)
    fit = found["fit"]
    again = found["solver"].fit(found["body"], found["seen"], init=fit.state, options=options)
    before, after = (((each.t_camera_part - seen["joints"]) ** 2).sum() for each in (fit, again))
    assert float(found["gradient"]["weights.shape"]) == pytest.approx(
        (after - before) / 0.05, rel=0.1
    )


def in_torch(found, seen):
    """The gradient is that of differences, along a random direction."""
    torch = found["torch"]
    points, along = noisy(seen["joints"])
    given = torch.tensor(points, requires_grad=True)

    def loss(points):
        return (found["FittedJoints"].apply(points)[20] ** 2).sum()

    loss(given).backward()
    with torch.no_grad():
        step = 1e-4 * torch.tensor(along)
        ahead, behind = float(loss(given + step)), float(loss(given - step))
    gradient = given.grad.numpy()
    assert (gradient * along).sum() == pytest.approx((ahead - behind) / 2e-4, rel=1e-4)


def in_jax(found, seen):
    """As in PyTorch; JAX computes in single precision unless told otherwise."""
    jax = found["jax"]
    points, along = noisy(seen["joints"])

    def loss(points):
        return (found["fitted_joints"](points)[20] ** 2).sum()

    gradient = np.asarray(jax.grad(loss)(jax.numpy.array(points)))
    ahead, behind = (float(loss(points + step * along)) for step in (5e-3, -5e-3))
    assert (gradient * along).sum() == pytest.approx((ahead - behind) / 1e-2, rel=0.02)


def noisy(joints):
    """Return joints that no body has exactly, and a direction."""
    along = np.random.default_rng(1).standard_normal(joints.shape)
    return joints + 0.01 * np.random.default_rng(0).standard_normal(joints.shape), along


def with_own_kernel(found, seen):
    errors = found["solver"].check_residual(
        found["body"], "plane", [[found["wrist"]]], [[0.0, 0.6, 0.8, 2.5]]
    )
    assert max(errors.values()) < 1e-5


def of_the_step(found, seen):
    equations = found["equations"]
    step = found["step"]
    rest = equations.H @ step.direction + equations.g
    assert np.abs(rest).max() < 1e-6 * np.abs(equations.g).max()
    assert step.predicted_decrease > 0.0


CHECKS = [
    from_joints,
    from_pixels,
    from_clip,
    from_cameras,
    with_own_residual,
    with_own_kernel,
    with_own_body,
    with_own_tree,
    of_the_step,
    of_the_solution,
    in_torch,
    in_jax,
]


def test_every_block_has_its_check():
    assert len(BLOCKS) == len(CHECKS)


@pytest.mark.parametrize(
    ("code", "check"),
    list(zip(BLOCKS, CHECKS, strict=False)),
    ids=lambda c: getattr(c, "__name__", ""),
)
def test_a_block_finds_the_person(code, check, seen, tmp_path, monkeypatch):
    for optional in ("torch", "jax"):
        if f"import {optional}\n" in code:
            pytest.importorskip(optional)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(external, "_external", {})  # other tests have registered theirs
    np.savez("SMPL_NEUTRAL.npz", **make_tables("smpl"))
    found = dict(seen)
    exec(compile(code, PAGE.name, "exec"), found)
    check(found, seen)
