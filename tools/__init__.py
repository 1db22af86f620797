# SPDX-License-Identifier: GPL-3.0-or-later
"""Tools that make the assets: body builder, network converter, sample clip. Needed to build Scope,
not to use it.
"""
