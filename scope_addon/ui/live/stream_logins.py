# SPDX-License-Identifier: GPL-3.0-or-later
"""Names and passwords of streams, which are kept until Blender ends, and in no .blend file."""

from __future__ import annotations

import re

_logins: dict[str, str] = {}  # by the address without it


def take_login(address: str) -> str:
    """Return an address without name and password, and remember these."""
    found = re.fullmatch(r"([A-Za-z][\w+.-]*://)([^/?#]*@)(.*)", address.strip(), re.S)
    if not found:
        return address
    _logins[found[1] + found[3]] = found[2]
    return found[1] + found[3]


def with_login(address: str) -> str:
    """Return an address with the name and password that were taken out of it."""
    return address.replace("://", f"://{_logins.get(address, '')}", 1)


def forget() -> None:
    """Forget all of them."""
    _logins.clear()
