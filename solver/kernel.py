# SPDX-License-Identifier: GPL-3.0-or-later
"""How every kernel of the solver is compiled."""

from numba import njit

# Reordering sums and fusing multiplications is allowed; assuming that no NaN or infinity occurs is not, because the
# optimizer must recognise them. The GIL is released, so that frames can be solved in threads.
kernel = njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "arcp", "nsz"})
