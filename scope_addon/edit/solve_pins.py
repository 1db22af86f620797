# SPDX-License-Identifier: GPL-3.0-or-later
"""Solving a motion again around the frames that a user corrected.

Each corrected joint is treated in three steps. (1) The pose of every pinned key is fitted to the
pin, with the pose as it was as the prior. (2) What changed, as rotation vectors log(Ω_beforeᵀ
Ω_after) and a shift of the pelvis, is interpolated between the pinned keys and fades out beyond
them. (3) Every key of that span is fitted again with the interpolated pose as the prior, the
corrected joint where that pose has it, and feet that stand, other hands and the head where they
were. Keys outside of the span are not touched. The joints of a limb, and limbs whose spans overlap,
are treated in turns until all pins are met. A pin that its limb cannot reach is approached, see
``pose_refit.py``.

On captured walks whose arm was turned away from the known truth over half a second to a second,
pins of elbow and wrist reduce the wrist's mean error over the span from 83 pixels to 27, 15 and 10
with one, two and three pinned frames, and from 20 cm to 6, 3 and 1 cm if they are pinned in space.
With the pose as it was as the prior of step 3, only to 46 pixels and 11 cm.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ...solver.rotations import exp, log
from ..arrays import BoolArray, Float64Array, FloatArray, IndexArray
from ..kinematics.axes import UP, transposed
from ..kinematics.contact_points import FOOT_PARTS, SOLES
from ..kinematics.standing import standing_probability
from ..scene_gaps import usual_step_s, with_scene_gaps
from .clip import Clip, sample
from .corrections import FEET, Contact, Pin
from .pose_refit import (
    FLOOR_M,
    HELD,
    PINNED,
    PINNED_2D,
    SLACK_M,
    STANDING,
    Camera,
    Points,
    PoseRefit,
    limb_of,
    moves_trunk,
    pixel_of,
    within_reach,
)
from .spans import are_far_apart, faded

_CONTACT_REACH_S = 0.25
_FLOOR_M = 0.12  # A foot that stands within this height of z = 0 is put on it.
_SWEEPS = 6
_RESTING_ROUNDS = 5
_MET_M = 0.002
_MET_PX = 0.5
_STANDS = 0.05  # Least standing probability of a sole point that is held.
_AROUND_S = 0.5  # Time around the span that shows which feet stand.


@dataclass(frozen=True)
class Shot:
    """When and from where each frame of the footage was taken."""

    frames: NDArray[np.int64]  # (N,) source frames, increasing
    times: Float64Array  # (N,) seconds, on the clock of the clip that is corrected
    world_from_camera: Float64Array  # (N, 4, 4)
    intrinsics: Float64Array  # (N, 3, 3)
    valid: BoolArray  # (N,) whether the person was seen
    cuts_s: Float64Array  # (M,) when the footage cuts to another scene, on the same clock

    def with_gaps(self) -> Shot:
        """Return the shot on a clock that has gaps at scene cuts."""
        times = with_scene_gaps(self.times, self.cuts_s)
        return replace(self, times=times, cuts_s=np.zeros(0))

    def apart(self, clip: Clip) -> Clip:
        """Return a clip of this shot on the clock of `with_gaps`."""
        return replace(clip, times=with_scene_gaps(clip.times, self.cuts_s))

    def seen_at(self, times: Float64Array) -> BoolArray:
        """Return whether the person was seen in the frames nearest to times, (T,)."""
        return self.valid[np.searchsorted(0.5 * (self.times[1:] + self.times[:-1]), times)]

    def time(self, frame: int) -> float:
        """Return the time of a source frame."""
        return float(np.interp(frame, self.frames, self.times))

    def camera(self, frame: int) -> Camera:
        """Return world_from_camera (4, 4) and the intrinsics (3, 3) of a source frame."""
        row = int(np.abs(self.frames - frame).argmin())
        return self.world_from_camera[row], self.intrinsics[row]

    def project(self, frame: int, point: Float64Array) -> Float64Array:
        """Project a point (3,), world, to the pixel (2,) of a source frame."""
        return pixel_of(self.camera(frame), point)


@dataclass
class _Track:
    """The corrected joints of one limb: keys (H,), their measured points, and how far the
    correction reaches.
    """

    joints: list[str]  # from the trunk outwards
    keys: list[int]
    points: list[dict[str, Points]]
    cameras: list[Camera | None]
    reach: Float64Array  # (H,) seconds
    span: IndexArray  # keys that change, without gaps between the first and the last


def resolve(
    clip: Clip,
    body: Body,
    betas: FloatArray,
    corrections: Iterable[Contact | Pin],
    shot: Shot,
    slack: float = SLACK_M,
    floor: float = 0.0,
) -> Clip:
    """Correct a motion: feet that stand first, then pins.

    :param betas: (P,) shape coefficients.
    :param slack: metres by which the body may help a limb to reach a pin.
    :param floor: its height z, metres; −∞ on uneven ground.
    :return: a new clip; keys that no correction reaches are the same to the bit.
    :raises UsageError: a pin names a joint that the body does not have.
    """
    corrections = tuple(corrections)
    out = clip.copy()
    refit = PoseRefit(body, betas)
    stands = np.zeros((len(out), len(SOLES)), bool)
    for contact in (c for c in corrections if isinstance(c, Contact)):
        # What rests turns while it is moved, and another part of its skin is the lowest then.
        for _ in range(1 if contact.part in FEET else _RESTING_ROUNDS):
            track = _contact_track(refit, out, contact, shot, floor)
            if track is not None:
                _Correction(refit, out, [track], slack, floor).run()
        if contact.part in FEET:
            span = keys_of_span(out, contact.first, contact.last, shot)
            stands[np.ix_(span, _soles_of_foot(contact.part))] = True
    tracks = _pin_tracks(refit, out, [c for c in corrections if isinstance(c, Pin)], shot)
    for together in _clusters(tracks):
        _Correction(refit, out, together, slack, floor, stands).run()
    return out


def missed(clip: Clip, body: Body, betas: FloatArray, pin: Pin, shot: Shot) -> float:
    """Return how far the joint is from its pin: pixels of a pin in the image, metres of one in
    space.

    :param betas: (P,) shape coefficients.
    """
    at = sample(clip, np.array([shot.time(pin.frame)]))
    where = at.joints(body, betas)[0, body.joint_names.index(pin.joint)]
    return distance_to(pin, where, shot.camera(pin.frame))


def distance_to(pin: Pin, place: Float64Array, camera: Camera) -> float:
    """Return how far a place (3,), world, is from a pin: pixels of a pin in the image, metres of
    one in space.
    """
    if pin.pixel is not None:
        return float(np.linalg.norm(pixel_of(camera, place) - pin.pixel))
    return float(np.linalg.norm(place - np.array(pin.position)))


class _Correction:
    """The limbs of one cluster, treated in turns. Changes the clip that it is given."""

    def __init__(
        self,
        refit: PoseRefit,
        clip: Clip,
        tracks: list[_Track],
        slack: float,
        floor: float,
        stands: BoolArray | None = None,
    ) -> None:
        """Take what is corrected.

        :param stands: (T, 4) where the user says that soles stand.
        """
        self._refit = refit
        self._clip = clip
        self._tracks = tracks
        self._slack = slack
        times = clip.times
        first = min(track.span[0] for track in tracks)
        last = max(track.span[-1] for track in tracks)
        around = np.flatnonzero(
            (times >= times[first] - _AROUND_S) & (times <= times[last] + _AROUND_S)
        )
        R, at, soles = refit.place(clip.rotations[around], clip.root[around])
        lowest = floor + FLOOR_M
        # Feet may not go below the floor, or below where they were if that is lower; neither may
        # the other parts where the trunk is moved.
        heights = refit.skin.heights(R, at, UP)
        self._floor = np.full((len(clip), heights.shape[1]), lowest)
        feet = heights[:, : len(FOOT_PARTS)].min(axis=1, keepdims=True)
        heights[:, : len(FOOT_PARTS)] = feet
        self._floor[around] = np.minimum(lowest, heights)
        self._standing = np.zeros((len(clip), soles.shape[1]))
        self._standing[around] = standing_probability(
            soles, UP, times[around], uneven_ground=not np.isfinite(floor)
        )
        self._stands = np.zeros(self._standing.shape, bool) if stands is None else stands

    def run(self) -> None:
        """Treat every joint from the trunk outwards, then each limb as a whole until all are where
        they should be.
        """
        for track in self._tracks:
            self._limit(track)
            for joint in track.joints:
                self._treat(track, [joint])
        for _ in range(_SWEEPS):
            if self._all_met():
                return
            for track in self._tracks:
                self._treat(track, track.joints)

    def _treat(self, track: _Track, joints: list[str]) -> None:
        """Correct joints of a limb by the keys at which any of them is pinned."""
        span = track.span.tolist()
        clip = self._clip
        before = clip.rows(track.span)  # A copy, as every selection by indices.
        _, at, soles = self._refit.place(before.rotations, before.root)
        held = [self._held(track, key, at[k], soles[k]) for k, key in enumerate(span)]
        hard = [
            h for h, points in enumerate(track.points) if any(joint in points for joint in joints)
        ]
        turn, shift = self._changes(track, hard, before, held)
        known = clip.times[[track.keys[h] for h in hard]]
        reach = track.reach[hard]
        rotations = before.rotations @ exp(faded(before.times, known, turn, reach))
        root = before.root + faded(before.times, known, shift, reach)
        R, at, soles = self._refit.place(rotations, root)
        rise = self._rise(track, self._refit.skin.heights(R, at, UP))
        pinned = {track.keys[h]: h for h in hard}
        for k, key in enumerate(span):
            camera = None
            if key in pinned:
                camera = track.cameras[pinned[key]]
                points = _with_pins(held[k], track, pinned[key])
            else:
                points = _copied(held[k])
                for joint in joints:
                    self._follow(points, joint, track, at[k] + rise[k], soles[k] + rise[k])
            pose = self._refit.solve(rotations[k], root[k], tuple(track.joints), points, camera)
            clip.rotations[key], clip.root[key] = pose

    def _limit(self, track: _Track) -> None:
        """Move the pins of a limb that are out of its reach to where it can reach them, before it
        is first treated.
        """
        at = self._refit.place(self._clip.rotations[track.keys], self._clip.root[track.keys])[1]
        for h, camera in enumerate(track.cameras):
            pinned: dict[str, Float64Array] = {}
            moved: dict[str, Points] = {}
            for joint in (joint for joint in track.joints if joint in track.points[h]):
                points = track.points[h][joint]
                moved[joint] = points
                if len(points.numbers) == 1:  # A foot that stands has several.
                    reached = within_reach(
                        self._refit, joint, points.values[0], (at[h], pinned), camera, self._slack
                    )
                    moved[joint] = Points(points.numbers, [reached], points.weights)
                    if len(reached) == 3:
                        pinned[joint] = reached
            track.points[h] = moved

    def _changes(
        self,
        track: _Track,
        hard: list[int],
        before: Clip,
        held: list[Points],
    ) -> tuple[Float64Array, Float64Array]:
        """Fit the pinned keys; return the rotation vectors (H, K+1, 3) and shifts (H, 3) that this
        takes.
        """
        turns = []
        shifts = []
        for h in hard:
            k = int(track.keys[h] - track.span[0])
            points = _with_pins(held[k], track, h)
            pose = before.rotations[k], before.root[k]
            rotations, root = self._refit.solve(
                *pose, tuple(track.joints), points, track.cameras[h]
            )
            turns.append(log(transposed(before.rotations[k]) @ rotations))
            shifts.append(root - before.root[k])
        return np.array(turns), np.array(shifts)

    def _held(self, track: _Track, key: int, joints: Float64Array, soles: Float64Array) -> Points:
        """Return the points of other limbs, which stay where they are while a limb is corrected."""
        refit = self._refit
        own = track.joints
        points = Points()
        limb = limb_of(own[0])
        if not limb.endswith("arm") and np.isfinite(self._floor[key]).all():
            points.floor = self._floor[key].copy()
            others = slice(len(FOOT_PARTS), None)
            if moves_trunk(own):  # What is pinned itself goes where it is pinned.
                pinned = set().union(*(_parts_that_rest(refit.body, joint) for joint in own))
                points.floor[others][np.isin(refit.skin.parts[others], list(pinned))] = -np.inf
            else:
                points.floor[others] = -np.inf
        # A pinned hip moves over its standing foot; other joints release the limb's own soles.
        free = () if all(joint.endswith("hip") for joint in own) else refit.soles_of(limb)
        is_foot_pinned = any(joint.endswith(("ankle", "foot")) for joint in own)
        for k, name in enumerate(SOLES):
            if name in free:
                if self._stands[key, k] and not is_foot_pinned:
                    points.add(refit.number(name), soles[k], PINNED)
            elif self._standing[key, k] > _STANDS:
                points.add(refit.number(name), soles[k], STANDING * self._standing[key, k])
        for name in () if moves_trunk(own) else refit.ends:
            if limb_of(name) != limb:
                points.add(refit.number(name), joints[refit.joint(name)], HELD)
        for other in self._tracks:
            share = self._share(other, key) if other is not track else 0.0
            if share > 0.0:
                for name in other.joints:
                    points.add(refit.number(name), joints[refit.joint(name)], PINNED * share)
        return points

    def _rise(self, track: _Track, heights: Float64Array) -> Float64Array:
        """Return by how much, (T, 3), the points of a leg have to be higher for its foot to be
        above the floor.

        :param heights: (T, 4) of the feet's skin at the keys of the span.
        """
        own = [k for k, part in enumerate(FOOT_PARTS) if limb_of(part) == limb_of(track.joints[0])]
        lowest = heights[:, own].min(axis=1, initial=np.inf)
        return np.maximum(self._floor[track.span, 0] - lowest, 0.0)[:, None] * UP

    def _share(self, track: _Track, key: int) -> float:
        """Return 1 at a track's pinned keys, fading to 0 at the ends of its span."""
        times = self._clip.times
        ones = np.ones(len(track.keys))
        return float(faded(times[key : key + 1], times[track.keys], ones, track.reach)[0])

    def _follow(
        self,
        points: Points,
        joint: str,
        track: _Track,
        joints: Float64Array,
        soles: Float64Array,
    ) -> None:
        """Add the corrected points of a key that is not pinned, where the interpolated pose has
        them.
        """
        refit = self._refit
        for number in next(p[joint] for p in track.points if joint in p).numbers:
            sole = number - refit.number(SOLES[0])
            points.add(
                number,
                soles[sole] if 0 <= sole < len(soles) else joints[refit.joint(joint)],
                PINNED,
            )

    def _all_met(self) -> bool:
        """Return whether every pinned joint is where it should be; a standing foot is after one
        turn.
        """
        for track in self._tracks:
            joints = self._refit.place(
                self._clip.rotations[track.keys], self._clip.root[track.keys]
            )[1]
            for at, by_joint, camera in zip(joints, track.points, track.cameras, strict=True):
                for joint, points in by_joint.items():
                    if len(points.numbers) == 1 and not _met(
                        at[self._refit.joint(joint)], points.values[0], camera
                    ):
                        return False
        return True


