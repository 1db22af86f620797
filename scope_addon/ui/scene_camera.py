# SPDX-License-Identifier: GPL-3.0-or-later
"""The lens and the motion of a camera in the scene, as the file of a camera's path that the worker
reads.

Blender's camera looks along its −z with y up. With the resolution W × H, the pixel aspect a =
aspect_y / aspect_x and the sensor's side S that the fit chooses, which covers the side w of the
picture (W, or a H),

    fx = w lens / S,   fy = fx / a,   cx = W/2 − w shift_x,   cy = H/2 + w shift_y fy / fx.

Source: Blender's BKE_camera_params_compute_viewplane.
"""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from bpy.types import Object, Scene

from ..arrays import Float64Array
from ..errors import UsageError
from ..scene.camera import blender_camera_matrix
from ..scene.timing import current_frame_kept
from ..scene.visibility import evaluated

_SAME_LENS = 1e-3  # of a focal length that does not change, relative
_IMAGE_RATE = 30.0  # which captures assume for images
_MAX_SCALE = 1e-3  # by which an object's axes may be longer or shorter than 1


def scene_camera_path(scene: Scene) -> Path:
    """Write the path of the scene's chosen camera to a file of this session, and return it.

    The camera is read in all frames of the scene's range. *First Frame* shows the footage's first
    one, unless the camera follows a tracked clip, which says itself what each frame shows. The same
    camera has the same file, with the same time, so that a finished capture is found again.

    :raises UsageError: no camera is chosen, it is not in the scene, or it is none that can have
        filmed the footage.
    """
    camera = scene.scope.scene_camera
    if camera is None or camera.type != "CAMERA":
        raise UsageError("no camera of the scene is chosen; choose one, or another kind of lens")
    if camera.name not in scene.objects:
        raise UsageError(f"the camera {camera.name!r} is not in this scene; choose another one")
    content = _content(scene, camera)
    if not content["times_s"]:
        raise UsageError(
            f"the camera {camera.name!r} is solved in no frame of the scene's range; solve its "
            "clip, or set the scene's range to the footage"
        )
    text = json.dumps(content)
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    path = Path(bpy.app.tempdir) / f"scope_camera_{digest}.json"
    path.write_text(text, encoding="utf-8")
    os.utime(path, (0, 0))
    return path


def _content(scene: Scene, camera: Object) -> dict[str, Any]:
    """Return the content of the file: lens, times and poses."""
    render = scene.render
    first, rate = _footage_frames(scene, camera)
    times_s = []
    poses = []
    lenses = []
    with evaluated(camera), current_frame_kept(scene):
        for frame in range(scene.frame_start, scene.frame_end + 1):
            if not _is_solved(scene, camera, frame):
                continue
            scene.frame_set(frame)
            seen = camera.evaluated_get(bpy.context.evaluated_depsgraph_get())
            lenses.append(_intrinsics(scene, seen))
            poses.append(_pose(scene, seen, frame))
            times_s.append((frame - first) / rate)
    if lenses:
        focal = np.array(lenses)[:, 0, 0]
        if np.ptp(focal) > _SAME_LENS * focal.max():
            raise UsageError(
                f"the lens of the camera {camera.name!r} zooms by a factor of "
                f"{focal.max() / focal.min():.2f}; only a focal length that does not change can be "
                "used"
            )
    return {
        "intrinsics": lenses[0].tolist() if lenses else [],
        "dist": _distortion(scene, camera),
        "size": [render.resolution_x, render.resolution_y],
        "times_s": times_s,
        "world_from_camera": [pose.tolist() for pose in poses],
    }


def _tracked_clips(scene: Scene, camera: Object) -> list[bpy.types.MovieClip | None]:
    """Return the clips in which Blender's tracker has solved the camera; None: a constraint has
    none.
    """
    return [
        scene.active_clip if constraint.use_active_clip else constraint.clip
        for constraint in camera.constraints
        if constraint.type == "CAMERA_SOLVER" and not constraint.mute
    ]


def _footage_frames(scene: Scene, camera: Object) -> tuple[int, float]:
    """Return the scene's frame that shows the beginning of the footage, and how many of the next
    ones show a second of it.

    A tracked clip plays frame by frame, whatever the scene's rate is. Images have no rate, and are
    the frames of the footage.

    :raises UsageError: images were tracked, and Blender cannot read the footage's rate.
    """
    for clip in _tracked_clips(scene, camera):
        if clip is not None:
            return clip.frame_start - clip.frame_offset, clip.fps or _footage_rate(scene)
    render = scene.render
    return scene.scope.start_frame, render.fps / render.fps_base


