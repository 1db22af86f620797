# SPDX-License-Identifier: GPL-3.0-or-later
"""Results of trackers as they save them: tables within tables, of several people, pickled by
Python, numpy, joblib and PyTorch; and rotations in every form.
"""

from __future__ import annotations

import io
import pickle
import sys
import types
import zipfile
import zlib
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scope.scope_addon.errors import MotionFileError
from scope.scope_addon.retarget.smpl_motion import read_smpl_motions
from scope.scope_addon.untrusted import tables
from scope.solver.rotations import exp

T = 6
RNG = np.random.default_rng(5)
POSES = RNG.uniform(-0.6, 0.6, (T, 24, 3))
OTHER = RNG.uniform(-0.6, 0.6, (T, 24, 3))
TRANS = RNG.normal(size=(T, 3))


def smpl(poses: np.ndarray = POSES) -> dict[str, np.ndarray]:
    return {
        "global_orient": poses[:, 0],
        "body_pose": poses[:, 1:22].reshape(T, -1),
        "transl": TRANS,
        "betas": np.zeros((T, 10)),
    }


def wham(poses: np.ndarray) -> dict[str, Any]:
    return {
        "pose": np.zeros((T, 72)),
        "pose_world": poses.reshape(T, 72),
        "trans_world": TRANS,
        "betas": np.zeros((T, 10)),
        "frame_ids": np.arange(T),
    }


GVHMR = {"smpl_params_incam": smpl(OTHER), "smpl_params_global": smpl(), "K_fullimg": np.eye(3)}
GVHMR["net_outputs"] = {"pred_smpl_params_global": smpl(OTHER)}
PROMPT_HMR = {
    "people": {
        k: {
            "smplx_world": {"pose": np.pad(p.reshape(T, 72), ((0, 0), (0, 93))), "trans": TRANS},
            "smplx_cam": {"pose": np.zeros((T, 165))},
        }
        for k, p in ((1, POSES), (7, OTHER))
    }
}


def as_pickle(content: Any, path: Path) -> None:
    path.write_bytes(pickle.dumps(content))


def as_npz(content: dict[Any, Any], path: Path) -> None:
    np.savez(path, **{str(key): value for key, value in content.items()})


def as_npy(content: Any, path: Path) -> None:
    np.save(path, np.array(content, dtype=object), allow_pickle=True)


def as_joblib(content: Any, path: Path, compressed: bool = False) -> None:
    """Write what joblib writes: after each wrapper follow padding and the bytes of its array."""
    module = types.ModuleType("joblib.numpy_pickle")
    wrapper = type("NumpyArrayWrapper", (), {"__module__": module.__name__})
    vars(module)["NumpyArrayWrapper"] = wrapper

    class Pickler(pickle._Pickler):  # type: ignore[misc,name-defined]
        framer: Any

        def save(self, value: Any, save_persistent_id: bool = True) -> None:
            if not isinstance(value, np.ndarray):
                return super().save(value, save_persistent_id)  # type: ignore[misc]
            made = wrapper()
            vars(made).update(
                subclass=np.ndarray, shape=value.shape, order="C", dtype=value.dtype,
                allow_mmap=True, numpy_array_alignment_bytes=16,
            )  # fmt: skip
            super().save(made)  # type: ignore[misc]
            self.framer.commit_frame(force=True)
            out.write(bytes([3]) + b"\xff" * 3 + np.ascontiguousarray(value).tobytes())
            return None

    out = io.BytesIO()
    sys.modules["joblib"] = types.ModuleType("joblib")
    sys.modules[module.__name__] = module
    try:
        Pickler(out, 4).dump(content)
    finally:
        del sys.modules["joblib"], sys.modules[module.__name__]
    path.write_bytes(zlib.compress(out.getvalue(), 3) if compressed else out.getvalue())


def as_pytorch(content: Any, path: Path) -> None:
    """Write what torch.save writes: a pickle that names storages, which are beside it."""
    torch = types.ModuleType("torch")
    utils = types.ModuleType("torch._utils")
    vars(torch)["FloatStorage"] = type("FloatStorage", (), {"__module__": "torch"})

    def _rebuild_tensor_v2(*_: Any) -> None: ...

    _rebuild_tensor_v2.__module__ = "torch._utils"
    _rebuild_tensor_v2.__qualname__ = "_rebuild_tensor_v2"
    vars(utils)["_rebuild_tensor_v2"] = _rebuild_tensor_v2
    storages: list[np.ndarray] = []

    class Pickler(pickle.Pickler):
        def persistent_id(self, value: Any) -> Any:
            keys = [key for key, storage in enumerate(storages) if storage is value]
            if not keys:
                return None
            return "storage", torch.FloatStorage, str(keys[0]), "cuda:0", value.size

        def reducer_override(self, value: Any) -> Any:
            """Every second column of a storage, as a slice of a tensor is saved."""
            if not isinstance(value, np.ndarray):
                return NotImplemented
            storages.append(np.repeat(value.reshape(len(value), -1), 2, axis=1))
            row = storages[-1].shape[1]
            steps = [row, *(2 * np.cumprod([1, *value.shape[:1:-1]])[::-1]).tolist()]
            size = value.shape, tuple(int(step) for step in steps[: value.ndim])
            return _rebuild_tensor_v2, (storages[-1], 0, *size, False, OrderedDict())

    out = io.BytesIO()
    sys.modules.update({"torch": torch, "torch._utils": utils})
    try:
        Pickler(out, 2).dump(content)
    finally:
        del sys.modules["torch"], sys.modules["torch._utils"]
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("results/data.pkl", out.getvalue())
        file.writestr("results/byteorder", "little")
        for key, storage in enumerate(storages):
            file.writestr(f"results/data/{key}", storage.astype("<f4").tobytes())


