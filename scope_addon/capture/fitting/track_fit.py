# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver over a whole track: one shape for the clip, then every frame with that shape.

1. Some frames, spread over the clip, are fitted separately and then together with one shape
    (``fit_clip``).
2. Every frame is fitted with this shape, from the previous frame; after a gap from a cold start
    (`frame_sequence`).
3. Once floor, feet and balance are known (`ground`), all frames are fitted together
    (`world/clip_fit`).
4. From there, every frame is fitted alone once more: the raw motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....solver import ClipFit, Fit, fit_clip
from ...arrays import FloatArray, round_array
from ...clock import Progress
from .frame_sequence import FittedTrack, FrameSequence, is_usable
from .outline import fit_shape_to_outline, spread, usable_masks
from .prepared_track import PreparedTrack, Stance
from .stature import stature_sigma, with_population
from .weights import ROBUST, clip_weights, cold_stages

SHAPE_FRAMES = 64  # from which the shape is estimated; more frames add little
PROGRESS_FRAMES = 16  # between two reports


def fit_track(prepared: PreparedTrack, progress: Progress) -> FittedTrack:
    """Fit the body to a track that was seen in at least one frame.

    :param progress: called with the stage's name, the frames done and the total; 0: unknown.
    """
    progress("finding the shape", 0, 0)
    shape = _fit_shape(prepared)
    track = prepared.track
    frames = FrameSequence(prepared, round_array(shape.beta))
    T = len(track)
    for k in range(T):
        if track.seen[k]:
            frames.fit_next(k)
        frames.repeat_last(k)
        if k % PROGRESS_FRAMES == 0 or k == T - 1:
            progress("solving", k + 1, T)
    fitted = frames.fitted()
    root_cam = round_array(fitted.t_camera_root)
    return replace(fitted, t_camera_root=root_cam, height_sigma_m=_height_sigma(prepared, shape))


def fit_single_frame(prepared: PreparedTrack) -> Fit | None:
    """Fit the body, with a shape of its own, to a track of one frame; None if the measurements do
    not suffice.
    """
    (found,) = _fit_shape(prepared).frames
    return found if is_usable(found) else None


def grounded(
    prepared: PreparedTrack, first: FittedTrack, stance: Stance
) -> tuple[PreparedTrack, FittedTrack]:
    """Add the pelvis and the floor as estimated in a stance to the measurements, and move the first
    fit there.

    A pose, a shape and a distance that explain the image together can all be wrong: shoulders look
    wide because they are, or because the body leans towards the camera. With distance and lean
    estimated from floor, feet and balance, the shape is estimated again, and the pose follows.

    :param first: the first fit, in each frame's camera.
    :param stance: in each frame's camera.
    :return: the measurements, and the states and the shape to start from.
    """
    stance = stance.rounded()
    prepared = prepared.rotated(stance.turn)
    betas = first.betas
    sigma = first.height_sigma_m
    if first.valid.any():
        shape = _fit_shape(prepared, stance.root_cam)
        betas = round_array(shape.beta)
        sigma = _height_sigma(prepared, shape)
    start = replace(first, t_camera_root=stance.root_cam, betas=betas, height_sigma_m=sigma)
    return prepared.with_stance(stance, betas), start


def fit_each_frame(prepared: PreparedTrack, start: FittedTrack, progress: Progress) -> FittedTrack:
    """Fit every frame alone, from its state in another motion."""
    frames = FrameSequence(replace(prepared, weights=clip_weights(prepared.weights)), start.betas)
    T = len(start.valid)
    for k in range(T):
        if start.valid[k]:
            frames.refit(k, replace(start.state(k), beta=np.zeros(0)))
        frames.repeat_last(k)
        if k % PROGRESS_FRAMES == 0 or k == T - 1:
            progress("solving each frame", k + 1, T)
    return frames.fitted()


def _fit_shape(prepared: PreparedTrack, root_cam: FloatArray | None = None) -> ClipFit:
    """Estimate one shape from frames spread over the clip.

    The keypoint network misplaces a keypoint in the same way in every frame, so many frames
    constrain the shape no more than one does. The weight of the shape prior therefore grows with
    the number of frames. Where frames have person masks, these frames decide, with the body's
    outline.

    :param root_cam: (T, 3) known positions of the pelvis, camera frame, metres.
    """
    if masks := usable_masks(prepared):
        return fit_shape_to_outline(prepared, masks, root_cam)
    at = (lambda k: None) if root_cam is None else root_cam.__getitem__
    measurements = [
        prepared.measure(k, at(k))
        for k in spread(np.flatnonzero(prepared.track.seen), SHAPE_FRAMES)
    ]
    weights = replace(prepared.weights, shape=prepared.weights.shape * len(measurements))
    options = replace(ROBUST, stages=cold_stages(weights))
    priors = prepared.priors
    # Distance determines an unknown stature, proportions do not.
    if root_cam is not None and not prepared.is_stature_known:
        priors = with_population(priors, prepared.body)
    return fit_clip(prepared.body, measurements, priors=priors, options=options)


def _height_sigma(prepared: PreparedTrack, shape: ClipFit) -> float:
    """Return the standard deviation of the stature of a shape of `_fit_shape`, metres."""
    information = shape.beta_information / (len(shape.frames) * prepared.weights.shape)
    return stature_sigma(prepared.body, shape.beta, information, prepared.is_stature_given)
