# SPDX-License-Identifier: GPL-3.0-or-later
"""Names and passwords of streams, which are kept until Blender ends, and in no .blend file."""

from __future__ import annotations

import re

from ...footage import display_address, has_login

_addresses: dict[str, str] = {}  # whole ones, by what is left of them without their secrets
_SECRET = re.compile(r"[?#;&][^=]*(auth|key|login|pass|pw|secret|sig|token|user)[^=]*=", re.I)


def take_login(address: str) -> str:
    """Return an address without names, passwords and keys, and remember the whole one."""
    whole = address.strip()
    scheme, separator, public = whole.partition("://")
    if not separator:
        return address
    if has_login(public):
        place, mark, query = public.partition("?")
        is_before = "@" in place  # a password may have a question mark
        public = place.rpartition("@")[2] + mark + query if is_before else public.rpartition("@")[2]
    public = f"{scheme}://{public}"
    if _SECRET.search(public):
        public = display_address(public)
    if public == whole:
        return address
    _addresses[public] = whole
    return public


def with_login(address: str) -> str:
    """Return an address with what was taken out of it."""
    return _addresses.get(address, address)


def forget() -> None:
    """Forget all of them."""
    _addresses.clear()