def _met(where: Float64Array, target: Float64Array, camera: Camera | None) -> bool:
    if len(target) == 3 or camera is None:
        return float(np.linalg.norm(where - target)) < _MET_M
    return float(np.linalg.norm(pixel_of(camera, where) - target)) < _MET_PX


def _copied(points: Points) -> Points:
    return Points(list(points.numbers), list(points.values), list(points.weights), points.floor)


def _with_pins(held: Points, track: _Track, h: int) -> Points:
    """Return what is held at a key, and what is pinned there."""
    points = _copied(held)
    for pinned in track.points[h].values():
        points.numbers += pinned.numbers
        points.values += pinned.values
        points.weights += pinned.weights
    return points


def _span_within_reach(clip: Clip, keys: list[int], reach: Float64Array) -> IndexArray:
    """Return the keys that a track changes, without gaps between the first and the last."""
    known = clip.times[keys]
    inside = (clip.times > (known - reach).min()) & (clip.times < (known + reach).max())
    inside[keys] = True
    return np.flatnonzero(inside)


def _key_at(clip: Clip, time: float) -> int | None:
    """Return the key nearest to a time; None where the clip has none near."""
    key = int(np.abs(clip.times - time).argmin())
    spacing = usual_step_s(clip.times, alone=0.1)
    return key if abs(clip.times[key] - time) <= max(spacing, 0.05) else None


