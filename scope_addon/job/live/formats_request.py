# SPDX-License-Identifier: GPL-3.0-or-later
"""The request for a camera's formats."""

from __future__ import annotations

import json
import re

from ...errors import UsageError
from ..request import LineRequest


class FormatsRequest(LineRequest):
    """A camera, by number or device."""

    called = "the request for a camera's formats"
    first_key = "formats_of"

    def __init__(self, formats_of: str) -> None:
        """Check it.

        :raises UsageError: it is neither.
        """
        if not isinstance(formats_of, str) or not re.fullmatch(
            r"(/dev/video)?[0-9]{1,3}", formats_of
        ):
            raise UsageError("a request for formats needs the number of a camera")
        self.source = formats_of

    def to_json(self) -> str:
        """Return the request as one line of JSON."""
        return json.dumps({"formats_of": self.source})
