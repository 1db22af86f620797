# SPDX-License-Identifier: Apache-2.0
"""The same as gauss_newton/plain_rows.py in SIMD instructions, which gauss_newton/rows.py chooses.

The number of shape columns is known only at run time, and a compiler leaves a run-time loop of ten
turns scalar. These rows are padded with zeros to whole vectors of four numbers.
"""
