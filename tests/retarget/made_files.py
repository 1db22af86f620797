# SPDX-License-Identifier: GPL-3.0-or-later
"""Small binary FBX and glTF files of any content."""

import json
import struct
import zlib


def array(kind, length, content, *, compressed=True, size=None):
    data = zlib.compress(content) if compressed else content
    return (
        kind + struct.pack("<III", length, compressed, len(data) if size is None else size) + data
    )


def node(at, name, properties=(), children=()):
    """A node of version 7400 at an offset; children are functions of their offset."""
    body = b"".join(properties)
    inside = at + 13 + len(name) + len(body)
    inner = b""
    for child in children:
        inner += child(inside + len(inner))
    inner += bytes(13) if children else b""
    end = inside + len(inner)
    return struct.pack("<IIIB", end, len(properties), len(body), len(name)) + name + body + inner


def fbx(path, *properties):
    header = b"Kaydara FBX Binary  \0\x1a\0" + struct.pack("<I", 7400)
    made = node(
        27,
        b"Objects",
        [b"L" + bytes(8), b"S" + struct.pack("<I", 3) + b"abc"],
        [lambda at: node(at, b"A", properties)],
    )
    path.write_bytes(header + made + bytes(13) + b"footer of any content")
    return path


def glb(path, gltf, binary=bytes(400)):
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    chunks = (
        struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(binary), b"BIN\0")
        + binary
    )
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path
