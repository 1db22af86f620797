# SPDX-License-Identifier: GPL-3.0-or-later
"""The arguments of a batch that runs on a cluster."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import UsageError
from ..footage import is_url
from ..installed import check_cluster
from ..temporary import temporary_folder
from .arguments import path_argument
from .terminal import print_message

if TYPE_CHECKING:
    from ..cluster.runner import DaskRunner


def dask_runner(args: argparse.Namespace, program: Sequence[str] | None) -> DaskRunner:
    """Connect to the cluster of ``--scheduler``.

    :param program: command that the workers run; None for their own installation.
    :raises ScopeError: the package is missing, or the scheduler cannot be reached.
    """
    check_cluster()
    from ..cluster.runner import DaskRunner
    from ..cluster.workers import connect

    # As given, not resolved: a link may lead elsewhere on other machines.
    folder, out = (
        path if is_url(path) else os.path.abspath(path) for path in (args.folder, args.out)
    )
    return DaskRunner(connect(args.scheduler), folder, out, args.jobs, program, print_message)


def folder_argument(text: str) -> Path | str:
    """Convert the argument to a path, or leave it as the URL that it is."""
    return text if is_url(text) else path_argument(text)


def local_folders(args: argparse.Namespace, stack: ExitStack) -> tuple[Path, Path]:
    """Return the folders of footage and results; for a URL, a folder with files of the same names.

    :param stack: removes that folder.
    :raises UsageError: there is a URL, but no cluster.
    :raises ScopeError: a store cannot be read.
    """
    folder = args.folder
    out = args.out
    if is_url(folder) or is_url(out):
        if args.scheduler is None:
            raise UsageError(
                "footage and results at a URL need a cluster: give its --scheduler, or download "
                "the footage"
            )
        check_cluster()
        from ..cluster.remote import mirror_footage, mirror_results

        scratch = stack.enter_context(temporary_folder("batch"))
        folder = mirror_footage(folder, str(out), scratch / "clips") if is_url(folder) else folder
        out = mirror_results(out, scratch / "results") if is_url(out) else out
    return folder, out
