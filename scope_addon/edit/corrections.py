# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user corrects in a motion, as values and as the plain arrays of a motion file.

Frames are those of the footage (``Motion.frames``), so that corrections stay valid whatever
smoothing or frame rate the keys have.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..arrays import Float64Array
from ..errors import MotionFileError, UsageError
from ..kinematics.mirrored_limbs import other_side
from ..untrusted.files import in_one_line

REACH_S = 0.4  # Time over which a correction fades out on each side.
FEET = ("left", "right")
# What can rest on the floor beside feet.
RESTING_PARTS = (
    *(f"{side}_{part}" for part in ("hand", "elbow", "knee") for side in FEET),
    "seat",
    "back",
)
BODY = "body"
# What can be mirrored in depth: whole limbs, their lower bones alone, and the body.
DEPTH_PARTS = (
    *(f"{side}_{part}" for part in ("arm", "leg", "forearm", "shin") for side in FEET),
    BODY,
)
_HIGHEST_M = 1e3
_LAST_FRAME = 1 << 53
_MAX_INTERPOLATIONS = 1000


@dataclass(frozen=True)
class Pin:
    """A joint's position in one frame: in the image, or in the world if ``position`` is given."""

    frame: int
    joint: str
    pixel: tuple[float, float] | None = None  # In the upright frame, without lens distortion.
    # Metres, in the captured world, before an upright line turns it.
    position: tuple[float, float, float] | None = None
    reach: float = REACH_S  # seconds

    def __post_init__(self) -> None:
        """Check the values.

        :raises UsageError: neither or both of pixel and position are given, or a number is not
            finite.
        """
        if (self.pixel is None) == (self.position is None):
            raise UsageError(
                f"a pin of {self.joint} needs either a pixel or a position in the world"
            )
        numbers = [*(self.pixel or ()), *(self.position or ()), self.reach]
        if not np.isfinite(numbers).all() or self.reach <= 0:
            raise UsageError(
                f"the pin of {self.joint} in frame {self.frame} has the values {numbers}, which no "
                "fit can use"
            )


@dataclass(frozen=True)
class Span:
    """From one frame to another, both inclusive."""

    first: int
    last: int

    def __post_init__(self) -> None:
        """Check the values.

        :raises UsageError: the span is empty.
        """
        if max(abs(self.first), abs(self.last)) > _LAST_FRAME:
            raise UsageError(f"there are no frames from {self.first} to {self.last}")
        if self.last < self.first:
            raise UsageError(
                f"the span ends in frame {self.last}, before it begins in frame {self.first}; swap "
                "them"
            )


@dataclass(frozen=True)
class Contact(Span):
    """A foot that stands still on the floor, or another part that rests there."""

    part: str  # "left" or "right" for the foot, or one of `RESTING_PARTS`

    def __post_init__(self) -> None:
        """Check the values.

        :raises UsageError: the part cannot rest, or the span is empty.
        """
        if self.part not in (*FEET, *RESTING_PARTS):
            raise UsageError(
                f"the foot must be left or right, or what rests one of {', '.join(RESTING_PARTS)}, "
                f"not {self.part!r}"
            )
        super().__post_init__()


@dataclass(frozen=True)
class Exchange(Span):
    """Left and right limbs are exchanged."""

    limbs: str = "both"  # "arms", "legs" or "both"

    def __post_init__(self) -> None:
        """Check the values.

        :raises UsageError: the limbs are unknown, or the span is empty.
        """
        if self.limbs not in ("arms", "legs", "both"):
            raise UsageError(f"limbs must be arms, legs or both, not {self.limbs!r}")
        super().__post_init__()


@dataclass(frozen=True)
class DepthFlip(Span):
    """A limb or the body is mirrored in depth, as the camera sees it."""

    part: str  # One of `DEPTH_PARTS`.

    def __post_init__(self) -> None:
        """Check the values.

        :raises UsageError: the part is unknown, or the span is empty.
        """
        if self.part not in DEPTH_PARTS:
            raise UsageError(f"part must be one of {', '.join(DEPTH_PARTS)}, not {self.part!r}")
        super().__post_init__()


@dataclass(frozen=True)
class Interpolation(Span):
    """The motion is interpolated from the frames around the span."""


