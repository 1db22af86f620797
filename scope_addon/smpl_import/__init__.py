# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions in .npz files: our own, and those of other tools that describe a person in SMPL's
terms.
"""
