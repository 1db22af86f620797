# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender camera that sees what the footage's camera saw, with the footage behind the scene.

OpenCV's pinhole ``u = fx x/z + cx, v = fy y/z + cy`` in a W × H picture is, with the horizontal sensor fit,

    lens / sensor_width = fx / W,     shift_x = 1/2 − cx / W,
    pixel_aspect_x / pixel_aspect_y = fy / fx,     shift_y = (cy − H/2) / W · fx / fy.

Pixel aspect and resolution belong to the scene in Blender; the camera alone is exact for square pixels. The footage has
a display aspect of its own, without which it would not fill the scene's picture, and its lens, which counts rows in
units of columns, a third one: fy / fx. Source: Blender's BKE_camera_params_compute_viewplane, overlay_image.cc and
tracking.cc.
"""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from ..errors import VideoError
from ..footage import LAST_NUMBER, PICTURE_SUFFIXES, numbered_from
from ..motion import Motion
from .animation_data.actions import Channels
from .axes import blender_brown_distortion, blender_camera_matrix
from .character.animation import on_one_hemisphere, quaternion_from_matrix

_IN_STEP = 0.6  # frames that footage may be off and counts as in step; half of one is rounding
_LONG = 1_000_000  # frames, beyond which Blender would show the last one
# Custom property of a capture's collection: columns, rows and pixel aspect of the footage.
_PICTURE = "scope_picture"
SENSOR_WIDTH = 36.0  # millimetres; only its ratio to the focal length matters


def pixel_aspect(motion: Motion) -> tuple[float, float]:
    """The scene's ``pixel_aspect_x, pixel_aspect_y`` for these intrinsics; Blender wants both at least 1."""
    fx, fy = motion.intrinsics[0, 0], motion.intrinsics[1, 1]
    ratio = fy / fx
    if abs(ratio - 1.0) < 1e-6:
        return 1.0, 1.0
    return (float(ratio), 1.0) if ratio > 1 else (1.0, float(1 / ratio))


def store_resolution(collection: bpy.types.Collection, motion: Motion) -> None:
    """Have a capture's collection tell the size and pixel aspect of the footage."""
    collection[_PICTURE] = [*(float(n) for n in motion.image_size), *pixel_aspect(motion)]


def set_resolution(scene: bpy.types.Scene, collection: bpy.types.Collection) -> None:
    """Give the scene's picture the size and pixel aspect of the footage, where the capture's collection tells them."""
    if _PICTURE not in collection:
        return
    width, height, aspect_x, aspect_y = collection[_PICTURE]
    scene.render.resolution_x, scene.render.resolution_y = int(width), int(height)
    scene.render.resolution_percentage = 100
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = aspect_x, aspect_y


def build_camera(
    name: str, motion: Motion, collection: bpy.types.Collection, frames: np.ndarray
) -> bpy.types.Object:
    """A camera object with the motion's intrinsics, standing where the footage's camera stood.

    :param frames: (T,) scene frame of each pose; a moving camera is keyed there.
    """
    data = bpy.data.cameras.new(name)
    set_lens(data, motion)
    obj = bpy.data.objects.new(name, data)
    obj.rotation_mode = "QUATERNION"
    collection.objects.link(obj)
    T_world_blendcam = blender_camera_matrix(motion.world_from_camera)
    locations = T_world_blendcam[:, :3, 3]
    obj.location = locations[0]
    obj.rotation_quaternion = quaternion_from_matrix(T_world_blendcam[0, :3, :3])
    if np.ptp(T_world_blendcam, axis=0).max() > 1e-6:
        rotations = on_one_hemisphere(np.stack([quaternion_from_matrix(T[:3, :3]) for T in T_world_blendcam]))
        channels = Channels(obj, bpy.data.actions.new(name))
        channels.write("location", frames, locations, group="Object Transforms")
        channels.write("rotation_quaternion", frames, rotations, group="Object Transforms")
    return obj


