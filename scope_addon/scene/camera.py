# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender camera with the view of the footage's camera, and the footage in the background.

Blender's cameras have the axes x right, y up, and look along −z; see ``kinematics/axes.py`` for
other conventions.

OpenCV's pinhole ``u = fx x/z + cx, v = fy y/z + cy`` in a W × H picture is, with the horizontal
sensor fit,

    lens / sensor_width = fx / W,     shift_x = 1/2 − cx / W,
    pixel_aspect_x / pixel_aspect_y = fy / fx,     shift_y = (cy − H/2) / W · fx / fy.

Pixel aspect and resolution belong to the scene in Blender; the camera alone is exact for square
pixels. The footage has a display aspect of its own, without which it would not fill the picture. A
movie clip's lens has a third one, fy / fx, because it measures rows in units of columns. Source:
Blender's BKE_camera_params_compute_viewplane, overlay_image.cc and tracking.cc.

Footage is shown as an image: the frame of an image can be keyed for any frame rate, its colours do
not go through the scene's view transform, and Blender 4.3 crashes, also without this extension,
when a movie clip is deleted that the viewport shows. Only a clip can be undistorted, so footage of
a distorting lens is one.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from bpy.types import ID, CameraBackgroundImage, Collection, Object, Scene

from ...solver.rotations import quaternion_from_matrix
from ..arrays import Float64Array
from ..errors import VideoError
from ..exif import picture_view
from ..footage import LAST_NUMBER, PICTURE_SUFFIXES, numbered_from, picture_slots
from ..kinematics.smoothing import continuous_quaternions
from ..motion import Motion
from ..notices import Notice, notice
from .actions import Channels, fcurves_of
from .datablocks import VIEW_TAG, action_of, view_number
from .stored_values import stored_numbers
from .timing import rows_of_scene_frames

# frames; footage that deviates less counts as synchronized, because 0.5 is rounding
_MAX_OFFSET = 0.6
_MAX_DURATION = 1_000_000  # frames; after this duration Blender would show the last frame
# Custom property of a capture's collection and its further cameras: width, height and pixel aspect
# of the footage.
_PICTURE = "scope_picture"
SENSOR_WIDTH = 36.0  # millimetres; only its ratio to the focal length matters
# OpenCV camera axes in those of a Blender camera (which looks along its −z with y up).
R_CAMERA_BLENDCAM = np.diag([1.0, -1.0, -1.0])


def pixel_aspect(motion: Motion) -> tuple[float, float]:
    """Return the scene's ``pixel_aspect_x, pixel_aspect_y`` for the intrinsics; Blender requires at
    least 1.
    """
    fx = motion.intrinsics[0, 0]
    fy = motion.intrinsics[1, 1]
    ratio = fy / fx
    if abs(ratio - 1.0) < 1e-6:
        return 1.0, 1.0
    return (float(ratio), 1.0) if ratio > 1 else (1.0, float(1 / ratio))


def _footage_aspect(motion: Motion) -> tuple[float, float]:
    """Return the pixel aspect of the file's picture, which a quarter turn exchanges."""
    x, y = pixel_aspect(motion)
    return (x, y) if motion.view.is_upright else (y, x)


def store_resolution(owner: ID, motion: Motion) -> None:
    """Store the size and pixel aspect of the footage in a capture's collection, or in one of its
    further cameras.
    """
    owner[_PICTURE] = [*(float(n) for n in motion.image_size), *pixel_aspect(motion)]


def set_resolution(scene: Scene, owner: ID) -> None:
    """Set the scene's resolution and pixel aspect to those of the footage, if a capture's
    collection, or one of its further cameras, stores them.
    """
    picture = stored_numbers(owner, _PICTURE)
    if len(picture) != 4 or min(picture) <= 0:
        return
    width, height, aspect_x, aspect_y = picture
    scene.render.resolution_x = int(width)
    scene.render.resolution_y = int(height)
    scene.render.resolution_percentage = 100
    scene.render.pixel_aspect_x = aspect_x
    scene.render.pixel_aspect_y = aspect_y


