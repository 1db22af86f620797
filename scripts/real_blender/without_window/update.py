# SPDX-License-Identifier: GPL-3.0-or-later
"""Install the extension from a static repository, and update it from there: ``update.py ZIP``.

Runs in the Debian with its own Python, in /scope, without a window and in a home folder of its own.
The repository is a folder that Blender's own tool has listed, served on the loopback interface as
any web server would. Then a zip with a higher version takes the first one's place. Blender must
find and install it, and it must keep the preferences and capture.
"""

from __future__ import annotations

import functools
import json
import os
import shutil
import subprocess
import sys
import threading
import tomllib
import zipfile
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from live.mjpeg_camera import enable_loopback

OUT = Path("/scope/out")
HOME = Path("/scope/home_update")
SERVED = Path("/scope/served")
PORT = 8098
MANIFEST = "blender_manifest.toml"
FOUND = "found "
# Of a Blender with the extension; {} is what it does before it says what the preferences are.
SESSION = """
import bpy, json, time
from importlib import import_module
name = "bl_ext.static.scope"
preferences = bpy.context.preferences.addons[name].preferences
{}
print("found " + json.dumps([preferences.cache_limit_gb, preferences.threads]), flush=True)
"""
CHANGE = """
preferences.cache_limit_gb = 7
preferences.threads = 1
bpy.ops.wm.save_userpref()
"""
CAPTURE = """
bpy.ops.scope.use_sample()
bpy.context.scene.scope.quality = "FAST"
job = import_module(name + ".scope_addon.ui.capture_job").CaptureJob(bpy.context.scene)
while job.step():
    time.sleep(0.05)
assert any(item.type == "ARMATURE" for item in bpy.data.objects)
"""


def blender(*arguments: str) -> str:
    """Run Blender without a window; return what it says."""
    command = ["blender", "--background", "--online-mode", "--python-exit-code", "1", *arguments]
    environment = os.environ | {"HOME": str(HOME)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    print(*command, done.stdout, done.stderr, sep="\n", flush=True)
    assert done.returncode == 0, f"Blender ended with {done.returncode}"
    return done.stdout


def extension(*arguments: str) -> str:
    """Run Blender's own command for extensions; return what it says."""
    return blender("--command", "extension", *arguments)


def session(steps: str) -> list[int]:
    """Run steps in a Blender with the extension; return two of its preferences."""
    said = blender("--python-expr", SESSION.format(steps))
    line = next(line for line in said.splitlines() if line.startswith(FOUND))
    return json.loads(line.removeprefix(FOUND))


def serve() -> None:
    """Serve the repository's folder from a thread."""
    enable_loopback()
    handler = functools.partial(SimpleHTTPRequestHandler, directory=str(SERVED))
    server = ThreadingHTTPServer(("127.0.0.1", PORT), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()


def write_with_version(source: Path, target: Path, version: str) -> None:
    """Copy a zip, and let its manifest state another version."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for entry in old.infolist():
            content = old.read(entry)
            if entry.filename == MANIFEST:
                stated = tomllib.loads(content.decode())["version"]
                before = f'\nversion = "{stated}"'.encode()
                assert before in content
                content = content.replace(before, f'\nversion = "{version}"'.encode())
            new.writestr(entry, content)


def installed_version() -> str:
    """Return the version of the extension that Blender has installed."""
    (path,) = HOME.glob(f".config/blender/*/extensions/static/scope/{MANIFEST}")
    return tomllib.loads(path.read_text("utf-8"))["version"]


def main(archive: Path) -> None:
    """Install, set preferences, update, and capture; write out/update.json."""
    for folder in (HOME, SERVED):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
    serve()
    first = SERVED / "scope-first.zip"
    os.link(archive, first)
    extension("server-generate", "--repo-dir", str(SERVED))
    url = f"http://127.0.0.1:{PORT}/index.json"
    extension("repo-add", "--clear-all", "--name", "Static", "--url", url, "static")
    extension("install", "--sync", "--enable", "static.scope")
    versions = [installed_version()]
    preferences = [session(CHANGE)]
    write_with_version(archive, SERVED / "scope-second.zip", "99.0.0")
    first.unlink()
    extension("server-generate", "--repo-dir", str(SERVED))
    assert "99.0.0" not in installed_version()
    extension("update", "--sync")
    versions.append(installed_version())
    preferences.append(session(CAPTURE))
    found = {"versions": versions, "preferences": preferences}
    (OUT / "update.json").write_text(json.dumps(found))
    assert versions[1] == "99.0.0", versions
    assert preferences == [[7, 1], [7, 1]], preferences


if __name__ == "__main__":
    main(Path(sys.argv[1]))
