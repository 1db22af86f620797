# SPDX-License-Identifier: GPL-3.0-or-later
"""Processes that have numba already: forked from one that has compiled something, which takes half a second."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest

Done = subprocess.CompletedProcess[str]

# Takes code, folder, variables, and two file descriptors for what is printed; answers with the exit status.
SERVER = """
import gc, json, os, socket, sys
from numba import njit
from numba.core import config
njit(lambda x: x + 1.0)(1.0)
gc.freeze()
server = socket.socket(fileno=int(sys.argv.pop()))
while (received := socket.recv_fds(server, 1 << 20, 2))[0]:
    code, folder, variables = json.loads(received[0])
    child = os.fork()
    for standard, given in zip((1, 2), received[1]):
        if not child:
            os.dup2(given, standard)
        os.close(given)
    if not child:
        server.close()
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(variables)
        config.reload_config()
        sys.dont_write_bytecode = bool(variables.get("PYTHONDONTWRITEBYTECODE"))
        exec(code, {"__name__": "__main__"})
        sys.exit()
    server.send(str(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])).encode())
"""


@pytest.fixture(scope="session")
def run_code() -> Iterator[Callable[[str, Path, Mapping[str, str]], Done]]:
    """Run code in a process of its own, in a folder and with the given environment variables alone."""
    if sys.platform != "linux":
        yield _started
        return
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    command = [sys.executable, "-c", SERVER, str(theirs.fileno())]
    with ours, subprocess.Popen(command, pass_fds=[theirs.fileno()]) as process:
        theirs.close()

        def run(code: str, folder: Path, variables: Mapping[str, str]) -> Done:
            # Numba takes the processor's name and features when it first compiles.
            is_other = any(name.startswith("NUMBA_CPU") for name in variables)
            return (_started if is_other else lambda *given: _forked(ours, *given))(code, folder, variables)

        yield run
        ours.close()  # which ends the process
        process.wait()


def _started(code: str, folder: Path, variables: Mapping[str, str]) -> Done:
    command = [sys.executable, "-c", code]
    return subprocess.run(command, cwd=folder, env=dict(variables), capture_output=True, text=True, check=True)


def _forked(server: socket.socket, code: str, folder: Path, variables: Mapping[str, str]) -> Done:
    pipes = os.pipe(), os.pipe()
    socket.send_fds(server, [json.dumps([code, str(folder), dict(variables)]).encode()], [end for _, end in pipes])
    printed = []
    for begin, end in pipes:
        os.close(end)
        with open(begin, encoding="utf-8") as file:
            printed.append(file.read())
    done = subprocess.CompletedProcess(code, int(server.recv(100)), *printed)
    done.check_returncode()
    return done
