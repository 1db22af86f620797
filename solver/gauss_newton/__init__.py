# SPDX-License-Identifier: GPL-3.0-or-later
"""The Gauss-Newton direction in O(K) + O(N): terms, linearization, recursion, damping."""