def compressed_joblib(content: Any, path: Path) -> None:
    as_joblib(content, path, compressed=True)


FILES: dict[str, tuple[Callable[[Any, Path], None], Any, list[np.ndarray]]] = {
    "wham.pkl": (as_pickle, {0: wham(POSES), 1: wham(OTHER)}, [POSES, OTHER]),
    "compressed.pkl": (compressed_joblib, {3: wham(POSES)}, [POSES]),
    "gvhmr.pt": (as_pytorch, GVHMR, [POSES]),
    "gvhmr_flat.npz": (
        as_npz,
        {f"smpl_params_global/{key}": value for key, value in smpl().items()},
        [POSES],
    ),
    "prompt_hmr.pkl": (as_joblib, PROMPT_HMR, [POSES, OTHER]),
    "tram.npy": (
        as_npy,
        {"pred_rotmat": exp(POSES), "pred_trans": TRANS[:, None], "pred_shape": np.zeros((T, 10))},
        [POSES],
    ),
    "gender.npz": (
        as_npz,
        {"poses": POSES.reshape(T, 72), "trans": TRANS, "gender": np.array("male", dtype=object)},
        [POSES],
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_the_motion_in_the_world_of_every_person_is_read(tmp_path: Path, name: str) -> None:
    write, content, expected = FILES[name]
    write(content, tmp_path / name)
    found = read_smpl_motions(tmp_path / name)
    assert len(found) == len(expected)
    for motion, poses in zip(found, expected, strict=True):
        joints = min(motion.poses.shape[1], 22)
        np.testing.assert_allclose(motion.poses[:, :joints], poses[:, :joints], atol=1e-5)
        assert motion.trans is not None
        np.testing.assert_allclose(motion.trans, TRANS, atol=1e-6)
    if name == "gender.npz":
        assert found[0].gender == "male"


MATRICES = exp(POSES)


def quaternions(matrices: np.ndarray) -> np.ndarray:
    """w, x, y, z of rotations of less than half a turn."""
    w = np.sqrt(np.maximum(1 + np.trace(matrices, axis1=-2, axis2=-1), 0)) / 2
    a = np.swapaxes(matrices, -1, -2)
    xyz = np.stack([a[..., 1, 2] - a[..., 2, 1], a[..., 2, 0] - a[..., 0, 2]], axis=-1)
    xyz = np.concatenate([xyz, (a[..., 0, 1] - a[..., 1, 0])[..., None]], axis=-1)
    return np.concatenate([w[..., None], xyz / (4 * w[..., None])], axis=-1)


ROTATIONS = {
    "matrices": MATRICES,
    "rows": MATRICES[..., :2, :].reshape(T, 24, 6),
    "columns": MATRICES[..., :2].reshape(T, 24, 6),
    "wxyz": quaternions(MATRICES),
    "xyzw": np.roll(quaternions(MATRICES), -1, axis=-1),
}


@pytest.mark.parametrize("form", ROTATIONS)
def test_rotations_of_every_form_are_the_same(tmp_path: Path, form: str) -> None:
    np.savez(tmp_path / "a.npz", poses=ROTATIONS[form])
    (motion,) = read_smpl_motions(tmp_path / "a.npz")
    np.testing.assert_allclose(exp(motion.poses.astype(float)), MATRICES, atol=1e-5)


@pytest.mark.parametrize("shift", [0, -1])
def test_quaternions_of_somebody_upside_down_in_the_camera_are_read_in_the_order_of_the_body(
    tmp_path: Path, shift: int
) -> None:
    root = exp(np.array([[[0.1, 0.0, 3.0]]]))
    q = quaternions(np.concatenate([np.repeat(root, T, axis=0), MATRICES[:, 1:22]], axis=1))
    q = np.roll(q, shift, axis=-1)
    np.savez(tmp_path / "a.npz", global_orient=q[:, :1], body_pose=q[:, 1:])
    (motion,) = read_smpl_motions(tmp_path / "a.npz")
    np.testing.assert_allclose(exp(motion.poses[:, :1].astype(float)), [root[0]] * T, atol=1e-5)


@pytest.mark.parametrize("write", [as_joblib, as_npy])
def test_a_file_without_a_motion_is_refused_by_what_it_holds(
    tmp_path: Path, write: Callable[[Any, Path], None]
) -> None:
    path = tmp_path / "a.npy"
    write({"verts": np.zeros((3, 6890, 3)), "cameras": {"K": np.eye(3)}}, path)
    with pytest.raises(MotionFileError, match=r"it holds verts \(3, 6890, 3\), cameras {K}"):
        read_smpl_motions(path)


class Attack:
    def __reduce__(self) -> Any:
        return exec, ("raise SystemExit",)


def test_what_would_run_is_refused(tmp_path: Path) -> None:
    for write in (as_pickle, as_npy):
        write({"poses": Attack()}, tmp_path / "a.npy")
        with pytest.raises(MotionFileError, match="asks for builtins.exec"):
            read_smpl_motions(tmp_path / "a.npy")


def test_tables_that_refer_to_each_other_without_end_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tables, "MAX_OPCODES", 10_000)  # to convert so many takes seconds
    table: list[Any] = [1]
    for _ in range(9):
        table = [table] * 40
    as_pickle({"a": table}, tmp_path / "a.pkl")
    with pytest.raises(MotionFileError, match="too deeply, or too many"):
        read_smpl_motions(tmp_path / "a.pkl")