def build_camera(name: str, motion: Motion, collection: Collection, frames: Float64Array) -> Object:
    """Create a camera object with the intrinsics and the pose of the footage's camera.

    :param frames: (T,) scene frame of each pose; a camera that moves or zooms is keyed there.
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
        rotations = continuous_quaternions(T_world_blendcam[:, :3, :3])
        channels = Channels(obj, bpy.data.actions.new(name))
        channels.write("location", frames, locations, group="Object Transforms")
        channels.write("rotation_quaternion", frames, rotations, group="Object Transforms")
    if motion.zoom is not None:
        Channels(data, bpy.data.actions.new(f"{name}_lens")).write(
            "lens", frames, data.lens * motion.zoom
        )
    return obj


def build_view(
    name: str, motion: Motion, number: int, collection: Collection, frames: Float64Array
) -> Object:
    """Create the camera object of a further camera of a motion.

    :param number: of the camera, see `Motion.from_view`. :param frames: (T,) as of `build_camera`.
    """
    seen = motion.from_view(number)
    obj = build_camera(name, seen, collection, frames)
    obj[VIEW_TAG] = number
    store_resolution(obj, seen)
    return obj


def set_lens(data: bpy.types.Camera, motion: Motion) -> None:
    """Set focal length, sensor and principal point of a Blender camera from
    ``motion.intrinsics``.
    """
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
    data.clip_start = 0.01
    # People may be scaled to the scene's unit; where it is a long one, they may be not yet.
    data.clip_end = max(1000.0, 1000.0 / bpy.context.scene.unit_settings.scale_length)


def same_camera(a: Motion, b: Motion) -> bool:
    """Return whether two motions were captured with the same camera, as those of several people in
    one clip are.
    """
    return (
        np.array_equal(a.image_size, b.image_size)
        and np.array_equal(a.dist, b.dist)
        and len(a) == len(b)
        and np.allclose(a.intrinsics_of_frames, b.intrinsics_of_frames, rtol=0, atol=1e-6)
        and a.world_from_camera.shape == b.world_from_camera.shape
        and np.allclose(a.world_from_camera, b.world_from_camera, rtol=0, atol=1e-6)
    )


def show_footage(
    camera: Object, footage: str | Path, motion: Motion, frames: Float64Array
) -> list[Notice]:
    """Show the footage as the camera's background, in step with the poses.

    Blender shows one frame of a movie clip per frame of the scene, so footage of a distorting lens
    drifts in a scene without the constant rate of the footage.

    :param footage: video or picture; the first one of numbered pictures.
    :param frames: (T,) scene frame of each pose.
    :return: warnings about what will not align.
    :raises VideoError: when the file is missing.
    """
    path = Path(footage).resolve()
    if not path.is_file():
        raise VideoError(
            f"the footage {path} does not exist; give the video or image the motion "
            "was captured from"
        )
    background = camera.data.background_images.new()
    background.alpha = 1.0
    background.display_depth = "BACK"
    background.frame_method = "FIT"
    is_picture = path.suffix.lower() in PICTURE_SUFFIXES
    if is_picture:
        motion = _from_raw_picture(motion, path)
    _turn(background, motion)
    camera.data.show_background_images = True
    undistorted = _show_picture if is_picture else _show_video
    show = _show_clip if motion.dist.any() else undistorted
    try:
        size, warnings = show(camera, background, path, motion, frames)
    except RuntimeError:  # also where a name has a backslash, which Blender takes for a slash
        size, warnings = (0, 0), []
    if not min(size):
        return [notice("undecodable_footage", footage=path.name)]
    captured_width, captured_height = motion.view.size(*motion.image_size.tolist())
    if (captured_width, captured_height) != size:
        warnings.append(
            notice(
                "footage_size",
                footage=path.name,
                width=size[0],
                height=size[1],
                captured_width=captured_width,
                captured_height=captured_height,
            )
        )
    return warnings


def _from_raw_picture(motion: Motion, picture: Path) -> Motion:
    """Return the motion with a view of the picture as it is stored: Blender does not turn pictures
    as their EXIF says, as the capture has done before it turned them by the user's choice.
    """
    view = picture_view(picture).then(motion.view)
    if view == motion.view:
        return motion
    return replace(motion, footage_rotation=view.clockwise_deg, footage_mirrored=view.is_mirrored)


def _turn(background: CameraBackgroundImage, motion: Motion) -> None:
    """Show the footage as it was turned and mirrored for the capture.

    Blender fits the picture into the frame before it turns it, and exchanges its sides before that.
    """
    view = motion.view
    width, height = motion.image_size.tolist()
    background.rotation = np.radians(view.clockwise_deg)
    if view.is_mirrored:
        background.use_flip_x = view.is_upright
        background.use_flip_y = not view.is_upright
    if not view.is_upright and min(width, height):
        background.scale = max(width, height) / min(width, height)


def _show_picture(
    camera: Object,
    background: CameraBackgroundImage,
    path: Path,
    motion: Motion,
    frames: Float64Array,
) -> tuple[tuple[int, int], list[Notice]]:
    """Show a picture, or numbered ones; return the size in pixels, and warnings."""
    background.source = "IMAGE"
    background.image = bpy.data.images.load(str(path), check_existing=True)
    background.image.display_aspect = _footage_aspect(motion)
    size = tuple(background.image.size)
    several = len(motion.frames) > 1
    return size, _show_picture_sequence(camera, background, path, motion, frames) if several else []


def _show_clip(
    camera: Object,
    background: CameraBackgroundImage,
    path: Path,
    motion: Motion,
    frames: Float64Array,
) -> tuple[tuple[int, int], list[Notice]]:
    """Show footage of a distorting lens; return the size in pixels, and warnings."""
    # Always a new clip, because another capture may have another start or lens.
    clip = bpy.data.movieclips.load(str(path))
    is_video = clip.source == "MOVIE"
    shown = _frames_by_time(motion, clip) if is_video else motion.frames.astype(float)
    clip.frame_start = _start(shown, frames)
    size = tuple(clip.size)
    background.source = "MOVIE_CLIP"
    background.clip = clip
    clip.display_aspect = _footage_aspect(motion)
    _set_lens_distortion(clip, background, motion)
    if (drift := _drift(shown, frames)) <= 1.0:
        return size, []
    return size, [notice("footage_drifts", frames=drift)]


def show_footage_again(camera: Object, motion: Motion, frames: Float64Array) -> list[Notice]:
    """Show the camera's footage in step with poses that were moved in time; keep how opaque it is.

    :param frames: (T,) scene frame of each pose.
    :return: warnings as of ``show_footage``; none if the camera shows no footage, or its file is
        missing.
    :raises VideoError: as of ``show_footage``.
    """
    former = next(iter(camera.data.background_images), None)
    shown = (former.clip if former.source == "MOVIE_CLIP" else former.image) if former else None
    if former is None or shown is None or len(camera.data.background_images) > 1:
        return []
    path = Path(bpy.path.abspath(shown.filepath))
    if not path.is_file():
        return []
    opacity = former.alpha
    visible = former.show_background_image
    action = action_of(camera.data)
    if action is not None:
        Channels.of(camera.data).remove({_shown_frames_path(0)})
        if not fcurves_of(action):
            camera.data.animation_data.action = None
            if action.users == 0:
                bpy.data.actions.remove(action)
    # Blender goes on counting what a removed background image shows as used. A clip without users
    # stays, because the viewport may show it, until Blender saves the file without it.
    former.clip = former.image = None
    camera.data.background_images.remove(former)
    warnings = show_footage(camera, path, motion, frames)
    again = camera.data.background_images[0]
    again.alpha = opacity
    again.show_background_image = visible
    return warnings


def _frames_by_time(motion: Motion, clip: bpy.types.MovieClip) -> Float64Array:
    """Return the frame (T,) of a video that each pose was seen in, as Blender counts: by the time
    and the video's rate, so that frames which the file lacks count, too.
    """
    return motion.footage_times_s * clip.fps


def _start(shown: Float64Array, frames: Float64Array) -> int:
    """Return the scene frame of the footage's first frame, which need not be captured, if the rates
    are the same.

    :param shown: (T,) frame of the footage of each pose, from 0 on.
    :param frames: (T,) scene frame of each pose.
    """
    return round(float(frames[0] - shown[0]))


def _drift(shown: Float64Array, frames: Float64Array) -> float:
    """Return how many frames the poses deviate from footage of which each scene frame shows the
    next frame; the parameters are those of `_start`.
    """
    return float(np.abs(frames - (_start(shown, frames) + shown)).max())


def _show_video(
    camera: Object,
    background: CameraBackgroundImage,
    path: Path,
    motion: Motion,
    frames: Float64Array,
) -> tuple[tuple[int, int], list[Notice]]:
    """Show a video as an image, whose frame is keyed unless each frame of the scene shows the next
    one.

    :return: the size in pixels, and no warnings.
    """
    clip = bpy.data.movieclips.load(str(path))
    size = tuple(clip.size)
    shown = _frames_by_time(motion, clip)
    bpy.data.movieclips.remove(clip)  # which was never shown
    background.source = "IMAGE"
    background.image = image = bpy.data.images.load(str(path), check_existing=True)
    image.display_aspect = _footage_aspect(motion)
    if _drift(shown, frames) <= _MAX_OFFSET:
        _show_frames(background.image_user, _start(shown, frames))
        return size, []
    scene_frames = np.arange(np.floor(frames[0]), np.ceil(frames[-1]) + 1)
    _key_footage(
        camera,
        background,
        scene_frames,
        np.round(np.interp(scene_frames, frames, shown)),
    )
    return size, []


def _show_picture_sequence(
    camera: Object,
    background: CameraBackgroundImage,
    first: Path,
    motion: Motion,
    frames: Float64Array,
) -> list[Notice]:
    """Show numbered pictures in step with the poses, from the first one on; return warnings.

    A further camera has counted by its clock: it shows the picture before where one is missing, and
    its first and last one where it did not film.
    """
    found = [LAST_NUMBER.search(picture.stem) for picture in numbered_from(first)]
    numbers = np.array([int(match.group()) for match in found if match])
    if len(numbers) == 0:  # a single picture
        return []
    pictures = motion.frames
    if view_number(camera) is not None:
        slots = picture_slots(numbers.tolist())
        pictures = np.maximum(np.searchsorted(slots, motion.frames, side="right") - 1, 0)
    if len(numbers) <= pictures.max() or numbers[-1] >= _MAX_DURATION:
        return [notice("image_numbers", first=first.name)]
    background.image.source = "SEQUENCE"
    scene_frames, poses = rows_of_scene_frames(frames)
    # Blender counts a video's frames from 0, but those of an image sequence from 1.
    _key_footage(camera, background, scene_frames, numbers[pictures[poses]] - 1)
    return []


def _key_footage(
    camera: Object,
    background: CameraBackgroundImage,
    scene_frames: Float64Array,
    shown: Float64Array,
) -> None:
    """Key the background image to show the frames ``shown`` (counted from 0) at ``scene_frames``,
    both (N,).
    """
    _show_frames(background.image_user, int(scene_frames[0]))
    offsets = shown - (scene_frames - scene_frames[0])
    changes = np.flatnonzero(np.diff(offsets, prepend=np.inf))
    data = camera.data
    path = _shown_frames_path(len(data.background_images) - 1)
    animation = data.animation_data
    if animation is not None and animation.action is not None:  # the keys of a lens that zooms
        channels = Channels.of(data)
    else:
        channels = Channels(data, bpy.data.actions.new(f"{data.name}_footage"))
    channels.write(path, scene_frames[changes], offsets[changes], "CONSTANT")


def _shown_frames_path(number: int) -> str:
    """Return the path of what says which frame a camera's background image shows."""
    return f"background_images[{number}].image_user.frame_offset"


