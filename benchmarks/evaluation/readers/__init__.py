# SPDX-License-Identifier: GPL-3.0-or-later
"""One reader for each data set: from the folders that its publisher hands out to clips with ground
truth.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..clips import Clip
from ..models import Models
from . import bedlam, emdb, human36m, mpi_inf_3dhp, rich, three_dpw

# Name on the command line -> clips of a folder.
READERS: dict[str, Callable[[Path, Models], list[Clip]]] = {
    "h36m": human36m.clips,
    "3dhp": mpi_inf_3dhp.clips,
    "3dpw": three_dpw.clips,
    "emdb": emdb.clips,
    "rich": rich.clips,
    "bedlam": bedlam.clips,
}
