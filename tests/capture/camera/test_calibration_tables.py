# SPDX-License-Identifier: GPL-3.0-or-later
"""Calibrations that Pose2Sim, Caliscope, FreeMoCap, EasyMocap and OpenCap have written: files by
hand, after their published formats.
"""

import pickle
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.camera.calibration import placed_cameras, read_calibration
from scope.scope_addon.command_line.outputs import files_to_read
from scope.scope_addon.job.clip_task import CaptureSettings
from scope.scope_addon.job.request import JobRequest
from scope.solver.errors import InputError

# A quarter turn about x: the camera looks along the world's y, its y down is the world's −z.
QUARTER = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
FREEMOCAP = """
[cam_0]
name = "recording_camera_0"
size = [ 720, 1280,]
matrix = [ [ 880.0, 0.0, 359.5,], [ 0.0, 880.0, 639.5,], [ 0.0, 0.0, 1.0,],]
distortions = [ 0.05, 0.0, 0.0, 0.0, 0.0,]
rotation = [ 0.0, 0.0, 0.0,]
translation = [ 0.0, 0.0, 0.0,]

[cam_1]
name = "recording_camera_1"
size = [ 720, 1280,]
matrix = [ [ 900.0, 0.0, 359.5,], [ 0.0, 900.0, 639.5,], [ 0.0, 0.0, 1.0,],]
distortions = [ 0.0, 0.0, 0.0, 0.0, 0.0,]
rotation = [ 0.0, 1.5707963267948966, 0.0,]
translation = [ -2500.0, 12.0, 2400.0,]

[metadata]
adjusted = false
error = 0.0
charuco_square_size = 58.0
path_to_recorded_videos = "somewhere"
"""
INTRI = """%YAML:1.0
---
names:
   - "01"
   - "02"
K_01: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [1.2e+03, 0., 960., 0., 1201., 540., 0., 0., 1.]
H_01: 1080
W_01: 1920
dist_01: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [0.1, -0.02, 0., 0., 0.003]
K_02: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [1300., 0., 960.,
      0., 1301., 540., 0., 0., 1.]
"""
EXTRI = """%YAML:1.0
---
names:
   - "01"
   - "02"
R_01: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [1.5707963267948966, 0., 0.]
Rot_01: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [1., 0., 0., 0., 0., -1., 0., 1., 0.]
T_01: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [0.1, 1.2, 4.]
Rot_02: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [1., 0., 0., 0., 0., -1., 0., 1., 0.]
T_02: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [-0.1, 1.2, 4.]
"""


POSE2SIM = """
[cam_01]
name = "cam_01"
size = [ 1920.0, 1080.0]
matrix = [ [ 1681.2, 0.0, 960.5], [ 0.0, 1680.1, 540.25], [ 0.0, 0.0, 1.0]]
distortions = [ -0.0013, -0.01, 0.002, 0.001]
rotation = [ 1.2, 0.3, -0.1]
translation = [ 0.1, 1.0, 4.2]
fisheye = false

[cam_02]
name = "cam_02"
size = [ 1280.0, 720.0]
matrix = [ [ 1000.0, 0.0, 640.0], [ 0.0, 1001.0, 360.0], [ 0.0, 0.0, 1.0]]
distortions = [ 0.0, 0.0, 0.0, 0.0]
fisheye = {fisheye}

[metadata]
adjusted = false
"""


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "Calib.toml"
    path.write_text(POSE2SIM.replace("{fisheye}", "false"))
    return path


def test_one_camera_of_several_is_named_after_the_file(path):
    known = read_calibration(Path(f"{path}#cam_01"))
    assert known.size == (1920, 1080)
    np.testing.assert_allclose(known.dist, [-0.0013, -0.01, 0.002, 0.001, 0.0])
    half = known.intrinsics_for(960, 540)
    np.testing.assert_allclose(half[:2, :2].diagonal(), [840.6, 840.05])
    np.testing.assert_allclose(read_calibration(Path(f"{path}#cam_02")).intrinsics[1, 1], 1001.0)


