# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages, progress and reports on a terminal and elsewhere."""

from __future__ import annotations

import io
import os
import struct
import subprocess
import sys

import pytest
from scope.scope_addon.command_line import signals
from scope.scope_addon.command_line.terminal import ProgressBar, ProgressLine, print_message


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_bar_is_replaced_by_the_next_and_removed_at_the_end() -> None:
    stream = Terminal()
    with ProgressBar(stream, show=True) as bar:
        bar("Finding", 15, 60)
        bar("Finding", 60, 60)
        bar("Writing", 0, 0)
    lines = stream.getvalue().split("\r\x1b[K")
    assert lines[0] == lines[-1] == ""
    assert lines[1] == f"{'Finding':<20} [{'#' * 7}{'.' * 23}] 15/60"
    assert "[" + "#" * 30 + "] 60/60" in lines[2]
    assert lines[3].rstrip() == "Writing"


@pytest.mark.skipif(os.name == "nt", reason="needs a terminal of POSIX")
@pytest.mark.parametrize(("columns", "shown"), [(40, 39), (200, 120), (0, 79)])
def test_a_line_does_not_reach_the_end_of_the_terminals(columns: int, shown: int) -> None:
    """It would wrap, and stay above the next ones. A terminal that says 0 does not know."""
    fcntl = pytest.importorskip("fcntl")
    termios = pytest.importorskip("termios")
    reader, writer = os.openpty()
    with open(reader, "rb"), open(writer, "w", encoding="utf-8") as stream:
        fcntl.ioctl(writer, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        ProgressLine(stream, show=True).write("x" * 120)
        assert os.read(reader, 1000) == b"\r\x1b[K" + b"x" * shown


def test_elsewhere_nothing_is_shown() -> None:
    stream = Terminal()
    file = io.StringIO()
    with ProgressBar(stream, show=False) as bar, ProgressLine(file, show=True) as line:
        bar("Finding", 1, 2)
        line.write("text")
    assert stream.getvalue() == file.getvalue() == ""


def test_work_that_has_lost_its_interrupt_stops_at_the_next_progress() -> None:
    bar = ProgressBar(io.StringIO(), show=False)
    signals.received.append(2)
    try:
        with pytest.raises(KeyboardInterrupt):
            bar("Finding", 1, 2)
    finally:
        signals.received.clear()
    bar("Finding", 1, 2)


def test_a_message_has_a_line_of_its_own_below_a_bar(monkeypatch) -> None:
    for stream, clear in ((Terminal(), "\r\x1b[K"), (io.StringIO(), "")):
        monkeypatch.setattr(sys, "stderr", stream)
        print_message("done")
        assert stream.getvalue() == f"{clear}scope: done\n"


@pytest.mark.skipif(os.name == "nt", reason="closes descriptors of POSIX")
@pytest.mark.parametrize("closed", ["1", "0 1 2"])
def test_files_do_not_take_the_numbers_of_closed_streams(tmp_path, closed) -> None:
    """Messages would be written into the first files that are opened."""
    code = (
        "from scope.scope_addon.command_line.terminal import open_standard_streams\n"
        "import sys\n"
        "open_standard_streams()\n"
        f"file = open({str(tmp_path / 'result')!r}, 'w', encoding='utf-8')\n"
        "assert file.fileno() > 2\n"
        "try:\n"
        "    print('to stdout')\n"
        "    sys.stdout.flush()\n"
        "except OSError:\n"
        "    sys.stdout = None\n"
        "print('to stderr', file=sys.stderr)\n"
        "file.write('result')\n"
    )
    redirect = " ".join(f"{number}{'<' if number == '0' else '>'}&-" for number in closed.split())
    subprocess.run(["sh", "-c", f'exec "$0" -c "$1" {redirect}', sys.executable, code], check=True)
    assert (tmp_path / "result").read_text("utf-8") == "result"


@pytest.mark.skipif(os.name == "nt", reason="needs the C library by its POSIX name")
def test_output_of_c_libraries_is_not_part_of_the_report():
    """Blender's version is in C's buffer when the command begins."""
    code = (
        "import ctypes\n"
        "from scope.scope_addon.command_line.terminal import stdout_for_report\n"
        "c = ctypes.CDLL(None)\n"
        "c.puts(b'Blender 9.9')\n"
        "with stdout_for_report() as stdout:\n"
        "    c.puts(b'exporting')\n"
        "    print('{}', file=stdout)\n"
    )
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=buffered
    )
    assert (done.stdout, done.stderr) == ("{}\n", "Blender 9.9\nexporting\n")
