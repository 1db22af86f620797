# SPDX-License-Identifier: GPL-3.0-or-later
"""Small data sets in the layouts of the real ones, down to types, pickle protocols and axes; none
of their content.
"""

from __future__ import annotations

import pickle
from pathlib import Path

import cv2
import h5py
import numpy as np
from cdflib.cdfwrite import CDF
from scope.scope_addon.cli import SAMPLE
from scope.solver.rotations import exp

from ...untrusted.conftest import dump_python2, make_tables

K = np.array([[940.0, 0, 319.5], [0, 940, 239.5], [0, 0, 1]])  # of the sample clip


def write_pictures(folder: Path, names: list[str]) -> None:
    """The first frames of the sample clip."""
    folder.mkdir(parents=True)
    video = cv2.VideoCapture(str(SAMPLE))
    for name in names:
        assert cv2.imwrite(str(folder / name), video.read()[1])
    video.release()


def write_blank(folder: Path, names: list[str]) -> None:
    """Pictures that nobody is in, where only their number matters."""
    folder.mkdir(parents=True)
    for name in names:
        cv2.imwrite(str(folder / name), np.zeros((8, 8, 3), np.uint8))


def write_models(folder: Path, *names: str) -> Path:
    """Random bodies under the names of the publisher's files; SMPL's two hands lie where the real
    ones do.
    """
    folder.mkdir()
    for seed, name in enumerate(names):
        np.savez(
            folder / f"{name}.npz", **make_tables("smplx" if "SMPLX" in name else "smpl", seed=seed)
        )
    return folder


def write_regressor(path: Path, vertices: int = 300) -> np.ndarray:
    matrix = np.random.default_rng(5).dirichlet(np.full(vertices, 0.05), 17)
    np.save(path, matrix)
    return matrix


