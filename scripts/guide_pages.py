# SPDX-License-Identifier: GPL-3.0-or-later
"""The guide as pages of HTML, which a browser shows without network: what the extension's
Documentation button opens.

Converts the Markdown that the repository's pages use: headings, paragraphs, lists, tables, code,
pictures, emphasis and links. A link to something that the extension does not contain becomes its
text.
"""

from __future__ import annotations

import html
import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

# What the guide links to, and what those pages explain together.
PAGES = ("guide", "live", "retargeting", "command_line", "motion_file", "own_networks")
FILES = tuple(f"docs/{name}.html" for name in PAGES)
_PICTURES = (".jpg", ".png", ".webp")
_STYLE = (
    "body{max-width:52rem;margin:2rem auto;padding:0 1rem;font:1rem/1.5 "
    "sans-serif;color:#222;background:#fff}"
    "img{max-width:100%}code,pre{background:#f2f2f2;border-radius:3px;padding:0 "
    ".2em}pre{padding:.6em;overflow:auto}"
    "table{border-collapse:collapse}td,th{border:1px solid #ccc;padding:.3em "
    ".6em;text-align:left;vertical-align:top}"
)
_FENCE = re.compile(r"^```")
_ITEM = re.compile(
    r"^( *)(-|\d+\.) "
    r"+(.*)"
)
_HEADING = re.compile(r"^(#+) (.*)")
_RULE = re.compile(r"^\|[\s:|-]+\|$")
Resolve = Callable[[str], str]


def write_pages(root: Path, staging: Path) -> None:
    """Write the pages of ``root``/docs to ``staging``/docs, with the pictures that ``staging``
    lacks.

    :param staging: the folder of an extension that has everything else already.
    """
    docs = staging / "docs"
    docs.mkdir(exist_ok=True)
    for name in PAGES:
        text = (root / "docs" / f"{name}.md").read_text("utf-8")
        title = text.splitlines()[0].lstrip("# ")
        body = "\n".join(
            _blocks(text.splitlines(), lambda target: _resolved(target, root, staging))
        )
        back = "" if name == PAGES[0] else f'<p><a href="{PAGES[0]}.html">Guide</a></p>\n'
        head = f'<meta charset="utf-8"><title>{html.escape(title)}</title><style>{_STYLE}</style>'
        (docs / f"{name}.html").write_text(f"<!DOCTYPE html>\n{head}\n{back}{body}\n", "utf-8")


def _resolved(target: str, root: Path, staging: Path) -> str:
    """Return what a link leads to in the extension; empty if that is not in it."""
    if target.startswith("#") or "://" in target:
        return target
    path, _, anchor = target.partition("#")
    inside = os.path.normpath(Path("docs", path))
    anchor = f"#{anchor}" if anchor else ""
    if (
        Path(inside).suffix == ".md"
        and Path(inside).parent == Path("docs")
        and Path(inside).stem in PAGES
    ):
        return f"{Path(inside).stem}.html{anchor}"
    if (staging / inside).is_file():
        return path  # without an anchor: a browser shows it as plain text
    if Path(inside).suffix in _PICTURES:
        (staging / "docs" / "pictures").mkdir(exist_ok=True)
        shutil.copy2(root / inside, staging / "docs" / "pictures")
        return f"pictures/{Path(inside).name}"
    return ""


def _blocks(lines: list[str], resolve: Resolve) -> Iterator[str]:
    """Convert lines of Markdown, block by block."""
    k = 0
    while k < len(lines):
        first = k
        k = _end_of_block(lines, k)
        if lines[first].strip():
            yield _block(lines[first:k], resolve)


def _end_of_block(lines: list[str], k: int) -> int:
    """Return the number of the line after the block that begins at line ``k``; an empty line is one
    of its own.
    """
    first = lines[k]
    if _FENCE.match(first):
        return next((n + 1 for n in range(k + 1, len(lines)) if _FENCE.match(lines[n])), len(lines))
    if _HEADING.match(first) or not first.strip():
        return k + 1

    def goes_on(n: int) -> bool:
        if first.startswith("|"):
            return lines[n].startswith("|")
        if _ITEM.match(first):
            return _belongs(lines[n]) or (
                not lines[n].strip() and n + 1 < len(lines) and _belongs(lines[n + 1])
            )
        return bool(lines[n].strip()) and not _starts_block(lines[n])

    return next((n for n in range(k + 1, len(lines)) if not goes_on(n)), len(lines))


