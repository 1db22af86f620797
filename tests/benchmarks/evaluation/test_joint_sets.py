# SPDX-License-Identifier: GPL-3.0-or-later
"""The joints of protocols lie where anatomy has them, on the built-in body and in the published
orders.
"""

import numpy as np
import pytest
from scope.benchmarks.evaluation import joint_sets
from scope.benchmarks.evaluation.protocols import MEASURES, PROTOCOLS


@pytest.fixture
def at_rest(body):
    def place(*names):
        parts, offsets = joint_sets.on_body(body, names, np.zeros(body.P))
        return body.rest_joints()[parts] + offsets

    return place


def test_every_joint_of_every_protocol_is_on_the_body(at_rest):
    for protocol in PROTOCOLS.values():
        assert at_rest(*protocol.joints, *protocol.root).shape == (
            len(protocol.joints) + len(protocol.root),
            3,
        )
        assert set(protocol.pck_joints) <= set(protocol.joints)
        assert set(protocol.measures) <= set(MEASURES)


@pytest.mark.parametrize(
    "names", [joint_sets.LSP14, joint_sets.REGRESSED17, joint_sets.TEST_3DHP, joint_sets.H36M32]
)
def test_left_is_left(at_rest, names):
    for name, point in zip(names, at_rest(*names), strict=True):
        side = name.split("_")[0]
        assert np.sign(np.round(point[0], 2)) == {"left": 1, "right": -1}.get(side, 0), name


def test_the_orders_are_those_of_the_published_tables():
    """Numbers as SPIN's constants.py has them: LSP's joints by their rows in J_regressor_h36m."""
    rows = [6, 5, 4, 1, 2, 3, 16, 15, 14, 11, 12, 13, 8, 10]
    assert [joint_sets.REGRESSED17[row] for row in rows] == list(joint_sets.LSP14)
    by_data_set = [11, 6, 7, 8, 1, 2, 3, 12, 24, 14, 15, 17, 18, 19, 25, 26, 27]
    assert [joint_sets.H36M32[name] for name in joint_sets.REGRESSED17] == by_data_set
