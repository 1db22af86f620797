# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure the speed and accuracy of solver and captures: `./scripts/bench`."""
