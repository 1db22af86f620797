# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion file: the interface between capture, solver, scene and other tools.

Plain arrays in a compressed .npz, AMASS-style keys, one row per source frame. Frames: world is z up
with the floor at z = 0 (on uneven ground, that on which the first person stands at first); camera
is OpenCV's (x right, y down, z forward). ``poses`` holds axis-angle vectors, the root's in the
world frame and the others relative to their parents; ``trans`` is SMPL's: pelvis = J_0(betas) +
trans.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .arrays import BoolArray, Float64Array, FloatArray
from .atomic_write import reason, write_npz
from .errors import MotionFileError, OutputError
from .footage_view import FootageView
from .scene_gaps import cut_times, with_scene_gaps
from .untrusted.files import in_one_line, read_npz

if TYPE_CHECKING:
    from ..solver.body import Body

MAX_VIEWS = 100  # further cameras of a motion; of 20,000 Blender makes a scene in minutes
_LARGEST_ZOOM = 1000.0
# Of what is stated of cameras: pixels, metres, seconds, frames per second.
_LARGEST_FIGURE = 1e9


@dataclass
class Motion:
    """One person's motion over T frames. Fields are named like the keys of the file.

    K + 1 joints including the root, P shape coefficients, J keypoints; lengths in metres, angles in
    radians.

    :raises MotionFileError: an array has the wrong shape.
    """

    poses: FloatArray  # (T, 3(K+1))
    trans: FloatArray  # (T, 3)
    poses_raw: FloatArray  # (T, 3(K+1)), before smoothing and contact
    trans_raw: FloatArray  # (T, 3)
    betas: FloatArray  # (P,)
    body_model: str
    gender: str
    mocap_framerate: float
    frames: NDArray[np.int64]  # (T,) source frame index
    timestamps: Float64Array  # (T,) seconds
    valid: BoolArray  # (T,)
    joints_cam: FloatArray  # (T, K+1, 3) metres, camera frame
    keypoints2d: FloatArray  # (T, J, 3) pixels and confidence
    keypoints2d_names: NDArray[np.str_]  # (J,)
    intrinsics: Float64Array  # (3, 3)
    dist: Float64Array  # (5,)
    joint_confidence: FloatArray  # (T, K+1)
    world_from_camera: Float64Array  # (T, 4, 4)
    foot_contact: FloatArray  # (T, 4) left heel, left toe, right heel, right toe
    residual_px: FloatArray  # (T,)
    image_size: NDArray[np.int64]  # (2,) width, height of the decoded, upright frame
    source: str = ""  # file name of the footage
    # (T, K+1), NaN where not known; always an array once made
    joint_sigma_m: FloatArray | None = None
    joint_sigma_depth_m: FloatArray | None = None  # (T, K+1), likewise
    # standard deviation of the stature of `betas`; NaN where it is not known
    height_sigma_m: float = float("nan")
    uneven_ground: bool = False  # feet rest at any height, so none is under a floor
    # How the footage was seen: turned clockwise by degrees, then mirrored left to right; and how
    # many times as fast as it plays everything happened.
    footage_rotation: int = 0
    footage_mirrored: bool = False
    footage_speed: float = 1.0
    # (T,) focal length of each frame over that of `intrinsics`; None: it is constant
    zoom: Float64Array | None = None
    # (M,) rows, from 1 on, of the frames that begin another scene than the frame before
    scene_starts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    # What the user corrected, which `poses` and `joints_cam` contain: the arrays named
    # CORRECTION_KEYS, or none.
    corrections: dict[str, NDArray[Any]] = field(default_factory=dict)
    # The face, if it was looked for: the arrays named FACE_KEYS, or none.
    face: dict[str, NDArray[Any]] = field(default_factory=dict)
    # The further cameras, if there were several: the arrays named VIEW_KEYS, or none.
    views: dict[str, NDArray[Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in SIGMA_KEYS:
            if getattr(self, name) is None:
                setattr(self, name, np.full(np.shape(self.joints_cam)[:2], np.nan))
        for name, (_, dtype) in _SCHEMA.items():
            value = getattr(self, name)
            setattr(self, name, np.asarray(value, dtype) if dtype is not str else str(value))
        self.face = {
            name: np.asarray(value, _FACE_SCHEMA[name][1]) for name, value in self.face.items()
        }
        self.views = {
            name: np.asarray(value, _VIEW_SCHEMA[name][1]) for name, value in self.views.items()
        }
        self.mocap_framerate = float(self.mocap_framerate)
        self.height_sigma_m = float(self.height_sigma_m)
        self.uneven_ground = bool(self.uneven_ground)
        self.footage_rotation = int(self.footage_rotation) % 360
        self.footage_mirrored = bool(self.footage_mirrored)
        self.footage_speed = float(self.footage_speed)
        if self.zoom is not None:
            self.zoom = np.asarray(self.zoom, np.float64)
        self.validate()

    @property
    def footage_times_s(self) -> Float64Array:
        """(T,) seconds in the footage as it plays, which for slow motion are more than those of the
        motion.
        """
        return self.timestamps * self.footage_speed

    @property
    def has_residual(self) -> BoolArray:
        """(T,) whether this camera saw the person, so that ``residual_px`` is no mere 0."""
        return self.valid & (self.residual_px > 0.0)

    @property
    def mean_residual_px(self) -> float:
        """Mean of the reprojection errors that are known, pixels; 0 if none is."""
        known = self.residual_px[self.has_residual]
        return float(known.mean()) if len(known) else 0.0

    @property
    def cuts_s(self) -> Float64Array:
        """(M,) seconds: when the footage cuts to another scene."""
        return cut_times(self.timestamps, self.scene_starts)

    @property
    def times_with_gaps(self) -> Float64Array:
        """(T,) seconds, with gaps at scene cuts: for what is filtered over time, and for speeds."""
        return with_scene_gaps(self.timestamps, self.cuts_s)

    @property
    def scenes(self) -> list[slice]:
        """The rows of each scene."""
        starts = [0, *self.scene_starts.tolist(), len(self)]
        return [slice(*pair) for pair in pairwise(starts)]

    @property
    def intrinsics_of_frames(self) -> Float64Array:
        """(T, 3, 3) intrinsics of each frame."""
        intrinsics = np.tile(self.intrinsics, (len(self), 1, 1))
        if self.zoom is not None:
            intrinsics[:, :2, :2] *= self.zoom[:, None, None]
        return intrinsics

    @property
    def view(self) -> FootageView:
        """How the footage was turned and mirrored."""
        return FootageView(self.footage_rotation, self.footage_mirrored)

    @property
    def joint_count(self) -> int:
        """K + 1."""
        return self.joints_cam.shape[1]

    @property
    def view_count(self) -> int:
        """How many further cameras there were."""
        return len(self.views["view_sources"]) if self.views else 0

    def from_view(self, number: int) -> Motion:
        """Return the motion as a further camera has seen it, by the clock of its footage.

        It has no keypoints, which are those of the first camera.

        :param number: from 0 to `view_count` - 1.
        """
        of_view = {name: values[number] for name, values in self.views.items()}
        T_view_camera = of_view["view_from_camera"]
        joints: Float64Array = self.joints_cam @ T_view_camera[:3, :3].T
        times_s = self.timestamps + of_view["view_offsets_s"]
        rate = float(of_view["view_frame_rates"])
        return replace(
            self,
            frames=np.round(times_s * self.footage_speed * rate).astype(np.int64),
            timestamps=times_s,
            joints_cam=joints + T_view_camera[:3, 3],
            keypoints2d=np.zeros((len(self), 0, 3)),
            keypoints2d_names=np.zeros(0, str),
            intrinsics=of_view["view_intrinsics"],
            dist=of_view["view_dist"],
            world_from_camera=self.world_from_camera @ np.linalg.inv(T_view_camera),
            image_size=of_view["view_image_sizes"],
            source=str(of_view["view_sources"]),
            zoom=None,
            face={},
            views={},
        )

    def __len__(self) -> int:
        return len(self.frames)

    def joint_rotations(self) -> Float64Array:
        """Return the rotations of ``poses``, (T, K+1, 3, 3)."""
        from ..solver.rotations import exp  # Loads numba, which reading a motion does not need.

        return exp(self.poses.reshape(len(self), -1, 3).astype(float))

    def parts_in_world(self, body: Body) -> tuple[Float64Array, Float64Array]:
        """Return the orientations (T, K+1, 3, 3) and origins (T, K+1, 3) of a body's parts, metres,
        world frame.
        """
        betas = self.betas.astype(float)
        return body.forward_kinematics(self.joint_rotations(), self.trans.astype(float), betas)

    def validate(self) -> None:
        """Check that the shapes of all arrays agree.

        :raises MotionFileError: an array has the wrong shape; the message names it.
        """
        T = len(self.frames)
        if self.footage_rotation % 90 or not 0 < self.footage_speed < np.inf:
            raise MotionFileError(
                "motion: footage_rotation must be a multiple of 90, and footage_speed above 0"
            )
        if self.joints_cam.ndim != 3 or self.keypoints2d.ndim != 3:
            raise MotionFileError("motion: joints_cam and keypoints2d must have three dimensions")
        sizes = {
            "T": T,
            "K1": self.joints_cam.shape[1],
            "J": self.keypoints2d.shape[1],
            "P": self.betas.size,
            "M": self.scene_starts.size,
        }
        sizes["3K1"] = 3 * sizes["K1"]
        for name, (shape, dtype) in _SCHEMA.items():
            if dtype is not str:
                _check_shape(name, getattr(self, name), shape, sizes)
        if self.zoom is not None and (
            self.zoom.shape != (T,)
            or not ((self.zoom >= 1.0 / _LARGEST_ZOOM) & (self.zoom <= _LARGEST_ZOOM)).all()
        ):
            raise MotionFileError(
                f"motion: zoom must have a ratio of focal lengths from {1.0 / _LARGEST_ZOOM:g} "
                f"to {_LARGEST_ZOOM:g} for each of {T} frames; capture again"
            )
        starts = self.scene_starts
        if len(starts) and not (
            0 < starts[0] and starts[-1] < T and (starts[1:] > starts[:-1]).all()
        ):
            raise MotionFileError(
                f"motion: scene_starts must be rows from 1 to {T - 1} in increasing order; "
                "capture again"
            )
        # An imported motion was seen by no camera.
        if self.image_size.any() and not _is_lens(self.intrinsics, self.image_size):
            raise MotionFileError(
                "motion: intrinsics and image_size must be finite, and have focal lengths and "
                "sides above 0; capture again"
            )
        self._validate_face()
        self._validate_views()

    def _validate_views(self) -> None:
        if not self.views:
            return
        sizes = {"V": len(np.atleast_1d(self.views.get("view_sources", ())))}
        self._validate_group(self.views, _VIEW_SCHEMA, sizes, "further cameras")
        if sizes["V"] > MAX_VIEWS:
            raise MotionFileError(
                f"motion has {sizes['V']} further cameras; at most {MAX_VIEWS} are read"
            )
        T_view_camera = self.views["view_from_camera"]
        R = T_view_camera[:, :3, :3]
        turned_back = R @ np.swapaxes(R, 1, 2)
        is_rigid = (
            np.allclose(turned_back, np.eye(3), atol=1e-3)
            and (np.linalg.det(R) > 0).all()
            and (T_view_camera[:, 3] == [0.0, 0.0, 0.0, 1.0]).all()
            and (np.abs(T_view_camera[:, :3, 3]) < _LARGEST_FIGURE).all()
        )
        rates = self.views["view_frame_rates"]
        has_times = ((rates > 0) & (rates < _LARGEST_FIGURE)).all() and (
            np.abs(self.views["view_offsets_s"]) < _LARGEST_FIGURE
        ).all()
        if not is_rigid or not has_times:
            raise MotionFileError(
                "motion: view_from_camera must be rotations and translations, "
                "view_frame_rates above 0, and all of them and view_offsets_s below "
                f"{_LARGEST_FIGURE:g}; capture again"
            )
        if not _is_lens(self.views["view_intrinsics"], self.views["view_image_sizes"]):
            raise MotionFileError(
                "motion: view_intrinsics and view_image_sizes must have focal lengths and sides "
                "above 0; capture again"
            )

    def _validate_face(self) -> None:
        if not self.face:
            return
        sizes = {
            "T": len(self.frames),
            "E": np.size(self.face.get("expression_names", ())),
            "F": np.size(self.face.get("face_landmarks", ())),
        }
        self._validate_group(self.face, _FACE_SCHEMA, sizes, "a face")

    def _validate_group(
        self,
        group: dict[str, NDArray[Any]],
        schema: _Schema,
        sizes: dict[str, int],
        what: str,
    ) -> None:
        """Check arrays that a file has together or not at all."""
        if missing := sorted(set(schema) - set(group)):
            raise MotionFileError(
                f"motion has {what}, but lacks {', '.join(missing)}; capture again"
            )
        for name, (shape, dtype) in schema.items():
            _check_shape(name, group[name], shape, sizes)
            if issubclass(dtype, np.floating) and not np.isfinite(group[name]).all():
                raise MotionFileError(
                    f"motion: {name} has values that are not finite; capture again"
                )

    def check_body(self, body: Body, where: str = "the motion") -> None:
        """Check that the motion has frames, and a body's joints and shape coefficients.

        :param where: what the message names as the source of the motion.
        :raises MotionFileError: it has not.
        """
        if self.joint_count != body.K + 1 or self.betas.size != body.P:
            raise MotionFileError(
                f"{where} has {self.joint_count} joints and {self.betas.size} shape coefficients "
                f"(body '{self.body_model}'), but body '{body.name}' has {body.K + 1} and "
                f"{body.P}; choose the body it was captured with"
            )
        if len(self) == 0:
            raise MotionFileError(
                f"{where} has no frames; capture the video again, or choose another file"
            )

    def save(self, path: str | Path) -> None:
        """Write the motion to an .npz file. The write is atomic, so that a failure never leaves a
        partial file.

        :raises OutputError: the file cannot be written.
        """
        path = Path(path)
        try:
            write_npz(path, self._arrays(), compressed=True)
        except OSError as error:
            raise OutputError(f"cannot write {path}: {reason(error)}") from error

    def to_bytes(self) -> bytes:
        """Return the content of the motion file."""
        file = io.BytesIO()
        np.savez_compressed(file, **self._arrays())
        return file.getvalue()

    def _arrays(self) -> dict[str, NDArray[Any]]:
        arrays = {
            f.name: np.asarray(getattr(self, f.name))
            for f in fields(self)
            if f.name not in _GROUPS
            and (f.name != "zoom" or self.zoom is not None)
            and (f.name != "scene_starts" or len(self.scene_starts))
        }
        # On Windows, numpy before 2 would take 32 bits for a Python integer.
        arrays["footage_rotation"] = arrays["footage_rotation"].astype(np.int64)
        return arrays | self.corrections | self.face | self.views

    @classmethod
    def load(cls, path: str | Path, content: bytes | None = None) -> Motion:
        """Read and check a motion file. Nothing is unpickled.

        :param content: the file's bytes if they are not on disk; ``path`` then only names them in
            messages.
        :raises MotionFileError: the file is missing or damaged, or is not a motion file of this
            version.
        """
        path = Path(path)
        data = read_npz(path, MotionFileError, "motion file", content)
        known = {f.name for f in fields(cls)} - set(_GROUPS)
        if missing := sorted(REQUIRED_KEYS - set(data)):
            raise MotionFileError(
                f"{path} lacks {', '.join(missing)}: it is not a motion file of this version"
            )
        values: dict[str, Any] = {
            k: v.item() if v.ndim == 0 else v for k, v in data.items() if k in known
        }
        corrections = {key: data[key] for key in CORRECTION_KEYS if key in data}
        face = {key: data[key] for key in FACE_KEYS if key in data}
        views = {key: data[key] for key in VIEW_KEYS if key in data}
        try:
            return cls(**values, corrections=corrections, face=face, views=views)
        except MotionFileError:
            raise
        except (TypeError, ValueError, OverflowError) as error:  # of numpy's conversions
            raise MotionFileError(
                f"{path} holds a value of the wrong kind ({in_one_line(error)}); capture again"
            ) from error


def _check_shape(
    name: str, array: NDArray[Any], shape: tuple[str | int, ...], sizes: dict[str, int]
) -> None:
    """Refuse an array that does not have the shape of the schema, whose letters ``sizes`` has."""
    expected = tuple(sizes[s] if isinstance(s, str) else s for s in shape)
    if array.shape != expected:
        raise MotionFileError(f"motion: {name} must have shape {expected}, but has {array.shape}")


def _is_lens(intrinsics: Float64Array, image_size: NDArray[np.int64]) -> bool:
    """Return whether intrinsics (..., 3, 3) and the width and height of images (..., 2) are those
    of lenses.
    """
    focal = intrinsics[..., (0, 1), (0, 1)]
    return bool(
        np.isfinite(intrinsics).all()
        and ((focal > 0) & (focal < _LARGEST_FIGURE)).all()
        and ((image_size > 0) & (image_size < _LARGEST_FIGURE)).all()
    )


# Only in files with corrections. The first rows say what was corrected, the others how the changed
# frames were before.
CORRECTION_KEYS = (
    "pin_frames",
    "pin_joints",
    "pin_uv",
    "pin_xyz",
    "pin_reach",
    "contact_spans",
    "contact_feet",
    "exchange_spans",
    "exchange_limbs",
    "upright",
    "depth_spans",
    "depth_parts",
    "floor_frames",
    "floor_heights",
    "interpolated_spans",
    "snap_level",
    "snap_lift",
    "snap_heights",
    "uncorrected_rows",
    "uncorrected_poses",
    "uncorrected_trans",
    "uncorrected_poses_raw",
    "uncorrected_trans_raw",
    "uncorrected_joints_cam",
    "uncorrected_world_from_camera",
)
# NaN where nothing is known
SIGMA_KEYS = ("joint_sigma_m", "joint_sigma_depth_m")
_Schema = dict[str, tuple[tuple[str | int, ...], type]]
# Only in files of captures that looked for the face: the first are what it expresses, the others
# where it was seen.
_FACE_SCHEMA: _Schema = {
    "expressions": (("T", "E"), np.float32),
    "expression_names": (("E",), np.str_),
    "expression_confidence": (("T",), np.float32),
    "gaze": (("T", 2, 3), np.float32),
    "face_points": (("T", "F", 2), np.float32),
    "face_landmarks": (("F",), np.int64),
}
FACE_KEYS = tuple(_FACE_SCHEMA)
# Only in files of captures with several cameras, one row for each but the first, which the other
# keys describe.
_VIEW_SCHEMA: _Schema = {
    "view_sources": (("V",), np.str_),
    "view_intrinsics": (("V", 3, 3), np.float64),
    "view_dist": (("V", 5), np.float64),
    "view_image_sizes": (("V", 2), np.int64),
    "view_frame_rates": (("V",), np.float64),
    "view_from_camera": (("V", 4, 4), np.float64),
    "view_offsets_s": (("V",), np.float64),
}
VIEW_KEYS = tuple(_VIEW_SCHEMA)
_GROUPS = ("corrections", "face", "views")  # fields that are not keys themselves
REQUIRED_KEYS = {f.name for f in fields(Motion)} - {*_GROUPS, "zoom", "scene_starts"}
_SCHEMA: _Schema = {
    "poses": (("T", "3K1"), np.float32),
    "trans": (("T", 3), np.float32),
    "poses_raw": (("T", "3K1"), np.float32),
    "trans_raw": (("T", 3), np.float32),
    "betas": (("P",), np.float32),
    "body_model": ((), str),
    "gender": ((), str),
    "frames": (("T",), np.int64),
    "timestamps": (("T",), np.float64),
    "valid": (("T",), np.bool_),
    "joints_cam": (("T", "K1", 3), np.float32),
    "keypoints2d": (("T", "J", 3), np.float32),
    "keypoints2d_names": (("J",), np.str_),
    "intrinsics": ((3, 3), np.float64),
    "dist": ((5,), np.float64),
    "joint_confidence": (("T", "K1"), np.float32),
    "world_from_camera": (("T", 4, 4), np.float64),
    "foot_contact": (("T", 4), np.float32),
    "residual_px": (("T",), np.float32),
    "image_size": ((2,), np.int64),
    "source": ((), str),
    "joint_sigma_m": (("T", "K1"), np.float32),
    "joint_sigma_depth_m": (("T", "K1"), np.float32),
    "scene_starts": (("M",), np.int64),
}
