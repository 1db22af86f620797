# SPDX-License-Identifier: GPL-3.0-or-later
"""The guide that the extension contains: every link leads somewhere inside it, and nothing that is
written is lost.
"""

import re
import shutil
from collections import Counter
from html.parser import HTMLParser

import pytest

from .script_modules import ROOT, script


class Page(HTMLParser):
    """What is in a page: its links, names, tags and text."""

    def __init__(self, path):
        super().__init__()
        self.links = []
        self.names = set()
        self.tags = Counter()
        self.text = ""
        self.open = []
        self.feed(path.read_text("utf-8"))
        assert self.open == [], f"{path.name} leaves {self.open} open"

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.tags[tag] += 1
        self.links += [given[key] for key in ("href", "src") if key in given]
        self.names |= {given["id"]} if "id" in given else set()
        if tag not in ("img", "meta"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += f"{data} " if "style" not in self.open else ""


@pytest.fixture(scope="module")
def extension(tmp_path_factory):
    """A folder with what the extension contains besides the pages, and the pages."""
    module = script("guide_pages")
    folder = tmp_path_factory.mktemp("extension")
    left_out = shutil.ignore_patterns("pictures", "*.npz", "*.onnx", "*.mp4")
    shutil.copytree(ROOT / "assets", folder / "assets", ignore=left_out)
    module.write_pages(ROOT, folder)
    return folder, [folder / name for name in module.FILES]


def test_every_link_leads_to_something_inside(extension):
    folder, paths = extension
    pages = {path: Page(path) for path in paths}
    count = 0
    for path, page in pages.items():
        for link in page.links:
            target, _, name = link.partition("#")
            goal = (path.parent / target).resolve() if target else path
            assert "://" not in link, f"{path.name} needs the network for {link}"
            assert goal.is_file(), f"{path.name} links to {link}"
            assert goal.is_relative_to(folder)
            assert not name or name in pages[goal].names, f"{path.name} links to {link}"
            count += 1
    assert count > 40


def test_the_guide_shows_all_its_pictures(extension):
    folder, (guide, *_) = extension
    wanted = re.findall(r"^!\[", (ROOT / "docs" / "guide.md").read_text("utf-8"), re.M)
    assert Page(guide).tags["img"] == len(wanted) > 5
    pictures = sum(path.stat().st_size for path in (folder / "docs" / "pictures").iterdir())
    assert pictures < 1e6


def test_nothing_that_is_written_is_lost(extension):
    for path in extension[1]:
        source = (ROOT / "docs" / f"{path.stem}.md").read_text("utf-8")
        page = Page(path)
        prose = re.sub(r"^```.*?^```$", "", source, flags=re.M | re.S)
        for tag, pattern in (
            ("h1", r"^# "),
            ("h2", r"^## "),
            ("h3", r"^### "),
            ("li", r"^ *(?:-|\d+\.) "),
        ):
            assert page.tags[tag] == len(re.findall(pattern, prose, re.M)), (path.name, tag)
        assert page.tags["tr"] == len(re.findall(r"^\|(?![\s:|-]+\|$)", prose, re.M)), path.name
        assert page.tags["pre"] == len(re.findall(r"^```.*?^```$", source, re.M | re.S))
        source = re.sub(r"!?\[([^]]*)\]\([^()\s]*\)", r" \1 ", source)
        source = re.sub(r"^ *\d+\. ", "", source, flags=re.M)  # the browser counts
        shown = set(
            re.findall(
                r"\w+", page.text + " ".join(re.findall(r'alt="([^"]*)"', path.read_text("utf-8")))
            )
        )
        code_languages = set(re.findall(r"^```(\w+)$", source, re.M))
        assert set(re.findall(r"\w+", source)) - shown - code_languages == set(), path.name