def test_what_does_not_say_which_camera_it_is_is_refused(path):
    with pytest.raises(InputError, match=r"cam_01, cam_02: name the one .* Calib\.toml#cam_01"):
        read_calibration(path)
    with pytest.raises(InputError, match="no camera 'cam_3'; its cameras are cam_01, cam_02"):
        read_calibration(Path(f"{path}#cam_3"))
    path.write_text(POSE2SIM.replace("{fisheye}", "true"))
    with pytest.raises(InputError, match="fisheye"):
        read_calibration(Path(f"{path}#cam_02"))
    path.write_text("[cam_0]\nmatrix = [")
    with pytest.raises(InputError, match="not a TOML file"):
        read_calibration(path)
    with pytest.raises(InputError, match="does not exist"):
        read_calibration(path.with_name("none.toml"))


@pytest.mark.parametrize("value", [f"[{'9' * 400}, 1, 1]", "[1979-05-27, 1, 1]"])
@pytest.mark.parametrize("key", ["matrix", "rotation"])
def test_numbers_and_dates_that_json_has_not_are_refused(path, key, value):
    lines = path.read_text().splitlines()
    changed = [f"{key} = {value}" if line.startswith(key) else line for line in lines]
    path.write_text("\n".join(changed))

    def read():
        placed_cameras(path, ["cam_01", "cam_02"])
        read_calibration(Path(f"{path}#cam_01"))

    with pytest.raises(InputError):
        read()


def test_a_key_of_thousands_of_parts_is_refused_before_it_is_read(path):
    """Python's reader would take minutes."""
    path.write_text("a." * 400_000 + "b = 1")
    with pytest.raises(InputError, match="too deep"):
        read_calibration(path)


def test_freemocap_is_in_millimetres(tmp_path):
    path = tmp_path / "camera_calibration.toml"
    path.write_text(FREEMOCAP)
    (first, T_first), (second, T_second) = placed_cameras(path, ["a", "b"])
    np.testing.assert_allclose(T_first, np.eye(4))
    np.testing.assert_allclose(T_second[:3, 3], [-2.5, 0.012, 2.4])
    np.testing.assert_allclose(T_second[:3, :3] @ [0, 0, 1], [1, 0, 0], atol=1e-12)
    assert read_calibration(first).intrinsics[0, 0] == 880
    assert read_calibration(second).size == (720, 1280)


@pytest.mark.parametrize(
    ("given", "dist"), [("intri.yml", "dist_"), ("extri.yml", "dist_"), ("intri.yml", "D_")]
)
def test_easymocap(tmp_path, given, dist):
    (tmp_path / "intri.yml").write_text(INTRI.replace("dist_", dist))
    (tmp_path / "extri.yml").write_text(EXTRI)
    (second, T_second), (first, T_first) = placed_cameras(tmp_path / given, ["02", "01"])
    for T, x in ((T_first, 0.1), (T_second, -0.1)):
        np.testing.assert_allclose(T[:3, :3], QUARTER, atol=1e-9)
        np.testing.assert_allclose(T[:3, 3], [x, 1.2, 4.0])
    lens = read_calibration(first)
    np.testing.assert_allclose(lens.intrinsics, [[1200, 0, 960], [0, 1201, 540], [0, 0, 1]])
    np.testing.assert_allclose(lens.dist, [0.1, -0.02, 0, 0, 0.003])
    assert lens.size == (1920, 1080)
    assert read_calibration(second).intrinsics[1, 1] == 1301


def test_easymocap_without_places(tmp_path):
    path = tmp_path / "intri.yml"
    path.write_text(INTRI)
    assert [T for _, T in placed_cameras(path, ["01", "02"])] == [None, None]
    path.write_text(INTRI.replace("1.2e+03, 0., 960.", "1.2e+03, .nan, 960."))
    with pytest.raises(InputError, match="K_01 is not a list of numbers"):
        placed_cameras(path, ["01", "02"])
    path.write_text(INTRI.replace("   rows: 3", "   rows: 4"))
    with pytest.raises(InputError, match="K_01 has 9 numbers, but 4 rows of 3"):
        placed_cameras(path, ["01", "02"])
    path.write_text("%YAML:1.0\n---\n")
    with pytest.raises(InputError, match="has no cameras"):
        placed_cameras(path, ["01", "02"])
    path.rename(tmp_path / "extri.yml")
    with pytest.raises(InputError, match=r"intri\.yml does not exist"):
        placed_cameras(tmp_path / "extri.yml", ["01", "02"])