@dataclass(frozen=True)
class FeetOnFloor:
    """Feet in contact are put on the floor of the world that the upright line has turned; see
    `edit.edits.refloor`.
    """

    # Whether the soles in contact are levelled too, by turning the motion without the camera.
    level: bool = False
    # Whether frames in which a foot is under the floor are raised as well.
    lift: bool = True
    # Height in metres of the floor as it was corrected before, on which the feet are put.
    height: float = 0.0

    def __post_init__(self) -> None:
        """Check the values.

        :raises UsageError: the height is not a number of metres that a world has.
        """
        if not abs(self.height) < _HIGHEST_M:
            raise UsageError(
                f"feet cannot be put on a floor at {self.height} m, which no capture has"
            )


@dataclass(frozen=True)
class Upright:
    """The world, with the camera, is turned so that a line that the user drew is upright."""

    rows: tuple[float, ...]  # The rigid transform (4, 4) from the captured world, by rows.

    def __post_init__(self) -> None:
        """Check the values.

        :raises UsageError: the transform is not rigid.
        """
        T = np.array(self.rows, float)
        rigid = T.shape == (16,) and np.isfinite(T).all()
        T = T.reshape(4, 4) if rigid else np.zeros((4, 4))
        if not np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-6) or not np.allclose(
            T[3], [0, 0, 0, 1]
        ):
            raise UsageError("an upright line needs a rigid transform of the world")

    @staticmethod
    def of(transform: Float64Array) -> Upright:
        """Return the correction of a transform (4, 4)."""
        return Upright(tuple(float(x) for x in transform.ravel()))

    @property
    def transform(self) -> Float64Array:
        """The transform (4, 4) from the captured world to the upright one."""
        return np.array(self.rows).reshape(4, 4)


@dataclass(frozen=True)
class Floor:
    """The world, with the camera, is moved up or down so that a foot rests on the floor in one
    frame.
    """

    frame: int
    height: float  # Metres above z = 0 of the world that the upright line has turned.

    def __post_init__(self) -> None:
        """Check the values.

        :raises UsageError: the height is not a number of metres that a world has.
        """
        if not abs(self.height) < _HIGHEST_M:
            raise UsageError(
                f"the floor in frame {self.frame} is {self.height} m high, which no capture has"
            )

    @property
    def transform(self) -> Float64Array:
        """The transform (4, 4) from the upright world to the one whose floor is z = 0."""
        out = np.eye(4)
        out[2, 3] = -self.height
        return out


Kind = TypeVar("Kind", bound=Any)
Correction = Pin | Contact | Exchange | DepthFlip | Interpolation | Upright | Floor | FeetOnFloor


def world_of(corrections: Sequence[Correction]) -> Float64Array | None:
    """Return the transform (4, 4) of the captured world by the upright line, then the floor; None
    without both.
    """
    out: Float64Array | None = None
    for c in (_only(corrections, Upright), _only(corrections, Floor)):
        if c is not None:
            out = c.transform if out is None else c.transform @ out
    return out


def _only(corrections: Iterable[Correction], kind: type[Kind]) -> Kind | None:
    """Return the correction of a kind of which there is one at most; None without it."""
    return next((c for c in corrections if isinstance(c, kind)), None)


def floor_height(corrections: Iterable[Correction]) -> float:
    """Return the floor's height in metres, 0 where it was not corrected."""
    floor = _only(corrections, Floor)
    return floor.height if floor else 0.0


def feet_on_floor(corrections: Iterable[Correction]) -> FeetOnFloor | None:
    """Return how feet are put on the floor; None where they are not."""
    return _only(corrections, FeetOnFloor)


def added(corrections: tuple[Correction, ...], new: Correction) -> tuple[Correction, ...]:
    """Return the corrections with a new one; a pin replaces the same joint's pin in the same frame.

    The same exchange or flip a second time undoes the first, so that neither remains. Where sides
    are exchanged, what was flipped or rests has the other side's name. An upright line and a floor
    move the world that those before have made, so that one of each remains. An interpolation
    replaces those within its span. Feet are put on the floor that was corrected last.

    :raises UsageError: sides are exchanged in some frames only of a flip or of what rests.
    """
    if isinstance(new, Upright | Floor):
        return _moved_on(corrections, new)
    if isinstance(new, FeetOnFloor):
        others = tuple(c for c in corrections if not isinstance(c, FeetOnFloor))
        return (*others, replace(new, height=floor_height(corrections)))
    if isinstance(new, Exchange | DepthFlip) and new in corrections:
        return without(corrections, corrections.index(new))
    if isinstance(new, Exchange):
        return (*_renamed(corrections, new), new)
    if isinstance(new, Interpolation):
        corrections = tuple(
            c for c in corrections if not (isinstance(c, Interpolation) and _is_within(c, new))
        )
    if isinstance(new, Pin):
        corrections = tuple(
            c
            for c in corrections
            if not (isinstance(c, Pin) and (c.frame, c.joint) == (new.frame, new.joint))
        )
    return corrections if new in corrections else (*corrections, new)


