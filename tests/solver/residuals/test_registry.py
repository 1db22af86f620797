# SPDX-License-Identifier: GPL-3.0-or-later
"""A contributor's residual: one new file, its import and one line in the registry, tried on a copy
of the solver.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[3]

RESIDUAL = '''
"""A joint that is drawn to one height of the image: r = sqrt(w) (t_y - height), metres."""
import numpy as np
from ..kernel import kernel
from .accumulation import add_to_point
INTS, FLOATS = 1, 2  # part;  height, w
INDEXES = "parts"

@kernel
def accumulate(tree, ints, floats, weight, pose, blocks):
    cost = 0.0
    for k in range(ints.shape[0]):
        r, w = pose.t[ints[k, 0], 1] - floats[k, 0], weight * floats[k, 1]
        cost += 0.5 * w * r * r
        point = tree.keypoints + ints[k, 0]
        add_to_point(tree, pose, blocks, point, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, w, 0.0, 0.0,
                     0.0, w * r, 0.0)
    return cost
'''

USE = """
import sys
import numpy as np
sys.path.insert(0, sys.argv[1])
from copied import solver
from copied.solver.tree import make_tree
from copied.solver.gauss_newton.linearize import GRADIENT, make_blocks, make_pose, place_parts
from copied.solver.gauss_newton.terms import make_terms
from copied.solver.residuals import registry, toy
body = type("Body", (), {})()
body.parents = np.array([-1, 0, 1])
body.S, body.l = np.zeros((3, 3, 1)), np.array([[0, 0, 0], [0, 0.3, 0], [0.4, 0, 0]])
body.keypoint_part, body.v_bar, body.V = np.zeros(1, int), np.zeros((1, 3)), np.zeros((1, 3, 1))
tree = make_tree(body)

def terms_of(part):
    rows = np.array([[part]]), np.array([[-0.5, 1.0]])
    priors = solver.Priors(joint_weights=np.zeros(2))
    return make_terms(tree, solver.Measurements(tables={"toy": rows}), priors)

pose, blocks = make_pose(tree), make_blocks(tree)
pose.t[0] = 0.1, 0.2, 3.0
stage = np.zeros((2, registry.COLUMNS))
stage[0, registry.column_of("toy")] = 8.0
place_parts(tree, pose)
terms = terms_of(2)
cost = registry.accumulate_tables(tree, terms.ints, terms.floats, stage[0], pose, blocks)
print(cost, *blocks.A[2, :, GRADIENT])

start = solver.State(np.eye(3), pose.t[0].copy(), np.tile(np.eye(3), (2, 1, 1)), np.zeros(1))
rows = solver.Measurements(tables={"toy": ([[2]], [[-0.5, 1.0]])})
found = solver.fit(body, rows, init=start, priors=solver.Priors(joint_weights=np.zeros(2)))
print(found.measurements, found.t_camera_part[2, 1])
for part, declared in ((3, True), (-1, True), (-1, False)):
    if not declared and hasattr(toy, "INDEXES"):
        del toy.INDEXES
    try:
        terms_of(part)
    except solver.ShapeError as error:
        print(error)
"""


def test_one_file_its_import_and_one_line_add_a_residual(tmp_path):
    copied = tmp_path / "copied"
    shutil.copytree(
        ROOT / "solver", copied / "solver", ignore=shutil.ignore_patterns("__pycache__")
    )
    shutil.copytree(ROOT / "assets" / "body", copied / "assets" / "body")
    (copied / "__init__.py").touch()
    (copied / "solver" / "residuals" / "toy.py").write_text(RESIDUAL)
    registry = copied / "solver" / "residuals" / "registry.py"
    text = registry.read_text("utf-8")
    text = text.replace('    "floor": floor,\n', '    "floor": floor,\n    "toy": toy,\n')
    # the import is what the line needs
    registry.write_text(text.replace("import floor,", "import toy, floor,"))
    # As plain Python: to compile it all takes a quarter of a minute.
    rows = copied / "solver" / "gauss_newton" / "rows.py"
    rows.write_text(rows.read_text("utf-8").replace("..fast.rows", ".plain_rows"))
    environment = dict(os.environ, NUMBA_DISABLE_JIT="1")
    command = [sys.executable, "-c", USE, str(tmp_path)]
    # compiled code is bound to all sources in its folder, here the current one
    empty = tmp_path / "empty"
    empty.mkdir()
    done = subprocess.run(
        command, env=environment, cwd=empty, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    first, fitted, *refused = done.stdout.splitlines()
    # At rest part 2 lies at (0.5, 0.5, 3), (0.4, 0.3, 0) from the pelvis: r = 0.5 - (-0.5), the
    # force is w r upwards.
    cost, *gradient = map(float, first.split())
    np.testing.assert_allclose(cost, 0.5 * 8.0)
    np.testing.assert_allclose(gradient, [0.0, 0.0, 0.4 * 8.0, 0.0, 8.0, 0.0], atol=1e-12)
    # The residual alone moves the body.
    measured, height = map(float, fitted.split())
    assert measured == 1
    np.testing.assert_allclose(height, -0.5, atol=1e-6)
    assert refused == [
        "Parts of 'toy' must lie in 0..2, but go from 3 to 3.",
        "Parts of 'toy' must lie in 0..2, but go from -1 to -1.",
        "Indices of 'toy' must not be negative, but go from -1 to -1.",
    ]


def test_kernels_made_in_a_loop_have_names_of_their_own():
    """Machine code from several processes is linked by these names."""
    from scope.solver.residuals import registry

    names = []
    chain = [registry.accumulate_tables]
    while chain:
        function = chain.pop().py_func
        names.append(function.__qualname__)
        inner = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
        chain += [inner["before"].cell_contents] if "before" in inner else []
    assert len(names) == len(registry.RESIDUALS) + 1
    assert len(set(names)) == len(names)
