# SPDX-License-Identifier: GPL-3.0-or-later
"""Refuse to begin where the shell limits memory so much that libraries would crash, or wait for it
without end.
"""

from __future__ import annotations

# Of addresses, most of which are never used: 1.6 to 2.1 GB were measured without a scene, 2.8 GB
# with one.
_NEEDED_BYTES = 2_500_000_000
_NEEDED_WITH_SCENE = 3_200_000_000


def address_space_limit() -> int | None:
    """Return the limit on this process's addresses (``ulimit -v``) in bytes; None if there is
    none.

    It is asked when other libraries could not be loaded, so that it needs the standard one alone.
    """
    try:
        import resource
    except ImportError:  # on Windows
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def check_memory_limit(*, with_scene: bool) -> None:
    """Check the limit on this process's addresses (``ulimit -v``).

    :param with_scene: whether Blender's module will be loaded.
    :raises SetupError: it is too low.
    """
    from ..errors import SetupError

    limit = address_space_limit()
    needed = _NEEDED_WITH_SCENE if with_scene else _NEEDED_BYTES
    if limit is not None and limit < needed:
        raise SetupError(
            f"this shell limits a process to {limit / 1e9:.2f} GB of address space, but a capture "
            f"needs {needed / 1e9:.2f} GB: run ulimit -v unlimited first"
        )
