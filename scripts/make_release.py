# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that a release consists of, in build/release, from the sources of one commit.

The version is that of blender_manifest.toml, and the notes are its section of CHANGELOG.md. The
same commit gives the same bytes, except for the machine code, which is compiled once and kept.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
from build_extension import DIST, NETWORK_LICENCE, NETWORK_NAMES
from source_time import source_time

ROOT = Path(__file__).resolve().parent.parent
RELEASE = ROOT / "build" / "release"
NETWORKS = ROOT / "assets" / "networks"
HASHES = "SHA256SUMS"
NOTES = "notes.md"
LISTING = "listing.md"
UNRELEASED = "unreleased"
SECTIONS = ("What you get", "What it cannot do")  # of the README, in the listing's description
# The platform shows its pictures this wide and high.
PICTURE_SIZE = (1920, 1080)
PICTURES = ("result", "compared", "capturing")  # of the guide; the first is the featured one


def main() -> int:
    """Make a release; return the exit status."""
    parser = argparse.ArgumentParser(
        prog="./scripts/release", description=__doc__.partition("\n\n")[0]
    )
    parser.add_argument("--dry-run", action="store_true", help="make everything, but tag nothing")
    parser.add_argument(
        "--zips-at",
        metavar="URL",
        default="",
        help="folder from which the zips will be downloaded (default: that of index.json)",
    )
    parser.add_argument("--website", metavar="URL", default="", help="page for users")
    parser.add_argument("--sign", metavar="KEY", help="sign the hashes with this key of gpg")
    parser.add_argument(
        "--without-checks", action="store_true", help="where the same commit was checked before"
    )
    args = parser.parse_args()
    version = manifest()["version"]
    heading, notes = section_of(version, (ROOT / "CHANGELOG.md").read_text("utf-8"))
    tag = f"v{version}"
    is_tagged = check_sources(tag, heading, dry_run=args.dry_run)
    if not args.without_checks:
        run([str(ROOT / "scripts" / "check")])
    build = [sys.executable, str(ROOT / "scripts" / "build_extension.py")]
    run([*build, "--website", args.website])
    collect(notes, args.zips_at)
    if args.sign:
        run(["gpg", "--local-user", args.sign, "--armor", "--detach-sign", str(RELEASE / HASHES)])
    if not args.dry_run and not is_tagged:
        run(["git", "-C", str(ROOT), "tag", "--annotate", tag, "--message", f"Scope {version}"])
        print(f"Tagged {tag}: git push origin {tag} lets the forge draft the release.")
    print(f"{RELEASE}: {', '.join(sorted(path.name for path in RELEASE.iterdir()))}")
    return 0


def manifest() -> dict[str, Any]:
    """Return the extension's manifest."""
    return tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))


def section_of(version: str, changelog: str) -> tuple[str, str]:
    """Return the heading and the text of a version's section.

    :raises SystemExit: there is no such section, or it is empty.
    """
    for part in re.split(r"^## ", changelog, flags=re.M)[1:]:
        heading, _, text = part.partition("\n")
        if heading.split(",")[0] == version and text.strip():
            return heading, text.strip() + "\n"
    raise SystemExit(
        f"release: CHANGELOG.md has no section '## {version}, DATE' with what has changed; write "
        "it, or correct the version in blender_manifest.toml"
    )


def check_sources(tag: str, heading: str, *, dry_run: bool) -> bool:
    """Check that these sources may be released; return whether their commit has the tag already.

    :raises SystemExit: they may not; a dry run says so, and goes on.
    """
    problems = []
    if git("status", "--porcelain"):
        problems.append("there are changes that are not committed; commit or remove them")
    if UNRELEASED in heading or not re.search(r", \d{4}-\d\d-\d\d$", heading):
        problems.append(f"the changelog's heading is '{heading}'; end it with the date, YYYY-MM-DD")
    head = git("rev-parse", "HEAD")
    tagged = git("rev-parse", "--verify", "--quiet", f"{tag}^{{commit}}")
    if tagged and tagged != head:
        problems.append(f"the tag {tag} is at another commit; raise the version in the manifest")
    if problems and not dry_run:
        raise SystemExit(f"release: {'; '.join(problems)}")
    for problem in problems:
        print(f"release: this is a dry run, otherwise: {problem}", file=sys.stderr)
    return bool(tagged) and tagged == head


def git(*arguments: str) -> str:
    """Return what git says; empty where it fails, as in sources without a history."""
    command = ["git", "-C", str(ROOT), *arguments]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
    except OSError:
        return ""


def run(command: list[str]) -> None:
    """Run a command.

    :raises SystemExit: it failed.
    """
    done = subprocess.run(command, cwd=ROOT, check=False)
    if done.returncode:
        raise SystemExit(f"release: {Path(command[0]).name} failed; nothing was tagged")


