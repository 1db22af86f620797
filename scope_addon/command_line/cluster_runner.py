# SPDX-License-Identifier: GPL-3.0-or-later
"""The arguments of a batch that runs on a cluster."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import UsageError
from ..installed import check_cluster
from .terminal import say

if TYPE_CHECKING:
    from ..cluster.runner import DaskRunner


def dask_runner(args: argparse.Namespace, program: Sequence[str] | None) -> DaskRunner:
    """Connect to the cluster of ``--scheduler``.

    :param program: command that the workers run; None for their own installation.
    :raises ScopeError: the package is missing, or the scheduler cannot be reached.
    """
    check_cluster()
    if args.folder.is_file():
        raise UsageError(f"{args.folder} is a file; give the folder with the footage")
    from ..cluster.connection import connect
    from ..cluster.runner import DaskRunner

    # As given, not resolved: a link may lead elsewhere on other machines.
    folder, out = (Path(os.path.abspath(path)) for path in (args.folder, args.out))
    return DaskRunner(connect(args.scheduler), folder, out, args.jobs, program, say)
