# SPDX-License-Identifier: GPL-3.0-or-later
"""Open pages in a real browser, use them as a reader does, and write what they show:
``check_pages.py FOLDER PAGE...``.

Writes screenshots and ``found.json`` into FOLDER, for ``compare_pages.py``. Runs inside
./scripts/debian, which has no packages for Python.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

from devtools import Browser

WINDOW = (1280, 900)
PHONE = (390, 844)
SHOWN = "[capturedMotion.row(), Number(document.getElementById('row').value)]"
LARGEST_MB = 20


class PageError(Exception):
    """A page does not do what it should."""


def check(condition: object, text: str) -> None:
    """Raise PageError with this text unless the condition holds."""
    if not condition:
        raise PageError(text)


def use(browser: Browser, page: Path, *, touch: bool) -> None:
    """Play, scrub, orbit and click plots; the frame shown must follow everywhere."""
    count = browser.evaluate("capturedMotion.motion.times.length")
    view = "[capturedMotion.view.azimuth, capturedMotion.view.elevation]"
    before = browser.evaluate(view)
    browser.drag("#view", 80, 30, touch=touch)
    after = browser.evaluate(view)
    check(
        abs(after[0] - before[0]) > 0.3 and after[1] > before[1],
        f"dragging did not orbit: {before} to {after}",
    )
    browser.click("#play")
    end = time.monotonic() + 30
    while browser.evaluate("capturedMotion.row()") < 2:
        check(time.monotonic() < end, "play does not move the motion")
    browser.click("#play")
    stopped = browser.evaluate("capturedMotion.row()")
    check(stopped == browser.evaluate("capturedMotion.row()"), "pause does not stop")
    if not touch:
        browser.click(".plot.timed", 0.5)
        row, slider = browser.evaluate(SHOWN)
        check(
            row == slider and abs(row - count / 2) <= 2,
            f"a click in the middle of a plot leads to row {row} of {count}",
        )
        cursor = browser.evaluate("document.querySelector('.plot .cursor').getAttribute('x1')")
        check(
            abs(float(cursor.rstrip("%")) - 100 * row / (count - 1)) < 1,
            f"the cursor is at {cursor} for row {row}",
        )
        browser.evaluate(f"(() => {{ const s = document.getElementById('row'); s.value = "
                         f"{count - 1};"
                         " s.dispatchEvent(new Event('input')); })()")  # fmt: skip
        check(browser.evaluate(SHOWN) == [count - 1] * 2, "the slider does not move the motion")
        if browser.evaluate("document.querySelector('#strip') !== null"):
            pictured = browser.evaluate(
                "(() => { const b = document.querySelector('#strip [aria-current]');"
                " return [Number(b.dataset.row), document.getElementById('picture').src === "
                "b.firstChild.src]; })()"
            )
            check(pictured == [count - 1, True], f"at the last row the overlay shows {pictured}")


def layout(browser: Browser) -> None:
    """Check that nothing is wider than the window."""
    wide = browser.evaluate(
        "document.documentElement.scrollWidth - document.documentElement.clientWidth"
    )
    check(wide <= 0, f"the page is {wide} px wider than the window")


def found_in(browser: Browser, wanted: dict[str, Any], shot: Path) -> dict[str, Any]:
    """Return joints and vertices at the wanted rows; show the first of them through the capture's
    camera.
    """
    found: dict[str, Any] = {"joints": {}, "vertices": {}}
    for row in wanted["rows"]:
        for person in range(wanted["people"]):
            key = f"{person} {row}"
            found["joints"][key] = browser.evaluate(
                f"capturedMotion.motion.joints({person}, {row})"
            )
            numbers = json.dumps(wanted["vertices"])
            found["vertices"][key] = browser.evaluate(
                f"capturedMotion.motion.vertices({person}, {row}, {numbers})"
            )
    browser.evaluate(f"capturedMotion.seek({wanted['rows'][0]})")
    browser.click("[data-view=camera]")
    found["view"] = browser.box("#view")
    browser.screenshot(shot)
    return found


def check_page(folder: Path, page: Path, wanted: dict[str, Any] | None) -> dict[str, Any]:
    """Check one page in a light and a dark window, on a phone, and without WebGL; return what
    `found_in` returns.
    """
    size = page.stat().st_size / 1e6
    check(size < LARGEST_MB, f"it has {size:.1f} MB")
    found: dict[str, Any] = {}
    with Browser() as browser:
        for name, window, dark in (
            ("light", WINDOW, False),
            ("dark", WINDOW, True),
            ("phone", PHONE, False),
        ):
            phone = window == PHONE
            browser.open(page, *window, dark=dark, touch=phone)
            browser.evaluate(
                "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
            )
            layout(browser)
            browser.screenshot(folder / f"{page.stem}.{name}.png", whole=True)
            if wanted is not None and name == "light":
                found = found_in(browser, wanted, folder / f"{page.stem}.camera.png")
            use(browser, page, touch=phone)
            check(not browser.complaints(), f"{name}: {'; '.join(browser.complaints())}")
    with Browser("--disable-3d-apis") as browser:
        browser.open(page, *WINDOW)
        said = browser.evaluate("document.getElementById('no-view').offsetHeight")
        check(said, "without WebGL, nothing is said about it")
        browser.evaluate("capturedMotion.seek(3)")
        check(browser.evaluate(SHOWN) == [3, 3], "without WebGL, the page cannot be played")
        check(not browser.complaints(), f"without WebGL: {'; '.join(browser.complaints())}")
    return found


def main() -> int:
    """Check the pages named on the command line; return 1 if one has a problem."""
    folder = Path(sys.argv[1])
    pages = [Path(name) for name in sys.argv[2:]]
    expected = json.loads((folder / "expected.json").read_text("utf-8"))
    found = {}
    status = 0
    for page in pages:
        try:
            found[page.name] = check_page(folder, page, expected.get(page.name))
            print(
                f"{page.name}: opens, draws and plays; {page.stat().st_size / 1e6:.1f} MB",
                flush=True,
            )
        except (PageError, RuntimeError) as error:
            print(f"browser: {page.name}: {error}", file=sys.stderr)
            status = 1
    (folder / "found.json").write_text(json.dumps(found))
    return status


if __name__ == "__main__":
    sys.exit(main())
