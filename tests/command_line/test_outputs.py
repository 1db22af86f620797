# SPDX-License-Identifier: GPL-3.0-or-later
"""Where results lie that were given no place, and what lies beside them."""

from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import choose_camera
from scope.scope_addon.cli import SAMPLE, main
from scope.scope_addon.command_line.outputs import default_outputs, summary, write_outputs
from scope.scope_addon.errors import UsageError


def test_results_lie_next_to_the_footage(tmp_path):
    assert default_outputs(tmp_path / "walk.mov") == [tmp_path / "walk.npz", tmp_path / "walk.glb"]
    assert default_outputs(Path("take.1.mp4")) == [Path("take.1.npz"), Path("take.1.glb")]
    link = tmp_path / "linked.mp4"
    link.symlink_to(SAMPLE)
    assert default_outputs(link) == [tmp_path / "linked.npz", tmp_path / "linked.glb"]


@pytest.mark.parametrize("way", ["itself", "through a link", "with a detour"])
def test_results_of_the_shipped_sample_lie_in_the_current_folder(tmp_path, monkeypatch, way):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "link").symlink_to(SAMPLE.parent)
    sample = {
        "itself": SAMPLE,
        "through a link": tmp_path / "link" / SAMPLE.name,
        "with a detour": SAMPLE.parent / ".." / "sample" / SAMPLE.name,
    }[way]
    assert [p.resolve() for p in default_outputs(sample)] == [
        tmp_path / "sample.npz",
        tmp_path / "sample.glb",
    ]


def test_a_current_folder_within_scopes_own_is_refused(monkeypatch):
    monkeypatch.chdir(SAMPLE.parent)
    with pytest.raises(UsageError, match="belongs to Scope .* choose an output with -o"):
        default_outputs(Path(SAMPLE.name))


def test_results_of_images_in_the_current_folder_are_named_after_it(tmp_path, monkeypatch):
    (tmp_path / "walk").mkdir()
    monkeypatch.chdir(tmp_path / "walk")
    for here in (Path(), Path("../walk/."), Path("below/..")):
        assert [p.resolve() for p in default_outputs(here)] == [
            tmp_path / "walk.npz",
            tmp_path / "walk.glb",
        ]


def test_folders_of_images_whose_names_have_dots_have_different_results(tmp_path):
    first = tmp_path / "take.1"
    second = tmp_path / "take.2"
    for folder in (first, second):
        folder.mkdir()
    assert default_outputs(first) == [tmp_path / "take.1.npz", tmp_path / "take.1.glb"]
    assert set(default_outputs(first)).isdisjoint(default_outputs(second))


def save_people(path, count):
    """Save SMPL-style motions of some people, as trackers do."""
    poses = np.zeros((2, 72))
    people = {f"{number}/poses": poses for number in range(count)}
    np.savez(path, **people)


@pytest.mark.parametrize(
    ("before", "after", "left"),
    [
        (3, 2, ["walk.person3.npz", "walk.person3.trc"]),
        (3, 1, [f"walk.person{n}.{suffix}" for suffix in ("npz", "trc") for n in (1, 2, 3)]),
        (1, 2, ["walk.npz", "walk.trc"]),
        (2, 3, []),
    ],
)
def test_files_of_an_earlier_number_of_people_stay_and_are_named(
    tmp_path, capfd, before, after, left
):
    (tmp_path / "walk.personal.npz").write_text("not a result")
    for count in (before, after):
        save_people(tmp_path / "tracked.npz", count)
        for file in tmp_path.glob("walk*"):
            file.write_text("earlier")
        capfd.readouterr()
        outputs = [
            part for suffix in ("npz", "trc") for part in ("-o", f"{tmp_path}/walk.{suffix}")
        ]
        assert main(["import", str(tmp_path / "tracked.npz"), *outputs]) == 0
    said = capfd.readouterr().err
    listed = "".join(line for line in said.splitlines() if "not part of this result" in line)
    assert [name for name in left if name not in listed] == []
    assert bool(left) == bool(listed)
    assert "personal" not in said
    for name in left:
        assert (tmp_path / name).read_text("utf-8") == "earlier"


@pytest.mark.usefixtures("blender_module")
def test_a_scene_shows_the_first_picture_of_folders_of_further_cameras(tmp_path, monkeypatch):
    from scope.scope_addon.scene.export import export

    folder = tmp_path / "right"
    folder.mkdir()
    for number in (3, 4):
        cv2.imwrite(str(folder / f"{number:02d}.png"), np.zeros((8, 8, 3), np.uint8))
    shown = []

    def exported(motions, body, outputs, footage, options, separate):
        shown.extend([footage, *options.view_footage])
        return outputs, []

    monkeypatch.setattr(export, "export_motions", exported)
    args = SimpleNamespace(
        command="capture", fps=30, shape_keys="keyed", file_per_person=False, bvh_unit="m",
        deform_bones=False, skeleton="scope",
    )  # fmt: skip
    motion = SimpleNamespace(image_size=np.array([8, 8]))
    output = tmp_path / "out.blend"
    write_outputs([output], [motion], None, SAMPLE, args, views=[folder, SAMPLE])
    assert shown == [SAMPLE, folder / "03.png", SAMPLE]


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({}, "camera: assumed, 60 degrees (give a known lens by --fov or --focal-mm); wrote a.npz"),
        ({"fov_deg": 40.0}, "camera: given, 40 degrees; wrote a.npz"),
        ({"metadata_focal_mm": 26.0}, "camera: the file's metadata, 26 mm; wrote a.npz"),
    ],
)
def test_the_line_about_a_capture_says_where_its_lens_is_from(given, says):
    """Distances are as wrong as an assumed one: 3.05 m for 4.89 m of the sample clip."""
    report = {
        "people": 1,
        "frames": 150,
        "fps": {"total": 3.6},
        "reprojection_px": 1.4,
        "execution": "CPU, 2 threads",
        "camera": choose_camera(640, 360, **given).source,
        "outputs": ["a.npz"],
    }
    assert summary(report) == (
        "1 person, 150 frames, 3.6 frames/s, reprojection error 1.4 px, networks on CPU, "
        f"2 threads; {says}"
    )
