# SPDX-License-Identifier: GPL-3.0-or-later
"""The request for a camera's formats."""

from __future__ import annotations

import json
import re

from ...errors import UsageError

_KEY = '{"formats_of": '


class FormatsRequest:
    """A camera, by number or device."""

    def __init__(self, formats_of: str) -> None:
        """Check it.

        :raises UsageError: it is neither.
        """
        if not isinstance(formats_of, str) or not re.fullmatch(r"(/dev/video)?[0-9]{1,3}", formats_of):
            raise UsageError("a request for formats needs the number of a camera")
        self.source = formats_of

    def to_json(self) -> str:
        """Return the request as one line of JSON."""
        return json.dumps({"formats_of": self.source})

    @staticmethod
    def is_in(text: str) -> bool:
        """Return whether a text is such a request, rather than another one."""
        return text.startswith(_KEY)

    @classmethod
    def from_json(cls, text: str) -> FormatsRequest:
        """Parse a request.

        :raises UsageError: the text is not a request.
        """
        try:
            return cls(**json.loads(text))
        except (ValueError, TypeError, RecursionError) as error:
            raise UsageError(f"this is not the request for a camera's formats: {error}") from error
