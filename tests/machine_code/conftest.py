# SPDX-License-Identifier: GPL-3.0-or-later
"""Processes that have numba already: forked from one that has compiled something, which takes half
a second.
"""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest

Done = subprocess.CompletedProcess[str]

TIMEOUT_S = 600  # after which a process is ended, and fails its test

# Takes code, folder, variables, seconds, and two file descriptors for what is printed; answers with
# the exit status.
SERVER = """
import gc, json, os, signal, socket, sys
from numba import njit
from numba.core import config
njit(lambda x: x + 1.0)(1.0)
gc.freeze()
server = socket.socket(fileno=int(sys.argv.pop()))
while (received := socket.recv_fds(server, 1 << 20, 2))[0]:
    code, folder, variables, timeout_s = json.loads(received[0])
    child = os.fork()
    for standard, given in zip((1, 2), received[1]):
        if not child:
            os.dup2(given, standard)
        os.close(given)
    if not child:
        signal.alarm(timeout_s)
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
    """Run code in a process of its own, in a folder and with the given environment variables
    alone.
    """
    if sys.platform != "linux":
        yield _started
        return
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.settimeout(TIMEOUT_S + 60)  # the process ends by itself before
    command = [sys.executable, "-c", SERVER, str(theirs.fileno())]
    with ours, subprocess.Popen(command, pass_fds=[theirs.fileno()]) as process:
        theirs.close()

        def run(code: str, folder: Path, variables: Mapping[str, str]) -> Done:
            # Numba takes the processor's name and features when it first compiles.
            is_other = any(name.startswith("NUMBA_CPU") for name in variables)
            return (_started if is_other else lambda *given: _forked(ours, *given))(
                code, folder, variables
            )

        yield run
        process.kill()


def _started(code: str, folder: Path, variables: Mapping[str, str]) -> Done:
    command = [sys.executable, "-c", code]
    return subprocess.run(
        command,
        cwd=folder,
        env=dict(variables),
        capture_output=True,
        text=True,
        check=True,
        timeout=TIMEOUT_S,
    )


def _forked(server: socket.socket, code: str, folder: Path, variables: Mapping[str, str]) -> Done:
    # Files, because a process that prints much would wait for a reader of its pipe.
    request = json.dumps([code, str(folder), dict(variables), TIMEOUT_S])
    with tempfile.TemporaryFile() as stdout, tempfile.TemporaryFile() as stderr:
        socket.send_fds(server, [request.encode()], [stdout.fileno(), stderr.fileno()])
        status = int(server.recv(100))
        printed = []
        for file in (stdout, stderr):
            file.seek(0)
            printed.append(file.read().decode("utf-8"))
    done = subprocess.CompletedProcess(code, status, *printed)
    done.check_returncode()
    return done