def motion(frames: int, joints: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses (T, 3J), translation (T, 3) some metres in front of a camera, and ten betas."""
    rng = np.random.default_rng(seed)
    poses = rng.normal(scale=0.2, size=(1, 3 * joints)) + rng.normal(
        scale=0.02, size=(frames, 3 * joints)
    )
    return (
        poses,
        rng.normal(scale=0.1, size=(frames, 3)) + [0, 0, 4],
        rng.normal(scale=0.5, size=10),
    )


def rigid(count: int, seed: int = 0) -> np.ndarray:
    """Poses of a camera that moves a little, (T, 4, 4)."""
    rng = np.random.default_rng(seed)
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, :3, :3] = exp(rng.normal(scale=0.05, size=(count, 3)))
    T[:, :3, 3] = rng.normal(scale=0.05, size=(count, 3))
    return T


def table_3dpw(name: str, joints_world: list[np.ndarray], T_camera_world: np.ndarray) -> dict:
    """The dictionary of a sequence of 3DPW; joints (T, 24, 3) of each person."""
    count = len(T_camera_world)
    rng = np.random.default_rng(1)
    people = range(len(joints_world))
    return {
        "sequence": name,
        "betas": [rng.normal(size=10) for _ in people],
        "poses": [motion(count, 24, p)[0] for p in people],
        "trans": [motion(count, 24, p)[1] for p in people],
        "poses_60Hz": [np.zeros((2 * count, 72)) for _ in people],
        "genders": ["m", "f"][: len(joints_world)],
        "v_template_clothed": [np.zeros((10, 3)) for _ in people],
        "texture_maps": [],
        "poses2d": [np.ones((count, 3, 18)) for _ in people],
        "jointPositions": [joints.reshape(count, 72) for joints in joints_world],
        "img_frame_ids": np.arange(count),
        "cam_poses": T_camera_world,
        "campose_valid": [np.ones(count, dtype=bool) for _ in people],
        "cam_intrinsics": K,
    }


def write_3dpw(root: Path, table: dict, pictures: bool = False) -> Path:
    """A sequence as Python 2 pickled it, and its images."""
    name = table["sequence"]
    count = len(table["cam_poses"])
    path = root / "sequenceFiles" / "test" / f"{name}.pkl"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(dump_python2(table, 2))
    names = [f"image_{k:05d}.jpg" for k in range(count)]
    (write_pictures if pictures else write_blank)(root / "imageFiles" / name, names)
    return path


def write_emdb(root: Path, count: int = 6, gender: str = "female", **flags: object) -> Path:
    poses, trans, betas = motion(count, 24)
    good = np.ones(count, dtype=bool)
    good[1] = False
    table = {
        **{
            "gender": gender,
            "name": "P0_00_mvs_a",
            "emdb1": np.bool_(True),
            "emdb2": False,
            "n_frames": count,
        },
        "good_frames_mask": good,
        "camera": {"intrinsics": K, "extrinsics": rigid(count, 2), "width": 640, "height": 480},
        "smpl": {
            "poses_root": poses[:, :3],
            "poses_body": poses[:, 3:],
            "trans": trans,
            "betas": betas,
        },
        "kp2d": np.zeros((count, 24, 2)),
        "bboxes": {"bboxes": np.zeros((count, 4)), "invalid_idxs": np.array([1])},
        **flags,
    }
    folder = root / "P0" / "00_mvs_a"
    write_blank(folder / "images", [f"{k:05d}.jpg" for k in range(count)])
    path = folder / "P0_00_mvs_a_data.pkl"
    path.write_bytes(pickle.dumps(table))
    return path


def write_rich(root: Path, count: int = 5) -> None:
    sequence = "Gym_011_pushup1"
    camera = "cam_02"
    write_blank(
        root / "images" / "test" / sequence / camera,
        [f"{k:05d}_02.jpeg" for k in range(10, 10 + count)],
    )
    poses, trans, betas = motion(count, 22)
    for k in range(count - 1):  # the last image has no body
        path = root / "bodies" / "test" / sequence / f"{k + 10:05d}" / "011.pkl"
        path.parent.mkdir(parents=True)
        table = {
            **{"global_orient": poses[k : k + 1, :3], "body_pose": poses[k : k + 1, 3:]},
            **{
                "transl": trans[k : k + 1],
                "betas": betas[None],
                "left_hand_pose": np.zeros((1, 12)),
            },
        }
        path.write_bytes(
            pickle.dumps({key: value.astype(np.float32) for key, value in table.items()})
        )
    write_blank(
        root / "images" / "test" / "LectureHall_009_021_reparingprojector1" / camera,
        ["00001_02.jpeg"],
    )
    path = root / "scan_calibration" / "Gym" / "calibration" / "002.xml"
    path.parent.mkdir(parents=True)
    matrices = {"CameraMatrix": rigid(1, 3)[0, :3], "Intrinsics": K, "Distortion": np.zeros((5, 1))}
    inner = "".join(
        f'<{key} type_id="opencv-matrix"><rows>{len(m)}</rows><cols>{m.shape[1]}</cols><dt>d</dt>'
        f"<data>\n  {' '.join(map(repr, m.ravel().tolist()))}</data></{key}>"
        for key, m in matrices.items()
    )
    path.write_text(f'<?xml version="1.0"?>\n<opencv_storage>{inner}</opencv_storage>')


def write_bedlam(root: Path, count: int = 4) -> Path:
    """Two people at 6 frames per second, the second in the last images alone; rows in no order."""
    scene = "20221019_3-8_250_highbmihand_orbit_stadium_6fps"
    names = [f"seq_000003/seq_000003_{5 * k:04d}.png" for k in range(count)]
    write_blank(
        root / "validation" / scene / "png" / "seq_000003", [Path(name).name for name in names]
    )
    rows = [(name, "a") for name in names] + [(name, "b") for name in names[2:]]
    order = np.random.default_rng(4).permutation(len(rows))
    poses, trans, betas = motion(len(rows), 55)
    ext = rigid(len(rows), 7)
    path = root / "all_npz_12_validation" / f"{scene}.npz"
    path.parent.mkdir(parents=True)
    np.savez(
        path,
        **{
            "imgname": np.array([name for name, _ in rows])[order],
            "sub": np.array([sub for _, sub in rows])[order],
        },
        **{
            "pose_cam": poses[order],
            "shape": np.tile(np.append(betas, 0.0), (len(rows), 1)),
            "cam_ext": ext[order],
        },
        **{"trans_cam": trans[order], "cam_int": np.tile(K, (len(rows), 1, 1))},
        motion_info=np.array([{"pickled": 1}], dtype=object),
    )
    return path


def write_h36m(
    root: Path, joints_mm: np.ndarray, subject: str, name: str, with_pixels: bool = True
) -> Path:
    """One video's worth of poses; joints (T, 32, 3) in the camera. The video is an empty file."""
    video = root / subject / "Videos" / f"{name}.mp4"
    video.parent.mkdir(parents=True, exist_ok=True)
    video.touch()
    pixels = (joints_mm @ K.T)[..., :2] / joints_mm[..., 2:]
    kinds = {"D3_Positions_mono": joints_mm} | ({"D2_Positions": pixels} if with_pixels else {})
    for kind, values in kinds.items():
        path = root / subject / "MyPoseFeatures" / kind / f"{name}.cdf"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_cdf(path, "Pose", values.reshape(1, len(values), -1).astype(np.float32))
    return root / subject / "MyPoseFeatures" / "D3_Positions_mono" / f"{name}.cdf"


def write_cdf(path: Path, variable: str, records: np.ndarray) -> None:
    spec = {
        **{
            "Variable": variable,
            "Data_Type": 44,
            "Num_Elements": 1,
            "Rec_Vary": True,
            "Var_Type": "zVariable",
        },
        "Dim_Sizes": list(records.shape[1:]),
    }
    file = CDF(path, cdf_spec={"Compressed": 6}, delete=True)
    file.write_var(spec, var_data=records)
    file.close()


def write_3dhp(root: Path, joints_mm: np.ndarray, valid: np.ndarray) -> None:
    """Six sequences, whose joints (T, 17, 3) are in the camera; the universal ones are 0.9 times as
    large.
    """
    pixels = (joints_mm @ K.T)[..., :2] / joints_mm[..., 2:]
    for number in range(1, 7):
        folder = root / "mpi_inf_3dhp_test_set" / f"TS{number}"
        write_blank(folder / "imageSequence", [f"img_{k + 1:06d}.jpg" for k in range(len(valid))])
        path = folder / "annot_data.mat"
        with h5py.File(path, "w", userblock_size=512) as file:
            file["valid_frame"] = valid[:, None].astype(np.float64)
            file["activity_annotation"] = np.full((len(valid), 1), 2.0)
            file["univ_annot3"] = 0.9 * joints_mm[:, None]
            file["annot3"] = joints_mm[:, None]
            file["annot2"] = pixels[:, None]
            cells = file.create_group("#refs#")
            cells["a"] = np.arange(3.0)
            file.create_dataset("cameras", data=[[cells["a"].ref]], dtype=h5py.ref_dtype)
        with path.open("r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