def set_lens(data: bpy.types.Camera, motion: Motion) -> None:
    """Focal length, sensor and principal point of ``motion.intrinsics`` on a Blender camera."""
    width, height = (float(n) for n in motion.image_size)
    fx, fy, cx, cy = motion.intrinsics[[0, 1, 0, 1], [0, 1, 2, 2]]
    data.type = "PERSP"
    data.sensor_fit = "HORIZONTAL"  # AUTO would change with portrait pictures
    data.sensor_width = SENSOR_WIDTH
    data.sensor_height = SENSOR_WIDTH * height / width * fx / fy
    data.lens_unit = "MILLIMETERS"
    data.lens = SENSOR_WIDTH * fx / width
    data.shift_x = 0.5 - cx / width
    data.shift_y = (cy - 0.5 * height) / width * fx / fy
    data.clip_start, data.clip_end = 0.01, 1000.0


def same_camera(a: Motion, b: Motion) -> bool:
    """Whether two motions were seen by one camera, as those of several people in one picture are."""
    return (
        np.array_equal(a.image_size, b.image_size)
        and np.allclose(a.intrinsics, b.intrinsics, rtol=0, atol=1e-6)
        and np.array_equal(a.dist, b.dist)
        and a.world_from_camera.shape == b.world_from_camera.shape
        and np.allclose(a.world_from_camera, b.world_from_camera, rtol=0, atol=1e-6)
    )


def show_footage(camera: bpy.types.Object, footage: str | Path, motion: Motion, frames: np.ndarray) -> list[str]:
    """Put the footage behind the scene when one looks through the camera.

    Blender shows one frame of a clip per frame of the scene, so it agrees with the motion where the scene's rate is
    the footage's and constant. Elsewhere the footage is shown as an image, whose frame can be keyed. Only a clip can
    be undistorted: that of a distorting lens drifts there, and a picture of one is a clip too, seen in its own frame.

    :param footage: video or picture; of numbered pictures the first one.
    :param frames: (T,) scene frame of each pose.
    :return: warnings: what will not line up.
    :raises VideoError: the file is missing.
    """
    path = Path(footage).resolve()
    if not path.is_file():
        raise VideoError(f"the footage {path} does not exist; give the video or picture the motion was captured from")
    warnings: list[str] = []
    background = camera.data.background_images.new()
    background.alpha = 1.0
    background.display_depth = "BACK"
    background.frame_method = "FIT"
    camera.data.show_background_images = True
    if path.suffix.lower() in PICTURE_SUFFIXES and not motion.dist.any():
        background.source = "IMAGE"
        background.image = bpy.data.images.load(str(path), check_existing=True)
        background.image.display_aspect = pixel_aspect(motion)
        size = tuple(background.image.size)
        if len(motion.frames) > 1:
            warnings += _show_pictures_in_step(camera.data, background, path, motion, frames)
    else:
        clip = bpy.data.movieclips.load(str(path))  # its own: another capture may begin elsewhere or have another lens
        clip.frame_start = round(frames[0] - motion.frames[0])
        drift = float(np.abs(frames - (clip.frame_start + motion.frames)).max())
        size = tuple(clip.size)
        if drift > _IN_STEP and min(size) and not motion.dist.any():
            rate = clip.fps
            bpy.data.movieclips.remove(clip)
            _show_in_step(camera.data, background, path, motion, frames, rate)
        else:
            background.source = "MOVIE_CLIP"
            background.clip = clip
            clip.display_aspect = pixel_aspect(motion)
            _set_lens_distortion(clip, background, motion)
            if drift > 1.0:
                warnings.append(
                    f"the picture behind the scene drifts from the motion by up to {drift:.0f} frames, because the "
                    "scene does not play at the footage's constant frame rate and the lens distorts; the motion keeps "
                    "its speed"
                )
    if not min(size):
        warnings = [f"Blender cannot decode {path.name}, so the camera shows no footage"]
    elif tuple(motion.image_size) != size:
        warnings.append(
            f"Blender shows {path.name} at {size[0]} x {size[1]}, but it was captured at {motion.image_size[0]} x "
            f"{motion.image_size[1]}: turn or scale the camera's background picture"
        )
    return warnings


