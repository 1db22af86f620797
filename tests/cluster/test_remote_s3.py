# SPDX-License-Identifier: GPL-3.0-or-later
"""A batch whose footage and results are on S3, as moto's server imitates it."""

import json
import os
import sys

import pytest
from scope.scope_addon.cli import main
from scope.scope_addon.job.batch import REPORT_NAME

from ..required import package
from .conftest import started
from .test_runner import PROGRAM

pytestmark = pytest.mark.skipif(os.name == "nt", reason="a worker needs a POSIX system here")


@pytest.fixture
def store(monkeypatch):
    """An empty bucket, and variables by which this process, also its workers, find it."""
    s3fs = package("s3fs")
    server = package("moto.server")
    serving = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    serving.start()
    host, port = serving.get_host_and_port()
    values = {
        "ENDPOINT_URL": f"http://{host}:{port}",
        "ACCESS_KEY_ID": "key",
        "SECRET_ACCESS_KEY": "secret",
    }
    for name, value in {
        **values,
        "DEFAULT_REGION": "us-east-1",
        "EC2_METADATA_DISABLED": "true",
    }.items():
        monkeypatch.setenv(f"AWS_{name}", value)
    s3fs.S3FileSystem.clear_instance_cache()
    file_system = s3fs.S3FileSystem()
    file_system.mkdir("studio")
    yield file_system
    s3fs.S3FileSystem.clear_instance_cache()
    serving.stop()


def test_clips_on_s3_are_captured_once(store, tmp_path, capsys):
    for name, text in {"a": "a", "b": "broken", "below/d": "d"}.items():
        store.pipe_file(f"studio/clips/{name}.mp4", text.encode())
    program = [
        sys.executable,
        "-c",
        PROGRAM.replace("clip.with_suffix(", f"pathlib.Path({str(tmp_path)!r}, clip.stem + "),
    ]

    argv = ["batch", "s3://studio/clips", "--out", "s3://studio/out", "--formats", "npz"]
    with started(processes=False, protocol="tcp://") as cluster:
        argv += ["--recursive", "--scheduler", cluster.scheduler_address]
        for counts in ({"done": 2, "skipped": 0}, {"done": 0, "skipped": 2}):
            assert main(argv, program=program) == 1
            store.invalidate_cache()
            report = json.loads(store.cat_file(f"studio/out/{REPORT_NAME}"))
            assert report["counts"] == {**counts, "no_person": 0, "failed": 1}
            assert report["folder"] == "s3://studio/clips"
            said = capsys.readouterr().err.splitlines()
            assert said[-1].endswith(f"report in s3://studio/out/{REPORT_NAME}")
            results = {"a.npz": "a", "below/d.npz": "d"}
            assert store.find("studio/out") == sorted(
                f"studio/out/{name}" for name in [*results, REPORT_NAME]
            )
            for name, text in results.items():
                assert store.cat_file(f"studio/out/{name}").decode() == f"result of {text}"
    calls = {name: (tmp_path / f"{name}.calls").read_text("utf-8").count("\n") for name in "abd"}
    assert calls == {"a": 1, "b": 2, "d": 1}
