# SPDX-License-Identifier: GPL-3.0-or-later
"""The newest frame wins, late ones are counted, and interrupted sources are opened again."""

import threading

import numpy as np
import pytest
from scope.scope_addon.live.newest_frame import DAMAGE_SAID_S, NewestFrame

from .fake_source import FakeClock, FakeSource

WIDE = np.zeros((40, 60, 3), np.uint8)
TALL = np.zeros((60, 40, 3), np.uint8)


def all_taken(reader):
    taken = []
    while (picture := reader.take()) is not None:
        taken.append(picture)
    return taken


def test_frames_that_come_while_one_is_processed_are_dropped_and_counted():
    given = threading.Event()
    go_on = threading.Event()

    def before(index):
        if index == 1:  # the first frame has been given; it must be taken before the others come
            go_on.wait(300)
        if index == 5:
            given.set()
            go_on.wait(300)

    source = FakeSource([0.0, 0.1, 0.2, 0.3, 0.4], ends=True, before=before)
    with NewestFrame(source, FakeClock()) as reader:
        first = reader.take()
        go_on.set()
        reader._thread.join(300)  # all have come while the first one was processed
        rest = all_taken(reader)
    assert [first.index, *(p.index for p in rest)] == [0, 4]
    assert reader.received == 5


def test_an_interrupted_source_is_opened_again_and_numbers_and_times_continue():
    said = []
    clock = FakeClock()
    taken = []
    next_one = threading.Semaphore(1)
    source = FakeSource([50.0, 50.1], [7.0, 7.5], before=lambda _: next_one.acquire(timeout=300))
    with NewestFrame(source, clock, reconnect_s=3.0, say=said.append) as reader:
        for _ in range(4):
            taken.append(reader.take())
            next_one.release()
        clock.stopped.set()
    assert [p.index for p in taken] == [0, 1, 2, 3]
    times = [p.timestamp_s for p in taken]
    assert times == pytest.approx([0.0, 0.1, 0.1, 0.6], abs=2e-3)
    assert times[2] > times[1]
    assert said[0] == "fake has ended; connecting again in 3 s"
    assert 3.0 in clock.slept


def test_stopping_does_not_wait_for_a_source_that_is_stalled():
    clock = FakeClock()
    stalled = threading.Event()
    try:
        with NewestFrame(FakeSource([0.0], before=lambda _: stalled.wait(300)), clock) as reader:
            clock.stopped.set()
            assert reader.take() is None
        assert reader._thread.is_alive()
    finally:
        stalled.set()


def test_pictures_of_another_shape_are_given_as_they_are():
    taken = []
    source = FakeSource(
        np.arange(5) / 10, ends=True, images=[WIDE, TALL, TALL[::2, ::2], WIDE[::2, ::2], WIDE]
    )
    with NewestFrame(source, FakeClock(), received=taken.append) as reader:
        reader._thread.join(300)
    shapes = [(40, 60, 3), (60, 40, 3), (60, 40, 3), (20, 30, 3), (20, 30, 3)]
    assert [picture.image_rgb.shape for picture in taken] == shapes


def test_damaged_frames_are_counted_and_said_not_again_and_again():
    said = []
    taken = []
    clock = FakeClock()
    waits = {5: 0.5 * DAMAGE_SAID_S, 8: DAMAGE_SAID_S}

    def before(index):
        clock.time_s += waits.get(index, 0.0)

    images = [False if k in (3, 4, 5, 8) else WIDE for k in range(10)]
    source = FakeSource(np.arange(10) / 10, ends=True, images=images, before=before)
    with NewestFrame(source, clock, say=said.append, received=taken.append) as reader:
        reader._thread.join(300)
    assert (reader.received, reader.damaged) == (6, 4)
    assert [picture.timestamp_s for picture in taken] == pytest.approx(
        [0.0, 0.1, 0.2, 0.6, 0.7, 0.9]
    )
    said = [
        text
        for text in said
        if text.startswith("data of fake was lost or damaged in transmission; damaged images")
    ]
    assert len(said) == 2


def test_a_source_that_is_frozen_is_said_once_each_time():
    said = []
    clock = FakeClock()
    times = np.arange(0, 26, 0.5)
    images = [
        WIDE + np.uint8(0 if t < 2 else 1 if t < 10 else 2 + t % 2 if t < 17 else 7) for t in times
    ]

    def before(index):
        clock.time_s = 100.0 + times[index]

    with NewestFrame(
        FakeSource(times, images=images, before=before), clock, 0.0, said.append
    ) as reader:
        reader._thread.join(300)
    assert said == ["fake has shown the same image for 5 s; check whether it is frozen"] * 2