def keys_of_span(clip: Clip, first: int, last: int, shot: Shot) -> IndexArray:
    """Return the indices of a clip's keys at the source frames from ``first`` to ``last``, both
    inclusive: those up to half of a step away from them, and nearer to them than to other frames.
    """
    half = 0.5 * usual_step_s(shot.times, alone=0.01)
    begin = shot.time(first)
    end = shot.time(last)
    earlier = shot.times[shot.frames < first]
    later = shot.times[shot.frames > last]
    before = min(half, 0.5 * (begin - earlier[-1])) if len(earlier) else half
    after = min(half, 0.5 * (later[0] - end)) if len(later) else half
    return np.flatnonzero((clip.times >= begin - before) & (clip.times <= end + after))


def _pin_tracks(refit: PoseRefit, clip: Clip, pins: list[Pin], shot: Shot) -> list[_Track]:
    """Return a track per limb with pins, or several where they are so far apart that the keys
    between them stay.
    """
    found: dict[str, dict[int, list[Pin]]] = {}
    for pin in sorted(pins, key=lambda p: (p.frame, refit.joint(p.joint))):
        key = _key_at(clip, shot.time(pin.frame))
        if key is not None:
            found.setdefault(limb_of(pin.joint), {}).setdefault(key, []).append(pin)
    tracks = []
    for by_key in found.values():
        keys = sorted(by_key)
        times = clip.times[keys]
        gaps = np.minimum(np.diff(times, prepend=-np.inf), np.diff(times, append=np.inf))
        longest = np.array([max(pin.reach for pin in by_key[key]) for key in keys])
        reach = np.clip(gaps, longest / 4, longest)
        begins = 1 + np.flatnonzero(are_far_apart(times, reach))
        for part in np.split(np.arange(len(keys)), begins):
            own = {keys[k]: by_key[keys[k]] for k in part}
            tracks.append(_pin_track(refit, clip, own, reach[part], shot))
    return tracks


