# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of Dask for the processes that the tests start."""

import os

# Otherwise every process looks at its own stacks a hundred times a second, in a fifth of these
# tests' processor time.
os.environ.setdefault("DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED", "False")
