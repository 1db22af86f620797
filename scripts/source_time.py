# SPDX-License-Identifier: GPL-3.0-or-later
"""The time that everything built from one commit states, so that repeated builds are the same."""

from __future__ import annotations

import os
import subprocess
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
_OLDEST = 315532800  # 1980-01-01, the first time that a zip can state


def source_time() -> datetime:
    """Return the time that everything in a zip states: SOURCE_DATE_EPOCH, or that of the last
    commit.
    """
    stated = os.environ.get("SOURCE_DATE_EPOCH", "")
    if not stated:
        command = ["git", "-C", str(ROOT), "log", "-1", "--format=%ct"]
        try:
            stated = subprocess.run(
                command, capture_output=True, text=True, check=False
            ).stdout.strip()
        except OSError:  # there is no git
            stated = ""
    return datetime.fromtimestamp(max(int(stated or 0), _OLDEST), UTC)
