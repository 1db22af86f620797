# SPDX-License-Identifier: GPL-3.0-or-later
"""The expression map: which shape key or control of a face follows which expressions, and how far.

Guessing from names of shape keys, reading, writing. Of faces that bones move, see
`face.face_controls`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np

from ...solver.errors import InputError
from ..arrays import Float64Array, FloatArray
from ..json_file import load_map, save_map
from ..kinematics.face import EXPRESSIONS
from .bone_map import is_name

LARGEST_FACTOR = 10.0
LARGEST_ANGLE = 180.0  # degrees
MOVED = ("left", "up", "forward")  # channels of a control: shares of a length of the face
# Degrees about left, up and forward: down, to the left, with the left side up.
TURNED = ("pitch", "yaw", "roll")
_KIND = "expression map"
# With so many keys of ARKit's names, others, such as visemes, are left alone.
_MIN_ARKIT = 5


def _both(*expressions: str, factor: float = 0.5) -> dict[str, float]:
    """Return the same factor for both sides of expressions."""
    return {f"{name}{side}": factor for name in expressions for side in ("Left", "Right")}


_BOTH_BLINK = _both("eyeBlink")
_LEFT_BLINK = {"eyeBlinkLeft": 1.0}
_RIGHT_BLINK = {"eyeBlinkRight": 1.0}
_SMILE = _both("mouthSmile")
_PRESS = {"mouthRollLower": 0.5, "mouthRollUpper": 0.5} | _both("mouthPress")
_ROUND = {"mouthFunnel": -0.8, "mouthPucker": -0.8}
_BROWS_DOWN = _both("browDown")
# An open mouth that neither rounds nor widens, in a scale where talk reaches 1.
_A = {"jawOpen": 1.5, "mouthClose": -1.5} | _ROUND
# Sounds that lips and jaw show; those of the tongue alone (TH, DD, kk, nn, RR) are not captured.
_OCULUS = {
    "aa": _A,
    "e": {"jawOpen": 0.5} | _both("mouthStretch", factor=0.7) | _ROUND,
    "i": _both("mouthSmile", factor=0.6) | _ROUND,
    "ih": _both("mouthSmile", factor=0.6) | _ROUND,
    "o": {"mouthFunnel": 1.2},
    "oh": {"mouthFunnel": 1.2},
    "u": {"mouthPucker": 1.2},
    "ou": {"mouthPucker": 1.2},
    "pp": _PRESS,
    "ff": {"mouthRollLower": 0.8, "mouthUpperUpLeft": 0.4, "mouthUpperUpRight": 0.4},
    "ch": {"mouthFunnel": 0.5, "mouthShrugUpper": 0.4},
    "ss": _both("mouthStretch", factor=0.3),
}
_VRM = {
    "aa": _A,
    "a": _A,
    "ih": _OCULUS["i"],
    "i": _OCULUS["i"],
    "ou": _OCULUS["u"],
    "u": _OCULUS["u"],
    "ee": _OCULUS["e"],
    "e": _OCULUS["e"],
    "oh": _OCULUS["o"],
    "o": _OCULUS["o"],
    "blink": _BOTH_BLINK,
    "blinkleft": _LEFT_BLINK,
    "blinkright": _RIGHT_BLINK,
    "happy": _SMILE,
    "joy": _SMILE,
    "angry": _BROWS_DOWN,
    "sad": {"browInnerUp": 1.0},
    "sorrow": {"browInnerUp": 1.0},
    "surprised": _both("eyeWide") | _both("browOuterUp", factor=0.3),
    "lookup": _both("eyeLookUp"),
    "lookdown": _both("eyeLookDown"),
    "lookleft": {"eyeLookOutLeft": 0.5, "eyeLookInRight": 0.5},
    "lookright": {"eyeLookInLeft": 0.5, "eyeLookOutRight": 0.5},
}
# VRoid Studio's names of the keys of VRM models, after the prefix.
_VROID = {
    **{f"mth{vowel}": _VRM[vowel] for vowel in "aiueo"},
    "eyeclose": _BOTH_BLINK,
    "eyecloseleft": _LEFT_BLINK,
    "eyecloseright": _RIGHT_BLINK,
    "mthfun": _SMILE,
    "brwangry": _BROWS_DOWN,
    "brwsorrow": {"browInnerUp": 1.0},
    "eyesurprised": _VRM["surprised"],
    "brwsurprised": _both("browOuterUp"),
}
_ARKIT = {name.lower(): name for name in EXPRESSIONS}


@dataclass
class ExpressionMap:
    """Shape keys and, for each, the factors of the expressions that it follows: value = Σ factor ·
    weight.

    ``controls`` are bones that move a face; each has such factors for some of the channels `MOVED`
    and `TURNED`.
    """

    keys: dict[str, dict[str, float]]
    controls: dict[str, dict[str, dict[str, float]]] = field(default_factory=dict)

    def check(self) -> None:
        """Check that the map can be used.

        :raises InputError: when there is no key or control, a channel or an expression is unknown,
            or a factor is out of range.
        """
        if not any(self.keys.values()) and not any(
            any(channels.values()) for channels in self.controls.values()
        ):
            raise InputError(
                "the expression map has no shape key and no control; add one, and "
                "choose its expression"
            )
        for key, factors in self.keys.items():
            _check_factors(f"shape key '{key}'", factors, LARGEST_FACTOR)
        for bone, channels in self.controls.items():
            for channel, factors in channels.items():
                if channel not in (*MOVED, *TURNED):
                    raise InputError(
                        f"control '{bone}' has the channel '{channel}'; use one of "
                        f"{', '.join((*MOVED, *TURNED))}"
                    )
                largest = LARGEST_ANGLE if channel in TURNED else LARGEST_FACTOR
                _check_factors(f"control '{bone}'", factors, largest)

    def values(self, weights: FloatArray) -> dict[str, Float64Array]:
        """Return the value (T,) of each shape key, 0 to 1.

        :param weights: (T, 52) in the order of `EXPRESSIONS`.
        """
        return {
            key: np.clip(weighted_sum(factors, weights), 0.0, 1.0)
            for key, factors in self.keys.items()
            if factors
        }


def weighted_sum(factors: Mapping[str, float], weights: FloatArray) -> Float64Array:
    """Return Σ factor · weight, (T,), of some expressions.

    :param weights: (T, 52) in the order of `EXPRESSIONS`.
    """
    columns = [EXPRESSIONS.index(name) for name in factors]
    return weights[:, columns].astype(float) @ np.array(list(factors.values()))


def guess_expression_map(keys: Iterable[str]) -> ExpressionMap:
    """Guess the map from the names of shape keys: ARKit's, else Oculus' visemes, else VRM's and
    VRoid's expressions.

    A key that closes both eyes is left out beside keys that close one each: together they would
    close the lids twice.
    """
    names = {key: _plain(key) for key in keys}
    arkit = {key: {_ARKIT[name]: 1.0} for key, name in names.items() if name in _ARKIT}
    if len(arkit) >= _MIN_ARKIT:
        return ExpressionMap(arkit)
    found = {}
    for key, name in names.items():
        viseme = name.partition("viseme")[2] if name.startswith("viseme") else ""
        for table, looked_up in (
            (_OCULUS, viseme),
            (_VROID, name.rpartition("fcl")[2]),
            (_VRM, name),
        ):
            if looked_up in table:
                found[key] = dict(table[looked_up])
                break
    found = arkit | found
    if _LEFT_BLINK in found.values() and _RIGHT_BLINK in found.values():
        found = {key: factors for key, factors in found.items() if factors != _BOTH_BLINK}
    return ExpressionMap(found)


def save_expression_map(expression_map: ExpressionMap, path: str | Path) -> None:
    """Write the map as JSON, atomically. Only an expression map is overwritten, or an empty file.

    :raises InputError: the map could not be loaded again, see `ExpressionMap.check`.
    :raises OutputError: when the file cannot be written, or is something else.
    """
    expression_map.check()
    content = {"shape_keys": expression_map.keys, "controls": expression_map.controls}
    save_map(Path(path), _KIND, **{name: entries for name, entries in content.items() if entries})


def load_expression_map(path: str | Path) -> ExpressionMap:
    """Read what ``save_expression_map`` wrote.

    :raises InputError: when the file cannot be read or is not a valid map.
    """
    path = Path(path)
    content = load_map(path, _KIND)
    keys = content.get("shape_keys", {})
    controls = content.get("controls", {})
    if not _are_named(keys) or not all(map(_are_factors, keys.values())):
        raise InputError(
            f"{path}: 'shape_keys' must be an object that maps each shape key to expressions and "
            "factors; "
            "correct the file"
        )
    if not _are_named(controls) or not all(
        _are_named(channels) and all(map(_are_factors, channels.values()))
        for channels in controls.values()
    ):
        raise InputError(
            f"{path}: 'controls' must be an object that maps each control to channels, and these "
            "to expressions and "
            "factors; correct the file"
        )
    out = ExpressionMap(
        {key: _floats(factors) for key, factors in keys.items()},
        {
            bone: {c: _floats(factors) for c, factors in channels.items()}
            for bone, channels in controls.items()
        },
    )
    try:
        out.check()
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return out


def _plain(key: str) -> str:
    """Return a key's name in lower case, without prefixes such as ``head.``, separators, and ``_L``
    written in full.
    """
    name = re.split(r"[.:|]", re.sub(r"[.](L|R)$", r"_\1", key))[-1]
    side = (
        re.search(r"(?:_|(?<=[a-z]))(L|R|l|r)$", name)
        if not name.islower() or "_" in name
        else None
    )
    if side and (name[side.start()] == "_" or side[1].isupper()):
        name = name[: side.start()] + ("left" if side[1].lower() == "l" else "right")
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _check_factors(what: str, factors: dict[str, float], largest: float) -> None:
    """Check the factors of one shape key, or of one channel of a control.

    :raises InputError: an expression is unknown, or a factor is out of range.
    """
    for expression, factor in factors.items():
        if expression not in EXPRESSIONS:
            raise InputError(
                f"{what} is mapped to '{expression}', which is not an expression; use one of "
                f"{', '.join(EXPRESSIONS)}"
            )
        if not abs(factor) <= largest:
            raise InputError(f"{what} has the factor {factor:g}; use at most {largest:g}")


def _are_named(entries: object) -> TypeGuard[dict[str, Any]]:
    return isinstance(entries, dict) and all(map(is_name, entries))


def _floats(factors: dict[str, float]) -> dict[str, float]:
    return {name: float(factor) for name, factor in factors.items()}


def _are_factors(factors: object) -> bool:
    return isinstance(factors, dict) and all(
        isinstance(f, (int, float)) and not isinstance(f, bool) for f in factors.values()
    )