def _show_in_step(
    camera: bpy.types.Camera,
    background: bpy.types.CameraBackgroundImage,
    footage: Path,
    motion: Motion,
    frames: np.ndarray,
    rate: float,
) -> None:
    """Show a video as an image whose frame is keyed, so that it keeps step with the motion at any frame rate.

    At scene frame s Blender shows frame s − frame_start + frame_offset of an image, counted from 0.

    :param rate: frames a second by which Blender numbers the video's frames.
    """
    background.source = "IMAGE"
    background.image = image = bpy.data.images.load(str(footage), check_existing=True)
    image.display_aspect = pixel_aspect(motion)
    scene_frames = np.arange(np.floor(frames[0]), np.ceil(frames[-1]) + 1)
    _key_footage(camera, background, scene_frames, np.round(np.interp(scene_frames, frames, motion.timestamps) * rate))


def _show_pictures_in_step(
    camera: bpy.types.Camera,
    background: bpy.types.CameraBackgroundImage,
    first: Path,
    motion: Motion,
    frames: np.ndarray,
) -> list[str]:
    """Go on from the first of numbered pictures to those of the other poses; returns warnings."""
    found = [LAST_NUMBER.search(picture.stem) for picture in numbered_from(first)]
    numbers = np.array([int(match.group()) for match in found if match])
    if len(numbers) == 0:  # a picture by itself
        return []
    if len(numbers) <= motion.frames.max() or numbers[-1] >= _LONG:
        return [f"Blender cannot count as the pictures from {first.name} on do, so the camera shows that one alone"]
    background.image.source = "SEQUENCE"
    scene_frames = np.arange(np.floor(frames[0]), np.ceil(frames[-1]) + 1)
    poses = np.round(np.interp(scene_frames, frames, np.arange(len(frames)))).astype(int)
    # Blender counts a video's frames from 0, but names pictures by the count from 1.
    _key_footage(camera, background, scene_frames, numbers[motion.frames[poses]] - 1)
    return []


def _key_footage(
    camera: bpy.types.Camera,
    background: bpy.types.CameraBackgroundImage,
    scene_frames: np.ndarray,
    shown: np.ndarray,
) -> None:
    """Have the image behind the scene show these of its frames, counted from 0, at these frames of the scene."""
    user = background.image_user
    user.frame_start, user.frame_duration = int(scene_frames[0]), _LONG
    user.use_auto_refresh, user.use_cyclic = True, False
    offsets = shown - (scene_frames - scene_frames[0])
    changes = np.flatnonzero(np.diff(offsets, prepend=np.inf))
    path = f"background_images[{len(camera.background_images) - 1}].image_user.frame_offset"
    channels = Channels(camera, bpy.data.actions.new(f"{camera.name}_footage"))
    channels.write(path, scene_frames[changes], offsets[changes], "CONSTANT")


def _set_lens_distortion(
    clip: bpy.types.MovieClip, background: bpy.types.CameraBackgroundImage, motion: Motion
) -> None:
    """Tell the clip its lens, and show it undistorted when the lens distorts: Blender's cameras are pinholes.

    :param motion: its ``dist`` is OpenCV's, for which ``blender_brown_distortion`` has Blender's names.
    """
    width, height = (float(n) for n in motion.image_size)
    lens = clip.tracking.camera
    lens.sensor_width = SENSOR_WIDTH
    lens.units = "MILLIMETERS"
    lens.focal_length = SENSOR_WIDTH * motion.intrinsics[0, 0] / width
    lens.pixel_aspect = motion.intrinsics[1, 1] / motion.intrinsics[0, 0]
    # Blender counts the principal point's v from the bottom.
    lens.principal_point_pixels = motion.intrinsics[0, 2], height - motion.intrinsics[1, 2]
    lens.distortion_model = "BROWN"
    k1, k2, k3, p1, p2 = blender_brown_distortion(motion.dist)
    lens.brown_k1, lens.brown_k2, lens.brown_k3, lens.brown_k4 = k1, k2, k3, 0.0
    lens.brown_p1, lens.brown_p2 = p1, p2
    background.clip_user.use_render_undistorted = bool(motion.dist.any())
