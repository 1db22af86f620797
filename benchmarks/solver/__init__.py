# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver's speed, beside a dense solver and other libraries."""