def collect(notes: str, zips_at: str) -> None:
    """Put all of a release into its folder, which is replaced when everything is there.

    :param zips_at: URL of the folder that the zips will be in; empty for that of index.json.
    """
    RELEASE.parent.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=RELEASE.parent, prefix="release-") as name:
        folder = Path(name) / "release"
        folder.mkdir()
        for path in sorted([*DIST.glob("*.zip"), *DIST.glob("*.cdx.json")]):
            os.link(path, folder / path.name)
        listing = listing_of_zips(json.loads((DIST / "index.json").read_text("utf-8")), zips_at)
        (folder / "index.json").write_text(json.dumps(listing, indent=2) + "\n", "utf-8")
        licences = dict.fromkeys(text for entry in listing["data"] for text in entry["license"])
        stated = manifest() | {"license": list(licences)}
        build_wheel(folder)
        run([sys.executable, str(ROOT / "scripts" / "solver_wheel.py"), str(folder)])
        (folder / NOTES).write_text(notes, "utf-8")
        readme = (ROOT / "README.md").read_text("utf-8")
        (folder / LISTING).write_text(listing_text(stated, readme, notes), "utf-8")
        for picture in PICTURES:
            write_picture(ROOT / "assets" / "guide" / f"{picture}.jpg", folder / f"{picture}.png")
        write_hashes(folder)
        shutil.rmtree(RELEASE, ignore_errors=True)
        folder.rename(RELEASE)


def listing_of_zips(listing: dict[str, Any], zips_at: str) -> dict[str, Any]:
    """Return Blender's listing of a folder with other addresses of the zips, if they will be
    elsewhere: the pages of a forge, for one, hold less than six of them.
    """
    for entry in listing["data"] if zips_at else ():
        entry["archive_url"] = f"{zips_at.rstrip('/')}/{Path(entry['archive_url']).name}"
    return listing


def build_wheel(folder: Path) -> None:
    """Build the wheel from a copy of the tracked sources, since setuptools leaves files beside
    them, and of the networks.

    :raises SystemExit: this is no Git checkout, or networks are missing, or pip fails.
    """
    if not (ROOT / ".git").exists():
        raise SystemExit(f"release: {ROOT} is no Git checkout, and the wheel is of tracked files")
    networks = [NETWORKS / f"{name}.onnx" for name in NETWORK_NAMES] + [NETWORKS / NETWORK_LICENCE]
    if missing := [path.name for path in networks if not path.is_file()]:
        raise SystemExit(f"release: {NETWORKS} lacks {', '.join(missing)}; run ./scripts/setup")
    environment = os.environ | {"SOURCE_DATE_EPOCH": str(int(source_time().timestamp()))}
    listed = subprocess.run(
        ["git", "-C", str(ROOT), "ls-files", "-z"], capture_output=True, text=True, check=True
    )
    with tempfile.TemporaryDirectory(prefix="scope-wheel-") as name:
        built = [path.relative_to(ROOT).as_posix() for path in networks]
        for path in [*listed.stdout.split("\0"), *built]:
            if path.startswith(("tests/", "docs/", "benchmarks/")) or not (ROOT / path).is_file():
                continue
            target = Path(name) / path
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / path, target)
            target.chmod(0o644)
        command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check"]
        command += ["--no-deps", "--no-build-isolation", "--wheel-dir", str(folder), name]
        # The wheel states the mode of each file, in which the user's umask must not show.
        if subprocess.run(command, env=environment, umask=0o022, check=False).returncode:
            raise SystemExit("release: the wheel could not be built; see pip's message")


def listing_text(manifest: dict[str, Any], readme: str, notes: str) -> str:
    """Return the texts that the form of extensions.blender.org asks for, in its order."""
    introduction = readme.split("\n\n")[1]
    parts = [part.partition("\n") for part in re.split(r"^## ", readme, flags=re.M)]
    described = [f"### {title}\n{text.rstrip()}\n" for title, _, text in parts if title in SECTIONS]
    permissions = [f"- {name}: {reason}" for name, reason in manifest["permissions"].items()]
    text = "\n".join(
        [
            f"# {manifest['name']}\n",
            f"Tagline: {manifest['tagline']}\n",
            f"Type and tags: {manifest['type']}; {', '.join(manifest['tags'])}\n",
            f"Licences: {', '.join(manifest['license'])}\n",
            "## Permissions\n",
            *permissions,
            "\n## Description\n",
            f"{introduction}\n",
            *described,
            "## Release notes\n",
            notes.replace("### ", "#### "),
        ]
    )
    # Files of the repository cannot be linked from there.
    return re.sub(r"\[([^]]+)\]\((?![a-z]+:)[^)]*\)", r"\1", text)


def write_picture(source: Path, target: Path) -> None:
    """Write a picture in the platform's size, as large as it fits, on a background like Blender's.

    :raises SystemExit: the source cannot be read.
    """
    import cv2
    import numpy as np

    image = cv2.imread(str(source))
    if image is None:
        raise SystemExit(f"release: the picture {source} cannot be read")
    width, height = PICTURE_SIZE
    scale = min(width / image.shape[1], height / image.shape[0])
    size = round(image.shape[1] * scale), round(image.shape[0] * scale)
    resized = cv2.resize(
        image, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    )
    canvas = np.full((height, width, 3), 48, np.uint8)
    left = (width - size[0]) // 2
    top = (height - size[1]) // 2
    canvas[top : top + size[1], left : left + size[0]] = resized
    cv2.imwrite(str(target), canvas)


def write_hashes(folder: Path) -> None:
    """Write the SHA-256 of every file, as sha256sum does and checks."""
    lines = []
    for path in sorted(folder.iterdir()):
        with path.open("rb") as file:
            lines.append(f"{hashlib.file_digest(file, 'sha256').hexdigest()}  {path.name}\n")
    (folder / HASHES).write_text("".join(lines), "utf-8")


if __name__ == "__main__":
    sys.exit(main())
