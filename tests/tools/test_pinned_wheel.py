# SPDX-License-Identifier: GPL-3.0-or-later
"""Wheels that are not the pinned ones are refused, and one that is there is not downloaded
again.
"""

from __future__ import annotations

import hashlib
import subprocess
from pathlib import Path

import pytest
from scope.scope_addon.errors import SetupError
from scope.tools.pinned_wheel import PinnedDebian, PinnedSource, PinnedWheel

CONTENT = b"a wheel"
WHEEL = PinnedWheel(
    "made-up==1.0", "made_up-1.0-py3-none-any.whl", hashlib.sha256(CONTENT).hexdigest()
)


def test_a_wheel_with_another_checksum_is_set_aside(tmp_path: Path) -> None:
    (tmp_path / WHEEL.file_name).write_bytes(b"not the wheel")
    with pytest.raises(SetupError, match="SHA-256"):
        WHEEL.fetch(tmp_path)
    assert not (tmp_path / WHEEL.file_name).exists()


def test_a_wheel_that_is_there_is_not_downloaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: pytest.fail("pip was called"))
    (tmp_path / WHEEL.file_name).write_bytes(CONTENT)
    assert WHEEL.fetch(tmp_path) == tmp_path / WHEEL.file_name


def test_a_missing_wheel_is_downloaded_into_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def pip(command: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        assert command[-1] == WHEEL.requirement
        (Path(command[command.index("-d") + 1]) / WHEEL.file_name).write_bytes(CONTENT)
        return subprocess.CompletedProcess(command, 0, "", "")

    monkeypatch.setattr(subprocess, "run", pip)
    assert WHEEL.fetch(tmp_path / "new").read_bytes() == CONTENT


def test_what_pip_says_is_passed_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    failed = subprocess.CompletedProcess([], 1, "", "no matching distribution")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(SetupError, match="no matching distribution"):
        WHEEL.fetch(tmp_path)


@pytest.mark.parametrize(("kind", "client"), [(PinnedSource, "pip"), (PinnedDebian, "apt-get")])
def test_other_packages_come_by_their_own_clients_into_the_folder(
    kind: type[PinnedWheel], client: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = kind("made-up=1.0", "made-up_1.0_all.deb", WHEEL.sha256)

    def run(command: list[str], cwd: Path, **_: object) -> subprocess.CompletedProcess[str]:
        assert client in command
        if client == "pip":  # which compares the checksum before it runs any code of the archive
            wanted = Path(command[-1]).read_text("utf-8")
            assert wanted == f"{package.requirement} --hash=sha256:{package.sha256}\n"
        else:
            assert command[-1] == package.requirement
        (Path(cwd) / package.file_name).write_bytes(CONTENT)
        return subprocess.CompletedProcess(command, 0, "", "")

    monkeypatch.setattr(subprocess, "run", run)
    assert package.fetch(tmp_path / "new").read_bytes() == CONTENT


def test_a_client_that_is_not_there_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(*_: object, **__: object) -> None:
        raise FileNotFoundError("apt-get")

    monkeypatch.setattr(subprocess, "run", run)
    with pytest.raises(SetupError, match="apt-get"):
        PinnedDebian("made-up=1.0", "made-up_1.0_all.deb", WHEEL.sha256).fetch(tmp_path)
