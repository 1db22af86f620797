# SPDX-License-Identifier: GPL-3.0-or-later
"""The request for a live capture."""

from __future__ import annotations

import json
from typing import Any

from ...errors import UsageError
from ...options import Place
from ..request import LineRequest, checked_values


class LiveRequest(LineRequest):
    """A source, whether it may be a stream, and a value for each option of `Place.LIVE_WORKER`."""

    called = "the request of a live capture"
    first_key = "live"

    def __init__(self, live: str, *, online: bool = False, **values: Any) -> None:
        """Check the values, and fill in the defaults of the others.

        :param live: camera, stream or file.
        :param online: whether the network may be used.
        :raises UsageError: an option does not exist, or its value has the wrong type or is none of
            the choices.
        """
        if not isinstance(live, str) or not isinstance(online, bool):
            raise UsageError(
                "a live capture's request needs a source, and whether the network may be used"
            )
        self.source = live
        self.online = online
        self.values: dict[str, Any] = checked_values(values, Place.LIVE_WORKER)

    def to_json(self) -> str:
        """Return the request as one line of JSON."""
        values = {
            name: str(v) if hasattr(v, "__fspath__") else v for name, v in self.values.items()
        }
        return json.dumps({"live": self.source, "online": self.online, **values})
