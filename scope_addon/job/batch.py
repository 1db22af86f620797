# SPDX-License-Identifier: GPL-3.0-or-later
"""Capture a folder of footage, one process per clip: a clip that fails affects no other, finished clips are skipped.

``scope-batch.json`` in the output folder is rewritten after every clip, so that an interrupted batch can continue. A
clip is finished if its content (SHA-256), the options and the program are unchanged and its result files exist.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import IO, Any, NamedTuple

from ...solver.errors import InputError
from ..atomic_write import atomic_path
from ..errors import NO_PERSON, OutputError, UsageError, system_error_message
from ..footage import FOOTAGE_SUFFIXES, PICTURE_SUFFIXES, json_text
from .clips import OVERLAY, find_clips
from .parent import GRACE_S
from .request import code_version

REPORT_NAME = "scope-batch.json"
REPORT = ".report"  # between a clip's name and the suffix of its page
STATUSES = ("done", "skipped", "no_person", "failed")
_ROOT = Path(__file__).resolve().parents[2]
_WAIT_S = 1.0  # longest wait for a clip to finish, after which the wait is repeated
# Ctrl-C on a terminal must reach the batch only, which stops its clips: a second signal would interrupt their clean-up.
_NEW_GROUP = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
_OWN_GROUP: dict[str, Any] = {"creationflags": _NEW_GROUP} if _NEW_GROUP else {"process_group": 0}
_GRACE_S = GRACE_S + 3.0  # time for a clip to clean up after the batch is stopped


class Extras(NamedTuple):
    """What a batch writes of every clip besides the result files."""

    overlays: bool = False
    reports: bool = False


NO_EXTRAS = Extras()


class Batch:
    """A folder of footage and an output folder.

    :param program: command that takes ``capture FILE -o OUT --json``.
    :param options: arguments of every capture: flag to text; None for a flag that takes no value.
    :param suffixes: suffixes of the result files, such as ``.npz``.
    :param extras: what else to write of each clip.
    :raises InputError: the folder of footage does not exist.
    :raises OutputError: the output folder cannot be created.
    """

    def __init__(
        self,
        folder: Path,
        out: Path,
        program: Sequence[str],
        options: dict[str, str | None],
        suffixes: Sequence[str],
        extras: Extras = NO_EXTRAS,
    ) -> None:
        if not folder.is_dir():
            raise InputError(f"{folder} is not a folder; give the folder with the footage")
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"cannot create the folder {out}: {error.strerror}; choose another with --out") from error
        self.folder, self.out = folder.resolve(), out.resolve()
        self.report_file = out / REPORT_NAME
        self._program, self._options, self._suffixes, self._extras = list(program), options, suffixes, extras
        self._basis = self._key_basis()
        self._running: dict[subprocess.Popen[str], IO[str]] = {}  # process to its stdin, whose closing ends the process
        self._start_lock = threading.Lock()
        self._stopped = False

    def clips(self, recursive: bool) -> dict[str, Path]:
        """Return the clips by the name of their results; see `find_clips`."""
        several = self._options.get("--people") not in (None, "1", "largest")
        return find_clips(self.folder, self.out, recursive=recursive, several_people=several)

    def run(
        self,
        jobs: int,
        *,
        recursive: bool = False,
        again: bool = False,
        progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
        say: Callable[[str], None] = lambda text: None,
    ) -> dict[str, Any]:
        """Capture the clips that are not finished and return the report, which is also written to disk.

        :param jobs: number of clips that are captured in parallel.
        :param recursive: include subfolders.
        :param again: capture finished clips as well.
        :param progress: called with the stage, the number of finished clips and that of all clips.
        :param say: called with messages for the user.
        :return: the report; its ``exit_status`` is 1 if a clip failed, else 3 if a clip showed no person, else 0.
        :raises UsageError: the folder contains no footage.
        :raises OutputError: the report cannot be written.
        """
        clips = self.clips(recursive)
        if not clips:
            raise UsageError(
                f"no footage in {self.folder}: no file ends with one of {' '.join(FOOTAGE_SUFFIXES)}"
                + ("" if recursive else "; --recursive includes subfolders")
            )
        previous = {} if again else self._previous_entries()
        threads = {} if jobs == 1 else {"--threads": str(max(1, (os.cpu_count() or 1) // jobs))}
        entries: dict[str, dict[str, Any]] = {}
        with ThreadPoolExecutor(jobs) as pool:
            try:
                # Within the try, because a signal can arrive as soon as the first clip has begun.
                futures: dict[Future[dict[str, Any]], str] = {
                    pool.submit(self._capture_one, name, path, previous.get(name), threads): name
                    for name, path in clips.items()
                }
                progress("clips", 0, len(clips))
                pending = set(futures)
                while pending:
                    # The timeout is needed because a signal delivered to another thread does not wake this one.
                    finished, pending = wait(pending, timeout=_WAIT_S, return_when=FIRST_COMPLETED)
                    if not finished:
                        progress("clips", len(entries), len(clips))
                        continue
                    for future in finished:
                        entry = entries[futures[future]] = future.result()
                        message = f": {entry['message']}" if entry.get("message") else ""
                        say(f"{len(entries)}/{len(clips)} {entry['file']} {entry['status'].replace('_', ' ')}{message}")
                        if entry["status"] == "done":
                            for warning in entry["report"].get("warnings", []):
                                say(f"warning: {warning}")
                    report = self._write_report({name: entries[name] for name in clips if name in entries}, previous)
                    progress("clips", len(entries), len(clips))
            except BaseException:
                self._stop()
                pool.shutdown(cancel_futures=True)
                raise
        return report

    def _capture_one(
        self, name: str, path: Path, previous: dict[str, Any] | None, threads: dict[str, str]
    ) -> dict[str, Any]:
        """Capture a clip unless it is finished, and return its entry in the report, also if the clip fails."""
        start = time.monotonic()
        entry: dict[str, Any] = {"file": self._relative(path).as_posix(), "name": name}
        try:
            entry["key"] = self._key(path)
        except OSError as error:
            return entry | {"status": "failed", "message": f"{path} cannot be read: {error.strerror}"}
        if previous and previous.get("key") == entry["key"] and self._is_finished(previous):
            return previous | {"file": entry["file"], "status": previous["status"].replace("done", "skipped")}
        target = self.out / name
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            status, stdout, stderr = self._run_process(self._command(path, target, threads))
        except OSError as error:
            return entry | {"status": "failed", "message": system_error_message(error)}
        entry["seconds"] = round(time.monotonic() - start, 2)
        report = _last_object(stdout)
        if status == 0 and report is not None:
            outputs = [Path(p).relative_to(self.out).as_posix() for p in report.pop("outputs")]
            return entry | {"status": "done", "outputs": outputs, "report": report}
        if status == NO_PERSON:
            return entry | {"status": "no_person", "outputs": [], "message": _error_message(stderr)}
        message = _error_message(stderr) or f"the process ended with status {status}"
        return entry | {"status": "failed", "message": message}

    def _command(self, path: Path, target: Path, threads: dict[str, str]) -> list[str]:
        """Return the command that captures a clip; ``target`` is the path of its results without suffix."""
        arguments = [*self._program, "capture", str(path), "--json", "--quiet", "--stop-with-stdin"]
        for suffix in self._suffixes:
            arguments += ["-o", f"{target}{suffix}"]
        if self._extras.reports:
            arguments += ["--report", f"{target}{REPORT}.html"]
        if self._extras.overlays:
            suffix = ".png" if path.suffix.lower() in PICTURE_SUFFIXES else ".mp4"
            arguments += ["--overlay", f"{target}{OVERLAY}{suffix}"]
        for option, value in (threads | self._options).items():
            arguments.append(option if value is None else f"{option}={value}")  # one argument: a value may begin with -
        return arguments

    def _run_process(self, arguments: list[str]) -> tuple[int, str, str]:
        """Run a process and return its exit status, stdout and stderr."""
        with self._start_lock:  # so that _stop() knows every process
            if self._stopped:
                return 130, "", ""
            process = subprocess.Popen(
                arguments,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                encoding="utf-8",
                errors="replace",
                **_OWN_GROUP,
            )
            assert process.stdin is not None
            # Taken from the process, because communicate() would close it immediately.
            lifeline, process.stdin = process.stdin, None
            self._running[process] = lifeline
        try:
            with lifeline:
                stdout, stderr = process.communicate()
        finally:
            del self._running[process]
        return process.returncode, stdout, stderr

    def _stop(self) -> None:
        """Close stdin of all running processes, and kill those that do not end in time."""
        with self._start_lock:
            self._stopped = True
            running = dict(self._running)
        for lifeline in running.values():
            lifeline.close()
        end = time.monotonic() + _GRACE_S
        for process in running:
            try:
                process.wait(max(0.0, end - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()

    def _key_basis(self) -> hashlib._Hash:
        """Hash what is the same for every clip: the program, the options, and the files that they name."""
        digest = hashlib.sha256(code_version(_ROOT).encode())
        values = {k: v for k, v in self._options.items() if k != "--threads"}
        digest.update(json.dumps([sorted(values.items()), list(self._suffixes), self._extras]).encode())
        for value in values.values():
            files = [Path(value)] if value else []  # a body, a calibration, a network
            files += [path.with_suffix(".json") for path in files if path.suffix == ".onnx"]  # a network's description
            for file in filter(Path.is_file, files):
                _add_content(digest, file)
        return digest

    def _key(self, path: Path) -> str:
        """Hash the program, the options and the footage."""
        digest = self._basis.copy()
        for file in sorted(path.iterdir()) if path.is_dir() else [path]:
            if file.is_file():
                _add_content(digest, file)
        return digest.hexdigest()

    def _is_finished(self, entry: dict[str, Any]) -> bool:
        """Return whether an entry of the previous report is of a finished clip whose files still exist."""
        if entry.get("status") not in ("done", "skipped", "no_person"):
            return False
        outputs = entry.get("outputs")
        return isinstance(outputs, list) and all(isinstance(p, str) and (self.out / p).is_file() for p in outputs)

    def _previous_entries(self) -> dict[str, dict[str, Any]]:
        """Return the entries of the previous report by name; empty if the report is missing or damaged."""
        try:
            entries = json.loads(self.report_file.read_text(encoding="utf-8"))["files"]
            return {e["name"]: e for e in entries if isinstance(e["status"], str)}
        except (OSError, ValueError, KeyError, TypeError):
            return {}

    def _write_report(self, entries: dict[str, dict[str, Any]], previous: dict[str, dict[str, Any]]) -> dict[str, Any]:
        """Write and return the report. Clips that are still pending keep their entries of the previous report."""
        counts = Counter(e["status"] for e in entries.values())
        status = 1 if counts["failed"] else NO_PERSON if counts["no_person"] else 0
        report = {
            "folder": str(self.folder),
            "options": self._options,
            "counts": {s: counts[s] for s in STATUSES},
            "files": list(({n: e for n, e in previous.items() if n not in entries} | entries).values()),
            "exit_status": status,
        }
        try:
            with atomic_path(self.report_file) as temporary:
                temporary.write_text(json_text(report, indent=1), encoding="utf-8")
        except OSError as error:
            raise OutputError(f"cannot write {self.report_file}: {error.strerror}; free some space") from error
        return report

    def _relative(self, path: Path) -> Path:
        return path.relative_to(self.folder)


def _add_content(digest: hashlib._Hash, file: Path) -> None:
    with file.open("rb") as stream:
        digest.update(hashlib.file_digest(stream, "sha256").digest())


def _last_object(text: str) -> dict[str, Any] | None:
    """Return the JSON object on the last line; the lines before it are other output of the program."""
    for line in reversed(text.splitlines()):
        if line.startswith("{"):
            try:
                report = json.loads(line)
            except ValueError:
                return None
            return report if isinstance(report, dict) else None
    return None


def _error_message(stderr: str) -> str:
    """Return the error message without the prefix of the program's name."""
    lines = [line.strip() for line in stderr.splitlines() if line.strip()]
    own = [line.removeprefix("scope: ") for line in lines if line.startswith("scope: ") and "warning:" not in line]
    return (own or lines or [""])[-1]