def opencap(folder, number, **more):
    """Write what OpenCap keeps of one camera; return the file."""
    path = folder / f"Cam{number}" / "cameraIntrinsicsExtrinsics.pickle"
    path.parent.mkdir()
    content = {
        "intrinsicMat": np.array([[1500.0 + number, 0, 360], [0, 1500, 640], [0, 0, 1]]),
        "distortion": np.array([[0.2, -0.1, 0.0, 0.0, 0.0]]),
        "imageSize": np.array([[1280], [720]]),
        "rotation": QUARTER,
        "translation": np.array([[100.0 * number], [900.0], [3500.0]]),
        "rotation_EulerAngles": np.zeros(3),
        **more,
    }
    path.write_bytes(pickle.dumps(content))
    return path


def test_opencap(tmp_path):
    files = [opencap(tmp_path, number) for number in (10, 2, 0)]
    found = placed_cameras(files[1], ["left", "middle", "right"])
    assert [str(file).rpartition("#")[2] for file, _ in found] == ["Cam0", "Cam2", "Cam10"]
    for (file, T), number in zip(found, (0, 2, 10), strict=True):
        np.testing.assert_allclose(T[:3, :3], QUARTER, atol=1e-9)
        np.testing.assert_allclose(T[:3, 3], [0.1 * number, 0.9, 3.5])
        lens = read_calibration(file)
        assert lens.intrinsics[0, 0] == 1500 + number
        assert lens.size == (720, 1280)


class _Runs:
    """A pickle of it writes a file when it is read as usual."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


def test_a_pickle_runs_nothing(tmp_path):
    file = opencap(tmp_path, 0, intrinsicMat=_Runs(tmp_path / "ran"))
    with pytest.raises(InputError, match="cameraIntrinsicsExtrinsics"):
        read_calibration(file)
    assert not (tmp_path / "ran").exists()
    crooked = opencap(tmp_path, 1, rotation=np.ones((3, 3)))
    file.unlink()
    opencap(tmp_path, 2)
    with pytest.raises(InputError, match="the rotation of Cam1 is no rotation matrix"):
        placed_cameras(crooked, ["left", "right"])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("rotation = [ 0.0, 1.57", "rotation = [ 0.0, 91.57", "turns by more than two turns"),
        ("rotation = [ 0.0, 1.57", "rotation = [ 1e300, 1.57", "turns by more than two turns"),
        ("[ -2500.0, 12.0", "[ -1e300, 12.0", "is no place"),
    ],
)
def test_a_camera_that_is_nowhere_is_an_error(tmp_path, old, new, message):
    (tmp_path / "takes.toml").write_text(FREEMOCAP.replace(old, new))
    with pytest.raises(InputError, match=f"cam_1.*{message}"):
        placed_cameras(tmp_path / "takes.toml", ["cam_0", "cam_1"])


@pytest.mark.parametrize(
    ("given", "changed"),
    [
        ("takes.toml#cam_1", "takes.toml"),
        ("intri.yml#01", "intri.yml"),
        ("intri.yml", "extri.yml"),
        ("cam1/cameraIntrinsicsExtrinsics.pickle", "cam2/cameraIntrinsicsExtrinsics.pickle"),
        ("cam1/cameraIntrinsicsExtrinsics.pickle#cam2", "cam2/cameraIntrinsicsExtrinsics.pickle"),
    ],
)
def test_a_capture_with_a_changed_calibration_is_another_one(tmp_path, given, changed):
    """In the panel and in a batch; and none of the files may be written by the capture."""
    footage = tmp_path / "walk.mp4"
    footage.write_text("footage")
    path = tmp_path / changed
    path.parent.mkdir(exist_ok=True)
    keys = set()
    for content in ("one", "other"):
        path.write_text(content)
        request = JobRequest(str(footage), calibration=str(tmp_path / given))
        settings = CaptureSettings({"--calibration": str(tmp_path / given)}, (".npz",))
        keys |= {request.key("version"), settings.basis("version")}
    assert len(keys) == 4
    assert path in files_to_read({"calibration": tmp_path / given})
