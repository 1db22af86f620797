# SPDX-License-Identifier: GPL-3.0-or-later
"""The joint-state prior: a normalizing flow on SO(3) for each joint, by maximum likelihood on real motion.

    data.py        motions of tools/mocap -> rotations of each joint, mirrored, split by performer
    rotation_statistics.py  means, weights of performers, noise
    flow.py        the flow in PyTorch; ../../solver/residuals/joint_flow.py evaluates the same without it
    train.py       maximum likelihood with early stopping; ``python -m scope.tools.train_prior.train``
    export.py      trained flow -> assets/prior/joint_prior.npz
    baselines.py   what it is measured against: a Gaussian in the tangent space, and the matrix Fisher distribution
    report.py      held-out likelihoods beside the baselines, as the table of assets/prior/README.md
"""
