# SPDX-License-Identifier: GPL-3.0-or-later
"""Short programs against the solver's interface, each runnable: ``python -m
scope.solver.examples.from_3d_joints``.

They make their own measurements from a known pose, so that what comes out can be compared with the
truth.
"""
