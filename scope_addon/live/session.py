# SPDX-License-Identifier: GPL-3.0-or-later
"""From frames to the poses of one person: the causal stages in their order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace

import numpy as np

from ...solver import Body, State
from ..arrays import Float64Array, FloatArray
from ..capture.camera.intrinsics import Camera
from ..capture.fitting.frame_sequence import FittedTrack, rotations_of
from ..capture.media.frame import Frame
from ..capture.perception.observation import Observation
from ..capture.tracking.track import track_of
from ..kinematics.axes import transform_points
from .calibration import Calibrator, GradualCalibration, LiveCalibration
from .causal_fit import CausalFit, FittedFrame, Support
from .feet import FootHold
from .left_right import CausalLeftRight
from .pose import LivePose, Presence
from .smoothing import PoseFilter

CALIBRATED_S = 2.0  # after the person was first seen
CALIBRATE_AT_S = (0.0, 0.3, 0.7, 1.2, CALIBRATED_S)
# between two estimates of the world afterwards, and how much each of them sees
FOLLOW_S = 1.0
FOLLOWED_S = 4.0
# Time constants towards the estimates, see `GradualCalibration`.
SETTLING_S = 0.1
FOLLOWING_S = 10.0  # at least
SETTLED_S = 1.5  # after the last of the first estimates, when these have long been reached
CERTAIN_S = 60.0  # for which the world has been known when it has moved almost for the last time
HOLD_S = 0.5  # for which the pose of a person who is not seen is held, rather than lost
# for which somebody who stood on the floor and is not seen is still not below it
FLOOR_MEMORY_S = 2.0

Start = Callable[..., "Future[LiveCalibration]"]


def start_at_once(
    function: Callable[..., LiveCalibration], *args: object
) -> Future[LiveCalibration]:
    """Call a function as an executor would, but before returning: results do not depend on the
    speed of threads.
    """
    future: Future[LiveCalibration] = Future()
    future.set_result(function(*args))
    return future


def following_s(known_s: float) -> float:
    """Return the time constant with which a settled world follows its estimates.

    With the weight 1 / t, the world is the mean of all estimates. They come from frames that were
    fitted to the floor as it was: a bias b of theirs moves that mean by b ln(t), without end. After
    c = `CERTAIN_S`, the weight is c / t², and the world moves by b once more.

    :param known_s: for how long there have been estimates.
    """
    return max(FOLLOWING_S, known_s, known_s**2 / CERTAIN_S)


@dataclass(frozen=True)
class _Seen:
    """A frame in which the person was seen, and its fit; kept for a few seconds."""

    time_s: float
    observation: Observation
    fitted: FittedFrame


@dataclass
class _Estimates:
    """What is estimated of a person from the first frame on in which they are seen."""

    fit: CausalFit
    gradual: GradualCalibration
    current: LiveCalibration  # by which poses are given
    target: LiveCalibration  # the newest estimate, which `current` approaches


class LiveSession:
    """Turns the observations of one person into poses; one call per frame, in order.

    :param camera: as known from the user or the source.
    :param size: width and height of the frames, pixels.
    :param height_m: the person's stature, if it is known, metres.
    :param executor: of one thread, in which everything but the first calibration runs; None: in the
        calling thread.
    :param first_person: session of the source's first person, whose camera and world are taken;
        None: estimate them.
    """

    def __init__(
        self,
        body: Body,
        camera: Camera,
        size: tuple[int, int],
        height_m: float | None = None,
        executor: Executor | None = None,
        first_person: LiveSession | None = None,
    ) -> None:
        self._body = body
        self._size = size
        self._height_m = height_m
        self._first_person = first_person
        self._start: Start = executor.submit if executor else start_at_once
        self._calibrator = Calibrator(body, camera, size, height_m)
        self._filter = PoseFilter()
        self._feet = FootHold(body)
        self._left_right = CausalLeftRight(wait=executor is None)
        self._known: _Estimates | None = None  # None before the person was seen
        self._pending: Future[LiveCalibration] | None = None
        self._seen: deque[_Seen] = deque()
        # from which time is counted, later by pauses
        self._first_s = -np.inf
        self._last_seen_s = self._last_s = -np.inf
        self._calibrations = 0
        self._next_follow_s = np.inf
        self._last: LivePose | None = None

    def step(self, frame: Frame, observation: Observation | None) -> LivePose:
        """Return the pose in the next frame, in which the person was observed, or not."""
        observation = None if observation is None else self._left_right(observation)
        step_s = frame.timestamp_s - self._last_s
        # Time counts in which the person was seen: not while nobody was there, the computer slept,
        # or the source was interrupted.
        if observation is None or step_s > FLOOR_MEMORY_S:
            self._first_s += step_s
        fitted = self._fit_person(frame, observation) if observation is not None else None
        self._settle(frame.timestamp_s, may_estimate=fitted is not None)
        self._last_s = frame.timestamp_s
        if observation is None or fitted is None or self._known is None:
            self._last = self._without_person(frame)
        else:
            self._last = self._pose(self._known.current, frame, observation, fitted)
        return self._last

    def _fit_person(self, frame: Frame, observation: Observation) -> FittedFrame | None:
        time_s = frame.timestamp_s
        values = (
            observation.keypoints_px,
            observation.keypoints_confidence,
            observation.world_landmarks,
        )
        if not all(np.isfinite(value).all() for value in values):
            return None
        if self._known is None:
            self._known = self._first_estimates(frame, observation)
        if self._known is None:
            return None
        support = self._support(self._known, time_s, observation)
        fitted = self._known.fit.fit(time_s, observation, self._root_of_feet(time_s), support)
        if fitted is not None:
            self._seen.append(_Seen(time_s, observation, fitted))
            while self._seen[0].time_s < time_s - FOLLOWED_S:
                self._seen.popleft()
        return fitted

    def _first_estimates(self, frame: Frame, observation: Observation) -> _Estimates | None:
        """Return the estimates from the first frame; None as long as nobody has seen the source's
        first person, from whom camera and world are taken.
        """
        if self._first_person is not None:
            if self._first_person.camera is None:
                return None
            known = replace(self._first_person.camera, focal_deviation=0.0)
            self._calibrator = Calibrator(self._body, known, self._size, self._height_m)
        time_s = frame.timestamp_s
        self._calibrator.observe(frame.image_rgb, observation)
        target = self._calibrator.estimate([time_s], [observation])
        current = self._in_first_persons_world(target)
        fit = CausalFit(self._body, observation, current.camera, self._height_m)
        fit.set_shape(current.betas)
        self._first_s = time_s
        self._calibrations = 1
        return _Estimates(fit, GradualCalibration(target, SETTLING_S), current, target)

    def _root_of_feet(self, time_s: float) -> FloatArray | None:
        """Return about where the pelvis is, camera frame, if feet rested on the floor in the frame
        before.

        The size of a body in the picture does not tell a squat from a step back, but feet at rest
        do.
        """
        is_recent = time_s - self._last_seen_s < HOLD_S
        return (
            self._last.root_cam
            if self._last is not None and is_recent and self._feet.is_holding
            else None
        )

    def _support(
        self, known: _Estimates, time_s: float, observation: Observation
    ) -> Support | None:
        """Return what the body stands on, if it was seen a moment ago."""
        pause_s = time_s - self._last_seen_s
        if pause_s >= FLOOR_MEMORY_S:
            return None
        soles = known.fit.soles(observation)
        support = self._feet.support(known.current.T_world_camera, soles)
        return support if support is None or pause_s < HOLD_S else support.after_a_pause()

    def _settle(self, time_s: float, *, may_estimate: bool) -> None:
        """Start estimates that are due, take those that are done, and approach the newest one."""
        known = self._known
        if known is None:
            return
        if self._pending is not None and self._pending.done():
            known.target = self._pending.result()
            self._pending = None
        if self._pending is None and may_estimate:
            self._start_estimate(known, time_s)
        step_s = (
            float(np.clip(time_s - self._last_s, 0.0, HOLD_S)) if np.isfinite(self._last_s) else 0.0
        )
        world_s = following_s(time_s - self._first_s) if self.is_settled(time_s) else SETTLING_S
        before = known.current
        known.current = self._in_first_persons_world(
            known.gradual.step(known.target, step_s, world_s)
        )
        if known.current.camera is not before.camera:
            known.fit.set_camera(known.current.camera)
        if not np.array_equal(known.current.betas, before.betas):
            known.fit.set_shape(known.current.betas)

    def _in_first_persons_world(self, calibration: LiveCalibration) -> LiveCalibration:
        """Return the calibration with camera and world of the person from whom they are taken, if
        there is one.
        """
        if self._first_person is None or self._first_person._known is None:
            return calibration
        world = self._first_person._known.current
        return replace(
            calibration, camera=world.camera, up=world.up, camera_position=world.camera_position
        )

    def _start_estimate(self, known: _Estimates, time_s: float) -> None:
        times = [s.time_s for s in self._seen]
        observations = [s.observation for s in self._seen]
        if not times:
            return
        if self._calibrations < len(CALIBRATE_AT_S):
            if time_s - self._first_s >= CALIBRATE_AT_S[self._calibrations]:
                self._calibrations = int(
                    np.searchsorted(CALIBRATE_AT_S, time_s - self._first_s, side="right")
                )
                self._pending = self._start(self._calibrator.estimate, times, observations)
                self._next_follow_s = time_s + FOLLOW_S
        elif time_s >= self._next_follow_s and self._first_person is None:
            self._next_follow_s = time_s + FOLLOW_S
            track = track_of(times, observations)
            fitted = self._fitted_track(known.current.betas)
            start = known.target
            now = known.current
            # estimates that agree with the world as it is leave it so
            if self.is_settled(time_s):
                start = replace(start, up=now.up, camera_position=now.camera_position)
            self._pending = self._start(self._calibrator.follow, start, track, fitted)

    def _fitted_track(self, betas: FloatArray) -> FittedTrack:
        fits = [s.fitted for s in self._seen]
        return FittedTrack(
            np.array([fit.rotations for fit in fits]),
            np.array([fit.root_cam for fit in fits]),
            betas,
            np.ones(len(fits), bool),
            np.array([fit.joint_confidence for fit in fits]),
            0.0,
        )

    def is_settled(self, time_s: float) -> bool:
        """Whether the estimates of the first seconds have been reached at this time."""
        return bool(
            self._calibrations == len(CALIBRATE_AT_S)
            and time_s - self._first_s > CALIBRATED_S + SETTLED_S
        )

    @property
    def camera(self) -> Camera | None:
        """The camera as it is known now; None before somebody was seen."""
        return None if self._known is None else self._known.current.camera

    def _pose(
        self, now: LiveCalibration, frame: Frame, observation: Observation, fitted: FittedFrame
    ) -> LivePose:
        time_s = frame.timestamp_s
        T = now.T_world_camera
        if time_s - self._last_seen_s > HOLD_S:
            self._filter.reset()
            self._feet.reset()
        self._last_seen_s = time_s
        rotations, root = self._filter(fitted.rotations, fitted.root_cam, time_s)
        smooth = replace(fitted, rotations=rotations, root_cam=root)
        rotations, contact = self._feet.hold(time_s, now.betas, smooth, T, self.is_settled(time_s))
        keypoints = np.concatenate(
            [observation.keypoints_px, observation.keypoints_confidence[:, None]], axis=1
        )
        return LivePose(
            frame.index,
            time_s,
            Presence.SEEN,
            self.is_settled(time_s),
            now.betas,
            rotations,
            root,
            T,
            self._joints(now.betas, rotations, root, T),
            contact[:4],
            fitted.rotations,
            fitted.root_cam,
            keypoints,
            fitted.joint_confidence,
        )

    def _without_person(self, frame: Frame) -> LivePose:
        last = self._last or self._rest()
        is_held = frame.timestamp_s - self._last_seen_s <= HOLD_S
        return replace(
            last,
            index=frame.index,
            timestamp_s=frame.timestamp_s,
            presence=Presence.HELD if is_held else Presence.LOST,
            is_settled=self.is_settled(frame.timestamp_s),
            contact=np.zeros_like(last.contact),
            keypoints=np.zeros_like(last.keypoints),
            joint_confidence=np.zeros_like(last.joint_confidence),
        )

    def _rest(self) -> LivePose:
        body = self._body
        state = State.rest(self._body.K, self._body.P)
        rotations = rotations_of(state)
        height = float(body.stature(state.beta)) / 2
        level = LiveCalibration(
            Camera(np.eye(3), np.zeros(5), ""),
            state.beta,
            np.array([0, -1.0, 0]),
            np.array([0, -3.0, height]),
        )
        T = level.T_world_camera
        root = state.t_camera_root
        return LivePose(
            0,
            0.0,
            Presence.LOST,
            False,
            state.beta,
            rotations,
            root,
            T,
            self._joints(state.beta, rotations, root, T),
            np.zeros(4),
            rotations,
            root,
            np.zeros((33, 3)),
            np.zeros(body.K + 1),
            is_known=False,
        )

    def _joints(
        self,
        betas: FloatArray,
        rotations: FloatArray,
        root: FloatArray,
        T_world_camera: Float64Array,
    ) -> FloatArray:
        """Return the (K+1, 3) joints, world."""
        body = self._body
        _, joints = body.forward_kinematics(rotations, root - body.rest_joints(betas)[0], betas)
        return transform_points(T_world_camera, joints)
