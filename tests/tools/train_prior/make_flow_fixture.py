# SPDX-License-Identifier: GPL-3.0-or-later
"""Write flow_by_torch.npz: parameters of a random PyTorch flow, states, and what PyTorch makes of
them.

Needs PyTorch, which the tests do not: ``python tests/tools/train_prior/make_flow_fixture.py``.
"""

from pathlib import Path

import numpy as np
import torch
from scope.solver.rotations import matrix_from_quaternion
from scope.tools.train_prior.flow import Flow, chart

FIXTURE = Path(__file__).with_name("flow_by_torch.npz")


def main():
    rng = np.random.default_rng(7)
    mean = matrix_from_quaternion(rng.standard_normal(4))
    flow = Flow(torch.tensor(mean[None]), layers=4, hidden=4, seed=3).double()
    with torch.no_grad():
        for parameter in flow.parameters():
            parameter += 0.3 * torch.tensor(rng.standard_normal(parameter.shape))
        states = matrix_from_quaternion(rng.standard_normal((20, 4)))
        z, _ = flow(chart(torch.tensor(states[None]), flow.means[:, None])[0])
        log_likelihood = flow.log_likelihood(torch.tensor(states[None]))
    np.savez_compressed(
        FIXTURE,
        states=states,
        z=z[0].numpy(),
        log_likelihood=log_likelihood[0].numpy(),
        **flow.row(0),
    )


if __name__ == "__main__":
    main()
