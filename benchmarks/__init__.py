# SPDX-License-Identifier: GPL-3.0-or-later
"""How fast the solver is, beside what else there is: `./scripts/bench solver`."""