def _show_frames(user: bpy.types.ImageUser, start: int) -> None:
    """Show one frame after the other of a video or sequence, the first one at the scene frame
    ``start``.

    At scene frame s Blender shows frame s − frame_start + frame_offset of a video, counted from 0.
    """
    user.frame_start = start
    user.frame_offset = 0
    user.frame_duration = _MAX_DURATION
    user.use_auto_refresh = True
    user.use_cyclic = False


def _set_lens_distortion(
    clip: bpy.types.MovieClip, background: CameraBackgroundImage, motion: Motion
) -> None:
    """Set the clip's lens, and show it undistorted: Blender's cameras are pinholes.

    :param motion: with OpenCV's distortion in ``dist``.
    """
    # The clip's lens is that of the file's picture.
    size = motion.image_size.tolist()
    width, height = motion.view.size(*size)
    intrinsics = motion.view.inverse.intrinsics(motion.intrinsics, *size)
    lens = clip.tracking.camera
    lens.sensor_width = SENSOR_WIDTH
    lens.units = "MILLIMETERS"
    lens.focal_length = SENSOR_WIDTH * intrinsics[0, 0] / width
    lens.pixel_aspect = intrinsics[1, 1] / intrinsics[0, 0]
    # Blender measures the principal point's v from the bottom.
    lens.principal_point_pixels = intrinsics[0, 2], height - intrinsics[1, 2]
    lens.distortion_model = "BROWN"
    k1, k2, k3, p1, p2 = blender_brown_distortion(motion.view.inverse.distortion(motion.dist))
    lens.brown_k1 = k1
    lens.brown_k2 = k2
    lens.brown_k3 = k3
    lens.brown_k4 = 0.0
    lens.brown_p1 = p1
    lens.brown_p2 = p2
    background.clip_user.use_render_undistorted = True


