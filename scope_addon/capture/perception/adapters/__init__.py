# SPDX-License-Identifier: GPL-3.0-or-later
"""Adapters of the user's own networks: each kind of graph has a module that detects it and reads its outputs."""
