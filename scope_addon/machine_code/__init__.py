# SPDX-License-Identifier: GPL-3.0-or-later
"""The machine code of the solver's kernels on disk: shipped with the extension, or compiled on
first use; checked before it is used, and the same results from both.

code_cache.py       a kernel's code in place of numba's own cache, in files that may be run
code_folders.py     where code lies, named after all that it depends on
kernel_count.py     how many kernels there are to compile
numba_internals.py  all that depends on numba's own code, and on its version
"""
