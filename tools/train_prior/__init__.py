# SPDX-License-Identifier: GPL-3.0-or-later
"""The joint-state prior: a normalizing flow on SO(3) for each joint, by maximum likelihood on real
motion.

- ``data.py``: rotations of each joint from the motions of tools/mocap, mirrored, split by performer
- ``rotation_statistics.py``: means, weights of performers, noise
- ``flow.py``: the flow in PyTorch; ../../solver/residuals/joint_flow.py evaluates the same without
    it
- ``train.py``: maximum likelihood with early stopping; ``python -m scope.tools.train_prior.train``
- ``export.py``: writes assets/prior/joint_prior.npz
- ``baselines.py``: a Gaussian in the tangent space and the matrix Fisher distribution, for
    comparison
- ``report.py``: held-out likelihoods of flow and baselines, as the table of assets/prior/README.md
"""