def _pin_track(
    refit: PoseRefit, clip: Clip, by_key: dict[int, list[Pin]], reach: Float64Array, shot: Shot
) -> _Track:
    """Return the track of a limb's pins.

    :param by_key: the pins at each key, of which there are H, in their order.
    :param reach: (H,) of these, seconds.
    """
    joints = sorted({pin.joint for here in by_key.values() for pin in here}, key=refit.joint)
    keys = list(by_key)
    track = _Track(joints, keys, [], [], reach, _span_within_reach(clip, keys, reach))
    for pins in by_key.values():
        track.points.append({pin.joint: _measured(refit, pin) for pin in pins})
        in_image = [pin for pin in pins if pin.pixel is not None]
        track.cameras.append(shot.camera(in_image[-1].frame) if in_image else None)
    return track


def _measured(refit: PoseRefit, pin: Pin) -> Points:
    number = refit.number(pin.joint)
    if pin.pixel is not None:
        return Points([number], [np.array(pin.pixel)], [PINNED_2D])
    return Points([number], [np.array(pin.position)], [PINNED])


def _clusters(tracks: list[_Track]) -> list[list[_Track]]:
    """Group the tracks whose spans overlap."""
    groups: list[list[_Track]] = []
    end = -1
    for track in sorted(tracks, key=lambda track: int(track.span[0])):
        if track.span[0] > end:
            groups.append([])
        groups[-1].append(track)
        end = max(end, int(track.span[-1]))
    # The trunk first: how far the limbs reach depends on where it is.
    return [sorted(group, key=lambda t: limb_of(t.joints[0]) != "trunk") for group in groups]


