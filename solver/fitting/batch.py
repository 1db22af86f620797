# SPDX-License-Identifier: Apache-2.0
"""Many frames on all cores. The kernels release the GIL, so plain threads do."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Literal, TypeVar

from ..measurements import Measurements
from ..options import Options, Priors, default_priors
from ..points import frames_of
from ..state import Fit, State, given_states
from ..tree import BodyArrays, make_tree
from ..validation import check_count
from .frame_solver import fit_tree
from .misfit import warn_of_mirrored_clip, warn_of_unlikely_shape

_CHUNK = 16  # frames handed to a thread at a time: a thread changes hands in tens of microseconds

_T = TypeVar("_T")
_R = TypeVar("_R")


def fit_batch(
    body: BodyArrays,
    measurements: Sequence[Measurements] | Measurements,
    *,
    init: Sequence[State | None] | Literal["multi"] | None = None,
    priors: Priors | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
    threads: int = 0,
) -> list[Fit]:
    """Fit frames that have nothing to do with each other, in order of `measurements`.

    Every frame comes out as `fit` gives it, bit by bit, whatever the number of threads.

    :param measurements: of each frame; or of all, as arrays with an axis for the frames:
        `frames_of`.
    :param init: a state for each frame, None where there is none; or "multi" for all, as of `fit`.
    :param priors, options: of `fit`, for all frames.
    :param threads: how many; 0 is one for each core.
    :raises ShapeError: an array does not fit the body, whichever frame it belongs to, or `init` has
        another length.
    :raises InvalidValueError: a value that no fit can use, in whichever frame.
    """
    measurements = frames_of(body, measurements)
    states, cold = given_states(init, len(measurements), (State, type(None)))
    starts = [cold] * len(measurements) if states is None else states
    tree = make_tree(body)
    by_default = priors is None and states is None
    priors = default_priors(body) if priors is None else priors

    def some(first: int) -> list[Fit]:
        frames = range(first, min(first + _CHUNK, len(measurements)))
        return [fit_tree(tree, measurements[k], starts[k], priors, options) for k in frames]

    chunks = _spread(some, range(0, len(measurements), _CHUNK), threads)
    fits = [fitted for chunk in chunks for fitted in chunk]
    if by_default and not warn_of_mirrored_clip(
        measurements, fits, priors, lambda m: fit_tree(tree, m, None, priors, options)
    ):
        warn_of_unlikely_shape([fitted.state.beta for fitted in fits], priors)
    return fits


def _spread(work: Callable[[_T], _R], jobs: Iterable[_T], threads: int) -> list[_R]:
    """Results in the jobs' order. The first job runs alone, so that kernels are compiled once, not
    by every thread.
    """
    queue = list(jobs)
    check_count(threads, "threads", 0)
    threads = min(threads if threads > 0 else os.cpu_count() or 1, max(1, len(queue)))
    if threads == 1:
        return [work(job) for job in queue]
    first = work(queue[0])
    with ThreadPoolExecutor(threads, thread_name_prefix="scope-fit") as pool:
        return [first, *pool.map(work, queue[1:])]