def _footage_rate(scene: Scene) -> float:
    """Return the frame rate with which the footage is captured."""
    footage = bpy.path.abspath(scene.scope.footage)
    clip = bpy.data.movieclips.load(footage)
    rate = float(clip.fps) if clip.source == "MOVIE" else _IMAGE_RATE
    bpy.data.movieclips.remove(clip)
    if not rate:
        raise UsageError(
            f"Blender cannot read the frame rate of {footage}, so the times of the images in which "
            "the camera was tracked are unknown; capture these images"
        )
    return rate


def _distortion(scene: Scene, camera: Object) -> list[float]:
    """Return OpenCV's distortion k1, k2, p1, p2, k3 of the tracked clip's lens; zeros without one.

    Blender's cameras are pinholes, but the footage is as the lens has distorted it. Blender's
    models go from the ideal to the distorted picture, as OpenCV's does; see
    `blender_brown_distortion` for the order and signs of Brown's.

    :raises UsageError: the lens has another model of distortion.
    """
    clips = [clip for clip in _tracked_clips(scene, camera) if clip is not None]
    if not clips:
        return [0.0] * 5
    lens = clips[0].tracking.camera
    if lens.distortion_model == "POLYNOMIAL":
        return [lens.k1, lens.k2, 0.0, 0.0, lens.k3]
    if lens.distortion_model == "BROWN" and not lens.brown_k4:
        return [lens.brown_k1, lens.brown_k2, -lens.brown_p2, lens.brown_p1, lens.brown_k3]
    others = {
        "DIVISION": ("division_k1", "division_k2"),
        "NUKE": ("nuke_k1", "nuke_k2"),
        "BROWN": ("brown_k4",),
    }
    used = others.get(lens.distortion_model, ())
    if not any(getattr(lens, name, 0.0) for name in used):
        return [0.0] * 5
    raise UsageError(
        f"the lens of the clip {clips[0].name!r} has {used[0]} of the model "
        f"{lens.distortion_model.title()}, which cannot be used; solve it with the model Polynomial"
    )


def _is_solved(scene: Scene, camera: Object, frame: int) -> bool:
    """Return whether Blender's tracker has solved the camera in a frame, if it follows a track."""
    for clip in _tracked_clips(scene, camera):
        if clip is None:
            return False
        solved = clip.tracking.reconstruction
        number = frame - clip.frame_start + 1
        if not solved.is_valid or solved.cameras.find_frame(frame=number) is None:
            return False
    return True


def _intrinsics(scene: Scene, camera: Object) -> Float64Array:
    """Return OpenCV's camera matrix (3, 3) of an evaluated camera, in pixels of the resolution.

    :raises UsageError: it is an orthographic or panoramic camera.
    """
    data = camera.data
    if data.type != "PERSP":
        raise UsageError(
            f"the camera {camera.name!r} is {data.type.lower()}; footage is filmed by one whose "
            "type is Perspective"
        )
    render = scene.render
    width = render.resolution_x
    height = render.resolution_y
    projection = camera.calc_matrix_camera(
        bpy.context.evaluated_depsgraph_get(),
        x=width,
        y=height,
        scale_x=render.pixel_aspect_x,
        scale_y=render.pixel_aspect_y,
    )
    fx = 0.5 * width * projection[0][0]
    fy = 0.5 * height * projection[1][1]
    cx = 0.5 * width * (1.0 - projection[0][2])
    cy = 0.5 * height * (1.0 + projection[1][2])
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def _pose(scene: Scene, camera: Object, frame: int) -> Float64Array:
    """Return the pose (4, 4) of an evaluated camera in metres, with OpenCV's axes.

    :raises UsageError: it has a scale, or a value that is no finite number.
    """
    matrix = np.array(camera.matrix_world, float)
    if not np.isfinite(matrix).all():
        raise UsageError(f"the camera {camera.name!r} has no finite place in frame {frame}")
    axes = matrix[:3, :3]
    off = np.abs(axes.T @ axes - np.eye(3)).max()
    if off > 2.0 * _MAX_SCALE or np.linalg.det(axes) < 0:
        raise UsageError(
            f"the camera {camera.name!r}, or a parent of it, is scaled or sheared in frame {frame}"
            "; apply its scale"
        )
    # Half a turn about x is its own inverse, so this also leads from Blender's axes to OpenCV's.
    pose = blender_camera_matrix(matrix)
    pose[:3, 3] *= scene.unit_settings.scale_length
    return pose
