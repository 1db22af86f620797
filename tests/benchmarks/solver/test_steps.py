# SPDX-License-Identifier: GPL-3.0-or-later
"""The points of the paper's experiments, and the tables of their rows; nothing is timed."""

import pytest
from scope.benchmarks import report
from scope.benchmarks.solver import steps


@pytest.fixture
def made(monkeypatch):
    """Problems as their sizes; times that grow with K for the sparse step, with its cube for the
    dense one.
    """
    monkeypatch.setattr(steps, "make_problem", lambda K, P, N: (K, P, N))
    sizes = {"sparse": lambda K: K / 23, "dense": lambda K: 10 * (K / 23) ** 3}

    def compare(problems, rounds):
        return tuple(
            {n: sizes[kind](p[0]) for n, p in problems.items()}
            for kind in ("sparse", "sparse", "dense")
        )

    monkeypatch.setattr(steps, "compare", compare)


def test_experiment_3_has_one_term_of_each_kind_for_every_part(made):
    rows = steps.experiment(3, 1)
    assert {(row["K"], row["N"]) for row in rows} == {(23, 3 * 24), (51, 3 * 52)}
    assert [row["P"] for row in rows if row["K"] == 51] == list(range(11))
    assert {row["N"] for row in steps.experiment(3, 1, 600)} == {600}


def test_experiments_1_and_2_grow_in_terms(made):
    assert {(row["P"], row["N"]) for row in steps.experiment(1, 1)} == {
        (0, n) for n in (120, 240, 360, 480, 600)
    }
    assert {row["P"] for row in steps.experiment(2, 1)} == {10}


def test_tables_name_the_bodies_and_compare_them(made):
    rows = steps.experiment(3, 1)
    text = report.experiment_lines(3, rows)
    assert text.startswith("Experiment 3, N = 72 and 156, µs per step")
    assert "| P | scope sparse | scope dense | scope_h sparse |" in text
    assert "| 10 | 1 | 10 | 2.22 | 109 | 10 | 49.2 | 2.22 | 10.9 |" in text
    assert steps.growth_in_joints(rows, "sparse") == pytest.approx(1)
    assert steps.growth_in_joints(rows, "dense") == pytest.approx(3)


def test_the_table_of_targets_names_what_was_measured_in_words():
    measured = dict.fromkeys(steps.TARGETS, 10.0)
    others = dict.fromkeys((*report.FRAME_TARGETS, *report.STARTUP_TARGETS), 0.5)
    text = report.target_lines(
        {**dict.fromkeys(("gn_step", "dense_over_sparse", "dense_over_called"), measured), **others}
    )
    names = [line.split(" | ")[0].removeprefix("| ") for line in text.splitlines()[2:]]
    assert names[0] == "step K=23 P=10 N=52, with the joint prior"
    assert "step K=51 P=10 N=600" in names
    assert len(names) == len(measured) + len(others)
    assert not [name for name in names if "_" in name]
