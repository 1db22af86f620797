# SPDX-License-Identifier: Apache-2.0
"""The Gauss-Newton direction in O(K) + O(N): terms, linearization, recursion, damping."""
