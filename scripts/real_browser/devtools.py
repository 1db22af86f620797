# SPDX-License-Identifier: GPL-3.0-or-later
"""A headless Chromium, driven over a pipe by its DevTools protocol. Standard library only: it runs
in a bare Debian.
"""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

_FLAGS = (
    *(
        "--headless=new",
        "--no-sandbox",
        "--remote-debugging-pipe",
        "--no-first-run",
        "--disable-extensions",
    ),
    *(
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--mute-audio",
    ),
    *(
        "--use-gl=angle",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--disable-dev-shm-usage",
    ),
    *("--hide-scrollbars", "--force-color-profile=srgb"),
)
_LOCAL = ("file:", "data:", "about:")
_TIMEOUT_S = 120.0


class Browser:
    """One page in one browser process. Collects what the page logs, throws and requests."""

    def __init__(self, *flags: str) -> None:
        """Start the browser with an empty page.

        :param flags: further flags of Chromium, such as ``--disable-3d-apis``.
        """
        self._profile = tempfile.mkdtemp(prefix="browser-")
        read_commands, self._commands = os.pipe()
        self._answers, write_answers = os.pipe()
        command = ["chromium", *_FLAGS, *flags, f"--user-data-dir={self._profile}", "about:blank"]
        # The browser reads commands from descriptor 3 and writes answers to 4.
        script = f'exec "$@" 3<&{read_commands} 4>&{write_answers}'
        self._process = subprocess.Popen(
            ["bash", "-c", script, "--", *command],
            pass_fds=(read_commands, write_answers),
            stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
        os.close(read_commands)
        os.close(write_answers)
        self._buffer = b""
        self._last = 0
        self._session = None
        self.events: list[dict[str, Any]] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)[
            "sessionId"
        ]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        self._session = None
        with suppress(RuntimeError, OSError, subprocess.TimeoutExpired):
            # with all its processes, which otherwise write into the profile for a moment
            self.call("Browser.close")
            self._process.wait(20)
        self._process.kill()
        self._process.wait()
        os.close(self._commands)
        os.close(self._answers)
        shutil.rmtree(self._profile, ignore_errors=True)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the protocol and return its result.

        :raises RuntimeError: the browser answers with an error, not in time, or ends.
        """
        self._last += 1
        message = {"id": self._last, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._commands, data) :]
        end = time.monotonic() + _TIMEOUT_S
        while True:
            answer = self._read(end, method)
            if answer.get("id") == self._last:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                result: dict[str, Any] = answer["result"]
                return result
            self.events.append(answer)

    def _read(self, end: float, method: str) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            if not select.select([self._answers], [], [], max(0.0, end - time.monotonic()))[0]:
                raise RuntimeError(
                    f"{method}: the browser did not answer within {_TIMEOUT_S:.0f} s"
                )
            data = os.read(self._answers, 1 << 20)
            if not data:
                raise RuntimeError(f"{method}: the browser ended")
            self._buffer += data
        text, _, self._buffer = self._buffer.partition(b"\0")
        answer: dict[str, Any] = json.loads(text)
        return answer

    def open(
        self, path: Path, width: int, height: int, *, dark: bool = False, touch: bool = False
    ) -> None:
        """Open a page from a file, and wait until it is complete."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=2 if touch else 1,
            mobile=touch,
        )
        self.call("Emulation.setTouchEmulationEnabled", enabled=touch)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.call(
            "Network.emulateNetworkConditions",
            offline=True,
            latency=0,
            downloadThroughput=0,
            uploadThroughput=0,
        )
        self.call("Page.navigate", url=path.as_uri())
        end = time.monotonic() + _TIMEOUT_S
        while self.evaluate("document.readyState + location.protocol") != "completefile:":
            if time.monotonic() > end:
                raise RuntimeError(f"{path} was not complete within {_TIMEOUT_S:.0f} s")
            time.sleep(0.05)

    def evaluate(self, expression: str) -> Any:
        """Return the value of an expression; a promise is awaited.

        :raises RuntimeError: it throws.
        """
        done = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        if "exceptionDetails" in done:
            details = done["exceptionDetails"]
            raise RuntimeError(
                f"{expression}: {details.get('exception', {}).get('description', details['text'])}"
            )
        return done["result"].get("value")

    def screenshot(self, path: Path, *, whole: bool = False) -> None:
        """Write a picture of the window, or of the whole page, as PNG."""
        done = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        path.write_bytes(base64.b64decode(done["data"]))

    def box(self, selector: str) -> dict[str, float]:
        """Return left, top, width and height of an element in the window, after scrolling it into
        view.
        """
        found: dict[str, float] = self.evaluate(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)});"
            " e.scrollIntoView({block: 'center'});"
            " const b = e.getBoundingClientRect();"
            " return {left: b.left, top: b.top, width: b.width, height: b.height}; })()"
        )
        return found

    def drag(self, selector: str, dx: float, dy: float, *, touch: bool = False) -> None:
        """Press in the middle of an element, move, and release; with a finger or the mouse."""
        box = self.box(selector)
        x = box["left"] + box["width"] / 2
        y = box["top"] + box["height"] / 2
        points = [(x + dx * k / 5, y + dy * k / 5) for k in range(6)]
        if touch:
            moves = [("touchMove", [point]) for point in points[1:]]
            for kind, where in (("touchStart", points[:1]), *moves, ("touchEnd", [])):
                self.call(
                    "Input.dispatchTouchEvent",
                    type=kind,
                    touchPoints=[{"x": a, "y": b} for a, b in where],
                )
            return
        moves = [("mouseMoved", point) for point in points]
        for kind, (a, b) in (("mousePressed", points[0]), *moves, ("mouseReleased", points[-1])):
            pressed = 1 if kind != "mouseReleased" else 0
            self.call(
                "Input.dispatchMouseEvent",
                type=kind,
                x=a,
                y=b,
                button="left",
                buttons=pressed,
                clickCount=1,
            )

    def click(self, selector: str, share: float = 0.5) -> None:
        """Click an element at a share of its width."""
        box = self.box(selector)
        x = box["left"] + share * box["width"]
        y = box["top"] + box["height"] / 2
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def complaints(self) -> list[str]:
        """List errors and warnings on the console, exceptions, and requests to anything but files
        and data.
        """
        self.evaluate("new Promise((done) => requestAnimationFrame(() => setTimeout(done, 50)))")
        found = []
        for event in self.events:
            method = event.get("method")
            of = event.get("params", {})
            if method == "Runtime.exceptionThrown":
                details = of["exceptionDetails"]
                found.append(
                    f"exception: {details.get('exception', {}).get('description', details['text'])}"
                )
            elif method == "Runtime.consoleAPICalled" and of["type"] in (
                "error",
                "warning",
                "assert",
            ):
                found.append(f"console: {[each.get('value') for each in of['args']]}")
            elif method == "Log.entryAdded" and of["entry"]["level"] in ("error", "warning"):
                found.append(f"log: {of['entry']['text']}")
            elif method == "Network.requestWillBeSent" and not of["request"]["url"].startswith(
                _LOCAL
            ):
                found.append(f"request: {of['request']['url'][:200]}")
        return found