def _contact_track(
    refit: PoseRefit, clip: Clip, contact: Contact, shot: Shot, floor: float
) -> _Track | None:
    """Return the track of a foot that stands, or of another part that rests; None where the clip
    has no key.
    """
    span = keys_of_span(clip, contact.first, contact.last, shot)
    if not len(span):
        return None
    if contact.part in FEET:
        joints = [f"{contact.part}_foot"]
        points = [{joints[0]: _standing_points(refit, clip, contact.part, span, floor)}] * len(span)
    else:
        joints = resting_joints(contact.part)
        points = _resting_points(refit, clip, joints, span, floor)
    keys = span.tolist()
    reach = np.full(len(span), _CONTACT_REACH_S)
    around = _span_within_reach(clip, keys, reach)
    return _Track(joints, keys, points, [None] * len(span), reach, around)


def _soles_of_foot(side: str) -> IndexArray:
    return np.flatnonzero([name.startswith(f"sole/{side}") for name in SOLES])


def _standing_points(
    refit: PoseRefit, clip: Clip, side: str, span: IndexArray, floor: float
) -> Points:
    """Return the points of a sole at their median position, on the floor if that is near."""
    which = _soles_of_foot(side)
    soles = refit.place(clip.rotations[span], clip.root[span])[2][:, which]
    where = np.median(soles, axis=0)
    lowest = float(where[:, 2].min()) - floor
    if abs(lowest) < _FLOOR_M:
        where[:, 2] -= lowest
    numbers = [refit.number(SOLES[k]) for k in which]
    return Points(numbers, list(where), [PINNED] * len(which))


