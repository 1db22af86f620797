# SPDX-License-Identifier: GPL-3.0-or-later
"""The limit on a process's addresses. Standard library only: it is asked when other libraries could
not be loaded.
"""

from __future__ import annotations


def address_space_limit() -> int | None:
    """Return the limit on this process's addresses (``ulimit -v``) in bytes; None if there is
    none.
    """
    try:
        import resource
    except ImportError:  # on Windows
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit
