# SPDX-License-Identifier: GPL-3.0-or-later
"""Published rows belong to protocols, to measures that these take, and name their source."""

from scope.benchmarks.evaluation.protocols import PROTOCOLS
from scope.benchmarks.evaluation.published import PUBLISHED


def test_every_row_has_a_source_and_figures_of_its_protocol():
    for name, rows in PUBLISHED.items():
        for row in rows:
            assert len(row.source) > 20, row
            assert row.figures, row
            assert set(row.figures) <= set(PROTOCOLS[name].measures), row
            assert row.figures.get("pa_mpjpe", 0) < row.figures.get("mpjpe", 1e9), row