def _resting_points(
    refit: PoseRefit, clip: Clip, joints: list[str], span: IndexArray, floor: float
) -> list[dict[str, Points]]:
    """Return the points of joints that rest, at each key of a span: at their median position, as
    high as the lowest skin that moves with them has to be moved to the floor. Without a floor, that
    skin stays at its median height.
    """
    at = refit.place(clip.rotations[span], clip.root[span])[1]
    points: list[dict[str, Points]] = [{} for _ in span]
    for joint in joints:
        lowest = lowest_skin(clip.rows(span), refit.body, refit.betas, joint)
        ground = floor if np.isfinite(floor) else float(np.median(lowest))
        places = np.tile(np.median(at[:, refit.joint(joint)], axis=0), (len(span), 1))
        places[:, 2] = at[:, refit.joint(joint), 2] + ground - lowest
        for by_joint, place in zip(points, places, strict=True):
            by_joint[joint] = Points([refit.number(joint)], [place], [PINNED])
    return points


def resting_joints(part: str) -> list[str]:
    """Return the joints, from the trunk outwards, that are moved so that a part rests.

    :param part: one of `RESTING_PARTS`.
    """
    if part in ("seat", "back"):
        return ["pelvis"] if part == "seat" else ["pelvis", "spine3"]
    return [part.replace("hand", "wrist")]


def lowest_skin(clip: Clip, body: Body, betas: FloatArray, joint: str) -> Float64Array:
    """Return the heights z (T,) of the lowest skin that rests on the floor where a joint does: that
    of its own part, with a wrist the hand's, and with the pelvis the thighs'.

    :param betas: (P,) shape coefficients.
    """
    own = np.isin(body.strongest_joints, list(_parts_that_rest(body, joint)))
    poses = zip(*clip.parts(body, betas), strict=True)
    heights = [body.skin(*pose, betas)[own, 2].min() for pose in poses]
    return np.array(heights)


def _parts_that_rest(body: Body, joint: str) -> set[int]:
    """Return the numbers of the parts whose skin rests where a joint does."""
    names = body.joint_names
    found = {names.index(joint)}
    if joint == "pelvis":
        found |= {names.index("left_hip"), names.index("right_hip")}
    if joint.endswith("wrist"):
        for part in range(names.index(joint) + 1, len(names)):
            if int(body.parents[part]) in found:
                found.add(part)
    return found
