# SPDX-License-Identifier: GPL-3.0-or-later
"""Small random bodies in the layouts of the published files, an independent SMPL formula, and
stand-in classes to write pickles as scipy, chumpy and Python 2 write them, with none of these
installed.
"""

from __future__ import annotations

import io
import pickle
import struct
import sys
import types
from collections.abc import Callable
from typing import ClassVar

import numpy as np
import pytest
from scope.solver.body_file import load_body
from scope.solver.names import BODY_PARENTS

# Rest joints of a person in T-pose, the pelvis at the origin: SMPL's 22 body joints.
BODY = load_body("scope").rest_joints()[: len(BODY_PARENTS)]
BODY = BODY - BODY[0]


def _fingers(first: int) -> tuple[list[tuple[float, float, float]], list[int]]:
    """15 finger joints a side, left then right, index first and thumb last."""
    joints: list[tuple[float, float, float]] = []
    parents: list[int] = []
    for sign, wrist in ((1, 20), (-1, 21)):
        for z in (0.03, 0.01, -0.03, -0.01, 0.05):
            for i in range(3):
                reach = (0.72 if z == 0.05 else 0.79) + 0.03 * i
                parents.append(wrist if i == 0 else first + len(joints) - 1)
                joints.append((sign * reach, 0.44, z - 0.05))
    return joints, parents


def skeleton(family: str) -> tuple[np.ndarray, list[int]]:
    """Rest joints (K+1, 3) and parents."""
    if family in ("smpl", "star"):
        return np.vstack([BODY, [(0.79, 0.44, -0.05), (-0.79, 0.44, -0.05)]]), [
            *BODY_PARENTS,
            20,
            21,
        ]
    if family == "smplh":
        joints, parents = _fingers(22)
        return np.vstack([BODY, joints]), [*BODY_PARENTS, *parents]
    if family == "smplx":
        joints, parents = _fingers(25)
        face = [(0, 0.6, 0.06), (0.03, 0.65, 0.1), (-0.03, 0.65, 0.1)]
        return np.vstack([BODY, face, joints]), [*BODY_PARENTS, 15, 15, 15, *parents]
    rng = np.random.default_rng(3)  # any tree
    return rng.normal(size=(9, 3)), [-1, 0, 1, 1, 0, 4, 3, 6, 2]


def make_tables(
    family: str, vertices: int = 300, betas: int = 10, seed: int = 0
) -> dict[str, np.ndarray]:
    """The arrays of a model file; posedirs as wide as the family's."""
    rng = np.random.default_rng(seed)
    joints, parents = skeleton(family)
    n = len(joints)
    owner = np.concatenate(
        [np.repeat(np.arange(n), 3), rng.integers(0, n, max(0, vertices - 3 * n))]
    )[:vertices]
    v_template = joints[owner] + rng.normal(scale=0.03, size=(vertices, 3))
    regressor = np.zeros((n, vertices))
    weights = np.zeros((vertices, n))
    for j in range(n):
        near = np.flatnonzero(owner == j)[:6]
        regressor[j, near] = rng.dirichlet(np.ones(len(near)))
    others = rng.random((vertices, n)).argsort(axis=1)[:, :3]
    np.put_along_axis(weights, others, rng.uniform(0, 0.3, (vertices, 3)), axis=1)
    weights[np.arange(vertices), owner] += 1.0
    weights /= weights.sum(axis=1, keepdims=True)
    # the root's parent becomes 2**32 - 1
    kintree = np.array([parents, range(n)], np.int64).astype(np.uint32)
    pose_width = 4 * (n - 1) + 1 if family == "star" else 9 * (n - 1)
    return {
        "v_template": v_template,
        "shapedirs": rng.normal(scale=0.01, size=(vertices, 3, betas)),
        "posedirs": rng.normal(scale=0.01, size=(vertices, 3, pose_width)),
        "J_regressor": regressor,
        "weights": weights,
        "kintree_table": kintree,
        "f": rng.integers(0, vertices, (80, 3)).astype(np.uint32),
    }


def smpl_formula(
    tables: dict[str, np.ndarray], betas: np.ndarray, rotations: np.ndarray, trans: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and joints by SMPL's formula in homogeneous matrices, vertex by vertex, without pose
    correctives.
    """
    v = tables["v_template"] + tables["shapedirs"][:, :, : len(betas)] @ betas
    J = tables["J_regressor"] @ v
    chain: list[np.ndarray] = []
    for i, R in enumerate(rotations):
        local = np.eye(4)
        # the root has none, and its entry is not used
        parent = int(tables["kintree_table"][0, i]) if i else 0
        local[:3, :3] = R
        local[:3, 3] = J[i] - (J[parent] if i else 0)
        chain.append(chain[parent] @ local if i else local)
    from_rest = []
    for G, joint in zip(chain, J, strict=True):
        back = np.eye(4)
        back[:3, 3] = -joint
        from_rest.append(G @ back)
    skinned = []
    for weights, place in zip(tables["weights"], v, strict=True):
        blended = sum(w * matrix for w, matrix in zip(weights, from_rest, strict=True))
        skinned.append((blended @ np.append(place, 1.0))[:3])
    return np.array(skinned) + trans, np.array([G[:3, 3] for G in chain]) + trans


class Python2Pickler(pickle._Pickler):
    """Writes str and bytes as Python 2 wrote its one kind of string."""

    dispatch: ClassVar[dict[type, Callable[..., None]]] = dict(pickle._Pickler.dispatch)
    write: Callable[[bytes], object]  # these two are undocumented, and unknown to the type checker
    memoize: Callable[[object], None]

    def _string(self, value: str | bytes) -> None:
        raw = value.encode("latin1") if isinstance(value, str) else value
        if not self.bin:
            self.write(b"S" + repr(raw)[1:].encode("ascii") + b"\n")
        elif len(raw) < 256:
            self.write(b"U" + bytes([len(raw)]) + raw)
        else:
            self.write(b"T" + struct.pack("<i", len(raw)) + raw)
        self.memoize(value)

    dispatch[str] = _string
    dispatch[bytes] = _string


def dump_python2(value: object, protocol: int) -> bytes:
    """``value`` as Python 2's pickle module would have written it."""
    file = io.BytesIO()
    Python2Pickler(file, protocol).dump(value)
    return file.getvalue()


@pytest.fixture
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], type]:
    """Make an importable empty class of any dotted name, e.g. ``chumpy.ch.Ch``, so that the pickler
    can name it.
    """

    def make(dotted: str) -> type:
        module, name = dotted.rsplit(".", 1)
        parts = module.split(".")
        for i in range(1, len(parts) + 1):
            package = ".".join(parts[:i])
            if package not in sys.modules:
                monkeypatch.setitem(sys.modules, package, types.ModuleType(package))
        made = type(name, (), {"__module__": module})
        monkeypatch.setattr(sys.modules[module], name, made, raising=False)
        return made

    return make


@pytest.fixture(scope="session")
def tables_of() -> Callable[..., dict[str, np.ndarray]]:
    """The function ``make_tables``."""
    return make_tables


@pytest.fixture(scope="session")
def formula() -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """The function ``smpl_formula``."""
    return smpl_formula


@pytest.fixture(scope="session")
def python2() -> Callable[[object, int], bytes]:
    """The function ``dump_python2``."""
    return dump_python2
