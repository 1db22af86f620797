# SPDX-License-Identifier: GPL-3.0-or-later
"""Sound in the files of several cameras: made claps and syllables with exact offsets, and noise."""

import av
import numpy as np
import pytest
from scope.scope_addon.capture.media.sound import STEP_S, loudness
from scope.scope_addon.capture.several_views.synchronize import offset_by_sound

RATE = 48000


def scene_sound(seconds, seed=0, events_per_s=2.0):
    """Return bursts of noise (n,) at random moments, of random pitch and length."""
    rng = np.random.default_rng(seed)
    sound = np.zeros(int(seconds * RATE))
    for start in rng.uniform(0.0, seconds - 0.3, int(seconds * events_per_s)):
        length = int(rng.uniform(0.02, 0.2) * RATE)
        time = np.arange(length) / RATE
        burst = rng.normal(size=length) + 2.0 * np.sin(2 * np.pi * rng.uniform(200, 3000) * time)
        begin = int(start * RATE)
        sound[begin : begin + length] += rng.uniform(0.3, 1.0) * burst * np.exp(-time / 0.04)
    return sound


def heard(sound, offset_s, drift=0.0, noise=0.02, seed=1):
    """Return what a microphone records, whose clock is ahead by ``offset_s + drift * t``, with an
    echo and noise of its own.
    """
    rng = np.random.default_rng(seed)
    own = np.arange(len(sound)) / RATE
    time = (own - offset_s) / (1.0 + drift)
    scene = np.arange(len(sound)) / RATE
    direct = np.interp(time, scene, sound, 0.0, 0.0)
    echo = 0.4 * np.interp(time - 0.031 * seed, scene, sound, 0.0, 0.0)
    return direct + echo + rng.normal(0.0, noise, len(sound))


def write_video(path, sound, codec="pcm_s16le", video_late_s=0.0):
    """Write a video with a sound, or without one, whose first image comes later than the sound.

    :param codec: of the sound; encoding AAC takes longer than all the rest.
    """
    with av.open(str(path), "w") as container:
        film = container.add_stream("mpeg4", rate=10)
        film.width = film.height = 32
        film.pix_fmt = "yuv420p"
        track = container.add_stream(codec, rate=RATE) if sound is not None else None
        first = round(video_late_s * 10)
        for k in range(10):
            frame = av.VideoFrame.from_ndarray(np.full((32, 32, 3), 20 * k, np.uint8), "rgb24")
            frame.pts = first + k
            container.mux(film.encode(frame))
        container.mux(film.encode())
        if track is None:
            return
        samples = (np.clip(0.2 * sound, -1, 1)[None]).astype(np.float32)
        frame = av.AudioFrame.from_ndarray(samples, format="fltp", layout="mono")
        frame.sample_rate = RATE
        frame.pts = 0
        container.mux(track.encode(frame))
        container.mux(track.encode())


def loud_of(tmp_path, sound, name, **more):
    path = tmp_path / f"{name}.mov"
    write_video(path, sound, **more)
    return loudness(path)


@pytest.mark.parametrize(("offset_s", "noise"), [(1.3719, 0.02), (-0.6231, 0.15)])
def test_offset_from_the_sound_of_two_files(tmp_path, offset_s, noise):
    sound = scene_sound(8.0)
    first = loud_of(tmp_path, heard(sound, 0.0, noise=noise), "first", codec="aac")
    second = loud_of(tmp_path, heard(sound, offset_s, noise=noise, seed=2), "second")
    found = offset_by_sound(first, second)
    assert found.seconds + 4.0 * found.drift == pytest.approx(offset_s, abs=0.003)
    assert 0.004 < found.sigma_s < 0.008


def test_clock_is_that_of_the_images(tmp_path):
    """In a file whose first image comes half a second after its sound begins."""
    sound = scene_sound(8.0)
    first = loud_of(tmp_path, heard(sound, 0.0), "first")
    second = loud_of(tmp_path, heard(sound, 0.0, seed=2), "second", video_late_s=0.5)
    assert offset_by_sound(first, second).seconds == pytest.approx(-0.5, abs=0.003)


@pytest.mark.slow
def test_clocks_that_drift_apart_in_minutes(tmp_path):
    sound = scene_sound(180.0)
    first = loud_of(tmp_path, heard(sound, 0.0), "first")
    second = loud_of(tmp_path, heard(sound, 0.8, drift=1.2e-4, seed=2), "second")
    found = offset_by_sound(first, second)
    assert found.drift == pytest.approx(1.2e-4, abs=2e-5)
    assert found.seconds + 90.0 * found.drift == pytest.approx(0.8 + 90.0 * 1.2e-4, abs=0.003)


def test_sounds_that_tell_no_offset(tmp_path):
    first = loud_of(tmp_path, heard(scene_sound(10.0), 0.0), "first")
    other = loud_of(tmp_path, heard(scene_sound(10.0, seed=5), 0.0, seed=2), "other")
    assert offset_by_sound(first, other) is None
    beat = np.zeros(10 * RATE)
    beat[:: RATE // 2] = 1.0
    beats = [loud_of(tmp_path, heard(5.0 * beat, s, noise=0.001), f"beat{s}") for s in (0.0, 0.2)]
    assert offset_by_sound(*beats) is None


def test_videos_without_sound(tmp_path):
    assert loud_of(tmp_path, None, "silent") is None
    assert loud_of(tmp_path, np.zeros(2 * RATE), "zero") is None
    (tmp_path / "text.mp4").write_text("no video")
    assert loudness(tmp_path / "text.mp4") is None
    short = loud_of(tmp_path, scene_sound(1.0), "short")
    assert len(short) * STEP_S == pytest.approx(1.0, abs=0.1)
    assert offset_by_sound(short, short) is None