def without(corrections: tuple[Correction, ...], index: int) -> tuple[Correction, ...]:
    """Return the corrections without one. Where sides are no longer exchanged, what was flipped or
    rests has the other side's name.

    :raises UsageError: sides were exchanged in some frames only of a flip or of what rests.
    """
    kept = (*corrections[:index], *corrections[index + 1 :])
    gone = corrections[index]
    return _renamed(kept, gone) if isinstance(gone, Exchange) else kept


def _renamed(corrections: tuple[Correction, ...], exchange: Exchange) -> tuple[Correction, ...]:
    """Return the corrections with the other side's name for the limbs of flips and contacts in the
    span of an exchange that is added or removed: they are meant for a limb where it is.

    :raises UsageError: one of them is only partly in that span.
    """
    out: list[Correction] = []
    for each in corrections:
        if not isinstance(each, DepthFlip | Contact) or not _is_exchanged(each.part, exchange):
            out.append(each)
            continue
        if each.last < exchange.first or exchange.last < each.first:
            out.append(each)
            continue
        if each.first < exchange.first or exchange.last < each.last:
            part = f"{each.part}_foot" if each.part in FEET else each.part
            raise UsageError(
                f"one correction of the {part.replace('_', ' ')} is only partly in the frames in "
                "which left and right would change; remove it first, and add it again afterwards"
            )
        out.append(replace(each, part=other_side(each.part)))
    return tuple(out)


def _is_exchanged(part: str, exchange: Exchange) -> bool:
    """Return whether a flipped or resting part belongs to the limbs of an exchange."""
    side, _, kind = part.partition("_")
    if side not in FEET:
        return False
    limbs = "arms" if kind in ("arm", "forearm", "hand", "elbow") else "legs"
    return exchange.limbs in ("both", limbs)


def removed(
    corrections: tuple[Correction, ...], kinds: tuple[type[Correction], ...]
) -> tuple[Correction, ...]:
    """Return the corrections without these kinds; without a corrected floor, feet are put on the
    captured one.
    """
    kept = tuple(c for c in corrections if not isinstance(c, kinds))
    if floor_height(kept) == floor_height(corrections):
        return kept
    return tuple(replace(c, height=0.0) if isinstance(c, FeetOnFloor) else c for c in kept)


def _is_within(inner: Interpolation, outer: Interpolation) -> bool:
    return outer.first <= inner.first and inner.last <= outer.last


def _moved_on(corrections: tuple[Correction, ...], new: Upright | Floor) -> tuple[Correction, ...]:
    """Add what moves the present world: W' = N W, kept as W' = F' U' of a floor and an upright
    line.

    The transform of an upright line contains how the feet have levelled the motion before, see
    `edit.upright`, so they do not do so any more.
    """
    floor = _only(corrections, Floor)
    upright = _only(corrections, Upright)
    if isinstance(new, Floor):
        floor = Floor(new.frame, new.height + (floor.height if floor else 0.0))
    else:
        before = np.eye(4) if upright is None else upright.transform
        lowered = np.eye(4) if floor is None else floor.transform
        upright = Upright.of(np.linalg.inv(lowered) @ new.transform @ lowered @ before)
        corrections = tuple(
            replace(c, level=False) if isinstance(c, FeetOnFloor) else c for c in corrections
        )
    others = tuple(c for c in corrections if not isinstance(c, Upright | Floor))
    return (*others, *(c for c in (upright, floor) if c is not None))


