# SPDX-License-Identifier: GPL-3.0-or-later
"""Picture formats besides JPEG and PNG, and the messages for pictures that cannot be read."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.errors import VideoError

from ....required import need_encoder, package

W = 64
H = 48
GREY = np.full((H, W, 3), 90, np.uint8)


def png(image: np.ndarray) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


def avif(path: Path, image_rgb: np.ndarray, count: int = 1) -> Path:
    av = package("av")
    need_encoder("libsvtav1")
    with av.open(str(path), "w", format="avif") as container:
        stream = container.add_stream("libsvtav1", rate=1)
        stream.width = image_rgb.shape[1]
        stream.height = image_rgb.shape[0]
        stream.pix_fmt = "yuv420p"
        for _ in range(count):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image_rgb, "rgb24")))
        container.mux(stream.encode())
    return path


def test_avif_is_recognized_by_its_content(tmp_path: Path) -> None:
    image = np.full((H, W, 3), 255, np.uint8)
    image[: H // 2] = (255, 0, 0)
    for name in ("a.avif", "a.jpg"):
        with open_video(avif(tmp_path / name, image)) as video:
            (frame,) = video
        assert video.frame_count == 1
        assert (video.width, video.height) == (W, H)
        assert np.abs(frame.image_rgb.astype(int) - image)[[6, -7]].max() < 12


def test_damaged_avif(tmp_path: Path) -> None:
    whole = avif(tmp_path / "a.avif", GREY).read_bytes()
    for size in (40, 200, len(whole) - 20):
        (tmp_path / "cut.avif").write_bytes(whole[:size])
        with pytest.raises(VideoError, match=r"cut\.avif is an image that cannot be decoded"):
            open_video(tmp_path / "cut.avif")


@pytest.mark.parametrize("suffix", [".exr", ".jp2", ".hdr", ".ppm"])
def test_other_formats_are_refused_with_advice(tmp_path: Path, suffix: str) -> None:
    """A few hundred bytes of JPEG 2000 can take 2 GB, and nobody films in any of these."""
    path = tmp_path / f"render{suffix}"
    if suffix == ".exr":  # OpenCV writes none
        path.write_bytes(b"v/1\x01" + bytes(99))
    else:
        cv2.imwrite(str(path), GREY.astype(np.float32 if suffix == ".hdr" else np.uint8))
    with pytest.raises(
        VideoError, match=rf"render\{suffix} is an image in a format that is not supported; .*PNG"
    ):
        open_video(path)
    for k in (1, 2):  # whatever the name
        (tmp_path / f"a_{k}.png").write_bytes(path.read_bytes())
    with pytest.raises(VideoError, match=r"a_1\.png is an image that cannot be decoded"):
        open_video(tmp_path / "a_#.png")


@pytest.mark.parametrize("name", ["a.webp", "a.png"])
def test_an_animation_gives_a_warning(tmp_path: Path, name: str) -> None:
    animation = cv2.Animation()
    animation.frames = [GREY, GREY + 30, GREY + 60]
    animation.durations = [100, 100, 100]
    assert cv2.imwriteanimation(str(tmp_path / name), animation)
    with open_video(tmp_path / name) as video:
        (frame,) = video
        assert abs(int(frame.image_rgb.mean()) - 90) < 4
        assert f"{name} is an animation of 3 images" in str(video.warnings[0])


def test_an_animated_avif_gives_a_warning(tmp_path: Path) -> None:
    with open_video(avif(tmp_path / "a.avif", GREY, count=3)) as video:
        assert len(list(video)) == 1
    assert [each.values["images"] for each in video.warnings] == [3]


def test_further_pages_of_a_tiff_give_a_warning(tmp_path: Path) -> None:
    cv2.imwritemulti(str(tmp_path / "a.tif"), [GREY] * 3)
    with open_video(tmp_path / "a.tif") as video:
        assert [each.values["images"] for each in video.warnings] == [3]
    cv2.imwrite(str(tmp_path / "a.tif"), GREY)
    with open_video(tmp_path / "a.tif") as video:
        assert not video.warnings
