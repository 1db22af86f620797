# SPDX-License-Identifier: GPL-3.0-or-later
"""JSON files of people and maps: what is something else is refused, and never overwritten."""

from __future__ import annotations

import json

import pytest
from scope.scope_addon.errors import OutputError
from scope.scope_addon.json_file import LARGEST_JSON_BYTES, load_map, read_json_object, save_map
from scope.solver.errors import InputError


def test_a_map_is_read_as_it_was_saved(tmp_path):
    path = tmp_path / "hero.json"
    save_map(path, "bone map", bones={"hips": "Hüfte"})
    assert load_map(path, "bone map")["bones"] == {"hips": "Hüfte"}
    save_map(path, "bone map", bones={})  # one of its kind is overwritten
    assert load_map(path, "bone map")["bones"] == {}
    with pytest.raises(InputError, match="is not a Scope expression map, version 1"):
        load_map(path, "expression map")


def test_a_map_with_half_a_surrogate_pair_is_read_as_it_was_saved(tmp_path):
    path = tmp_path / "hero.json"
    path.write_text(
        '{"format": "scope bone map", "version": 1, "bones": {"hips": "a \\ud800 \\" b"}}'
    )
    bones = load_map(path, "bone map")["bones"]
    save_map(path, "bone map", bones=bones)
    assert load_map(path, "bone map")["bones"] == bones == {"hips": 'a \ud800 " b'}


@pytest.mark.parametrize("content", ['{"format": "scope expression map"}', "text", "[]"])
def test_another_file_is_not_overwritten(tmp_path, content):
    path = tmp_path / "other.json"
    path.write_text(content)
    with pytest.raises(OutputError, match="is not a bone map, so it is not overwritten"):
        save_map(path, "bone map", bones={})
    assert path.read_text("utf-8") == content
    path.write_text("")
    save_map(path, "bone map", bones={})


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"{", "is not a bone map: it is not JSON"),
        (b"[1]", "it does not hold a JSON object; advice"),
        (b"\xff\xfe{}", "it is not JSON"),
        (b"[" * 100_000, "it is not JSON"),
        (b'{"a": 1' + b"0" * 400 + b"}", "it has a number of 401 digits"),
        (b"{}" + b" " * LARGEST_JSON_BYTES, "too large for a bone map"),
    ],
)
def test_what_is_no_object_is_refused_in_one_line(tmp_path, content, words):
    path = tmp_path / "hero.json"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_json_object(path, InputError, "bone map", "advice")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_byte_order_mark_and_the_largest_exact_number_are_read(tmp_path):
    path = tmp_path / "a.json"
    path.write_bytes(b"\xef\xbb\xbf" + json.dumps({"n": 2**53}).encode())
    assert read_json_object(path, InputError, "settings", "") == {"n": 2**53}
