# SPDX-License-Identifier: GPL-3.0-or-later
"""The labels of operators, which are buttons and menu entries, in other languages: one module per
language.
"""
