# SPDX-License-Identifier: GPL-3.0-or-later
"""What every compiled kernel builds on: the compiler settings and the records that kernels
share.
"""
