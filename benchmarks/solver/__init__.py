# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed of the solver, compared with a dense solver and other libraries."""