def _block(lines: list[str], resolve: Resolve) -> str:
    """Convert the lines of one block."""
    if _FENCE.match(lines[0]):
        return f"<pre>{html.escape(chr(10).join(lines[1:-1]))}</pre>"
    if heading := _HEADING.match(lines[0]):
        level = len(heading[1])
        text = heading[2]
        return f'<h{level} id="{anchor_of(text)}">{_inline(text, resolve)}</h{level}>'
    if lines[0].startswith("|"):
        return _table(lines, resolve)
    if _ITEM.match(lines[0]):
        return _list(lines, resolve)
    return f"<p>{_inline(chr(10).join(lines), resolve)}</p>"


def _belongs(line: str) -> bool:
    """Whether a line continues a list: an item, or indented text of one."""
    return bool(_ITEM.match(line)) or (line.startswith("  ") and bool(line.strip()))


def _starts_block(line: str) -> bool:
    return bool(
        _FENCE.match(line) or _HEADING.match(line) or _ITEM.match(line) or line.startswith("|")
    )


def _list(lines: list[str], resolve: Resolve) -> str:
    """Convert the lines of one list, whose items may contain other blocks."""
    first = _ITEM.match(lines[0])
    assert first is not None
    kind = "ul" if first[2] == "-" else "ol"
    items = []
    for line in lines:
        item = _ITEM.match(line)
        if item and len(item[1]) == len(first[1]):
            items.append([item[3]])
        else:
            items[-1].append(line)
    found = []
    for item_lines in items:
        indent = min(
            (len(each) - len(each.lstrip()) for each in item_lines[1:] if each.strip()), default=0
        )
        inner = list(_blocks([item_lines[0], *(each[indent:] for each in item_lines[1:])], resolve))
        text = inner[0].removeprefix("<p>").removesuffix("</p>") if inner else ""
        found.append("<li>" + "\n".join([text, *inner[1:]]) + "</li>")
    return f"<{kind}>\n" + "\n".join(found) + f"\n</{kind}>"


def _table(lines: list[str], resolve: Resolve) -> str:
    rows = [
        re.split(r"(?<!\\)\|", line.strip().strip("|"))
        for line in lines
        if not _RULE.match(line.strip())
    ]
    cells = [[_inline(cell.strip().replace("\\|", "|"), resolve) for cell in row] for row in rows]
    marked = [
        "<tr>" + "".join(f"<{tag}>{cell}</{tag}>" for cell in row) + "</tr>"
        for tag, row in zip(["th", *["td"] * len(cells)], cells, strict=False)
    ]
    return "<table>\n" + "\n".join(marked) + "\n</table>"


def _inline(text: str, resolve: Resolve) -> str:
    """Convert code, pictures, links and emphasis within a block."""
    codes: list[str] = []

    def keep(found: re.Match[str]) -> str:
        codes.append(f"<code>{html.escape(found[1], quote=False)}</code>")
        return f"\0{len(codes) - 1}\0"

    def link(found: re.Match[str]) -> str:
        target = resolve(html.unescape(found[2]))
        return f'<a href="{html.escape(target)}">{found[1]}</a>' if target else found[1]

    text = html.escape(re.sub(r"`([^`]+)`", keep, text), quote=False)
    text = re.sub(
        r"!\[([^]]*)\]\(([^()\s]+)\)", lambda m: f'<img src="{resolve(m[2])}" alt="{m[1]}">', text
    )
    text = re.sub(r"\[([^]]+)\]\(([^()\s]+)\)", link, text)
    text = re.sub(r"\*\*([^*]+)\*\*", r"<strong>\1</strong>", text)
    text = re.sub(r"(?<![\w*])\*([^*\s][^*]*)\*(?![\w*])", r"<em>\1</em>", text)
    return re.sub(r"\0(\d+)\0", lambda m: codes[int(m[1])], text)


def anchor_of(heading: str) -> str:
    """Return the name under which links find a heading, as the repository's host makes it."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