class _Array(NamedTuple):
    """One of the arrays in which a motion file has the corrections of a kind, a row for each; see
    docs/motion_file.md.
    """

    name: str
    value: type[int | float | str | bool]
    row_shape: tuple[int, ...]
    fields: tuple[str, ...]  # that a row holds

    def made_of(self, corrections: Iterable[Correction]) -> NDArray[Any]:
        """Return the array. Coordinates that a pin does not have are NaN."""
        missing = (np.nan,) * math.prod(self.row_shape)
        rows = []
        for correction in corrections:
            values = [getattr(correction, field) for field in self.fields]
            rows.append([missing if value is None else value for value in values])
        dtype = {int: np.int64, float: np.float64, str: np.str_, bool: np.bool_}[self.value]
        return np.array(rows, dtype).reshape(-1, *self.row_shape)

    def checked(self, arrays: Mapping[str, NDArray[Any]]) -> NDArray[Any]:
        """Return the array of a motion file; an empty one if it is missing.

        :raises MotionFileError: it has the wrong shape, or does not say what is true or false.
        """
        array = np.asarray(arrays.get(self.name, np.zeros((0, *self.row_shape))))
        if array.ndim == 0 or array.shape[1:] != self.row_shape:
            raise MotionFileError(
                f"{self.name} must have shape {('N', *self.row_shape)}, but has {array.shape}"
            )
        if self.value is bool and len(array) and array.dtype != np.bool_:
            raise MotionFileError(
                f"the motion's corrections are damaged: {self.name} is not true or false"
            )
        return array

    def values_of(self, row: Any) -> tuple[Any, ...]:
        """Return the values of the fields that a row holds; None for coordinates that are NaN."""
        if len(self.fields) > 1:
            return tuple(self.value(value) for value in row)
        if not self.row_shape:
            return (self.value(row),)
        numbers = tuple(float(value) for value in row.ravel())
        return (None if np.isnan(numbers).any() else numbers,)


_ARRAYS = {
    Pin: (
        _Array("pin_frames", int, (), ("frame",)),
        _Array("pin_joints", str, (), ("joint",)),
        _Array("pin_uv", float, (2,), ("pixel",)),
        _Array("pin_xyz", float, (3,), ("position",)),
        _Array("pin_reach", float, (), ("reach",)),
    ),
    Contact: (
        _Array("contact_spans", int, (2,), ("first", "last")),
        _Array("contact_feet", str, (), ("part",)),
    ),
    Exchange: (
        _Array("exchange_spans", int, (2,), ("first", "last")),
        _Array("exchange_limbs", str, (), ("limbs",)),
    ),
    DepthFlip: (
        _Array("depth_spans", int, (2,), ("first", "last")),
        _Array("depth_parts", str, (), ("part",)),
    ),
    Interpolation: (_Array("interpolated_spans", int, (2,), ("first", "last")),),
    Upright: (_Array("upright", float, (4, 4), ("rows",)),),
    Floor: (
        _Array("floor_frames", int, (), ("frame",)),
        _Array("floor_heights", float, (), ("height",)),
    ),
    FeetOnFloor: (
        _Array("snap_level", bool, (), ("level",)),
        _Array("snap_lift", bool, (), ("lift",)),
        _Array("snap_heights", float, (), ("height",)),
    ),
}
_ONCE = (Upright, Floor, FeetOnFloor)  # A motion has at most one of each.


def to_arrays(corrections: tuple[Correction, ...]) -> dict[str, NDArray[Any]]:
    """Return the arrays of a motion file."""
    return {
        array.name: array.made_of(c for c in corrections if isinstance(c, kind))
        for kind, arrays in _ARRAYS.items()
        for array in arrays
    }


def from_arrays(arrays: Mapping[str, NDArray[Any]]) -> tuple[Correction, ...]:
    """Read the corrections from the arrays of a motion file; keys may be missing.

    :raises MotionFileError: an array has the wrong shape, or a value is impossible.
    """
    found: list[Any] = []
    for kind, columns in _ARRAYS.items():
        checked = [column.checked(arrays) for column in columns]
        if kind is Interpolation and len(checked[0]) > _MAX_INTERPOLATIONS:
            raise MotionFileError(
                f"the motion has {len(checked[0])} interpolated spans, but may have at most "
                f"{_MAX_INTERPOLATIONS}"
            )
        if len({len(array) for array in checked}) > 1:
            raise MotionFileError(
                "the motion's corrections are damaged: they have different numbers of "
                f"{' and '.join(column.name for column in columns)}"
            )
        rows = [*zip(*checked, strict=True)]
        try:
            for row in rows[:1] if kind in _ONCE else rows:
                values: dict[str, Any] = {}
                for column, cell in zip(columns, row, strict=True):
                    values |= zip(column.fields, column.values_of(cell), strict=True)
                found.append(kind(**values))
        except (ValueError, TypeError, OverflowError, UsageError) as error:
            raise MotionFileError(
                f"the motion's corrections are damaged: {in_one_line(error)}"
            ) from error
    return tuple(found)