def blender_camera_matrix(world_from_camera: Float64Array) -> Float64Array:
    """Convert the pose of an OpenCV camera to that of a Blender camera object with the same view.

    ``world_from_blendcam = world_from_camera · diag(R_camera_blendcam, 1)``.

    :param world_from_camera: (..., 4, 4) OpenCV camera to world.
    :return: (..., 4, 4) Blender camera to world.
    """
    camera_from_blendcam = np.eye(4)
    camera_from_blendcam[:3, :3] = R_CAMERA_BLENDCAM
    return np.asarray(world_from_camera) @ camera_from_blendcam


def blender_brown_distortion(dist: Float64Array) -> tuple[float, float, float, float, float]:
    """Convert OpenCV's (k1, k2, p1, p2, k3) to the coefficients k1, k2, k3, p1, p2 of Blender's
    Brown model.

    Both add a tangential term to (x, y)(1 + k1 r² + k2 r⁴ + k3 r⁶), in units of the focal length:

        OpenCV, y down:    (2 p1 xy + p2 (r² + 2x²),  p1 (r² + 2y²) + 2 p2 xy)
        Blender, y up:     (p1 (r² + 2x²) + 2 p2 xy,  p2 (r² + 2y²) + 2 p1 xy)

    Therefore p1 and p2 are swapped, and the one that belongs to y changes its sign.
    Source: OpenCV's camera calibration, libmv's ApplyBrownDistortionModel.

    :param dist: (5,) of the footage's camera.
    """
    k1, k2, p1, p2, k3 = (float(c) for c in dist)
    return k1, k2, k3, p2, -p1
