# SPDX-License-Identifier: GPL-3.0-or-later
"""The connection to a Dask scheduler, whose address or file the user gives."""

from __future__ import annotations

import logging
import re
import warnings
from pathlib import Path

from distributed import Client

from ...solver.errors import InputError
from ..errors import ClusterError, UsageError
from ..json_file import read_json_object

_ADDRESS = re.compile(r"(tcp|tls|ws|wss)://[^/\s]+")
_TIMEOUT_S = 15.0


def connect(scheduler: str) -> Client:
    """Connect to a scheduler; certificates for ``tls://`` come from Dask's own configuration.

    :param scheduler: its address, such as ``tcp://HOST:8786``, or the path of a scheduler file.
    :raises UsageError: it is neither.
    :raises InputError: the scheduler file cannot be read, or is something else.
    :raises ClusterError: the scheduler does not answer.
    """
    address = scheduler if _ADDRESS.fullmatch(scheduler) else _address_in_file(scheduler)
    # what goes wrong is reported by its consequences
    logging.getLogger("distributed").setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings(action="ignore"):  # of other versions of packages on workers
            return Client(address, timeout=_TIMEOUT_S, set_as_default=False, name="scope-batch")
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        cause = " ".join(str(error.__cause__ or error).split())
        raise ClusterError(
            f"the Dask scheduler {scheduler} cannot be reached ({cause[:200]}); start it, or check "
            "its address"
        ) from error


def _address_in_file(scheduler: str) -> str:
    """Return the address in a scheduler file."""
    path = Path(scheduler)
    if not path.exists() or path.is_dir():
        raise UsageError(
            "--scheduler must be an address such as tcp://HOST:8786 or the path of a scheduler "
            f"file, not {scheduler!r}"
        )
    content = read_json_object(
        path, InputError, "scheduler file", "give the one that Dask has written"
    )
    address = content.get("address")
    if not isinstance(address, str) or not _ADDRESS.fullmatch(address):
        raise InputError(
            f"{path} is not a scheduler file: it has no address; give the one that Dask has written"
        )
    return address
