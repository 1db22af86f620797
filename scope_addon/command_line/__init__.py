# SPDX-License-Identifier: GPL-3.0-or-later
"""Shared by the commands of `cli`: arguments made from the declared options, the terminal, signals,
output files.
"""
