# SPDX-License-Identifier: GPL-3.0-or-later
"""Augment few recordings to many motions and proportions, in PyTorch on any device.

A pose is a state of each joint, Ω (24, 3, 3), and a root rotation into a world with y up; a motion
is a window of poses at the lifter's moments. Some motions run slower, faster or backwards, and half
of them are mirrored. In a share of the samples, the joints are as recorded, up to that. In the
others, torso, arms and legs sometimes come from different recordings, joints are rotated at random
by a constant of the window, and the body leans further.

Legs of people who stand are straightened in a share of the samples, see `PoseSampler.straightened`:
in recordings they are bent by 10 degrees at the median, in people by 0 to 5, which marker-based
recordings of gait laboratories show.

Some people who stand sink into a squat, see `PoseSampler.squats`: recordings show few half squats,
and seen from the front, knees bent by 60 degrees only shorten the legs, which a network that never
saw them takes for a tall person's short legs.

Everything here and in `dataset` and `detector_noise` is drawn by the device's default generator
(`torch.manual_seed`) and copies nothing between host and device once the objects are made, so that
a CUDA graph can record it.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ...scope_addon.capture.perception.lifter import MIDDLE, OFFSETS_S
from ...solver.body import Body
from .motions import Motions

# Share of samples in which a part, everything from this joint outwards, comes from another frame.
SWAPS = {"spine1": 0.5, "left_collar": 0.4, "right_collar": 0.4, "left_hip": 0.2, "right_hip": 0.2}
# Radians about a random axis, times a factor per sample of |N(0, 1)|.
JOINT_NOISE = {
    "shoulder": 0.45,
    "collar": 0.1,
    "elbow": 0.25,
    "wrist": 0.3,
    "hand": 0.2,
    "hip": 0.2,
    "knee": 0.2,
}
JOINT_NOISE |= {"ankle": 0.2, "foot": 0.1, "spine": 0.08, "neck": 0.15, "head": 0.2}
UNTURNED_SHARE = 0.25  # of the samples that are not natural, those whose joints are not rotated
LEAN = math.radians(7.0)
STRONG_LEAN = math.radians(45.0)
STRONG_LEAN_SHARE = 0.1
NATURAL_LEAN = 0.4  # factor on the lean of natural samples
STRAIGHTENED_SHARE = 0.8  # of the samples of people who stand, those whose legs are straightened
STRAIGHTENED_PART = (0.4, 1.0)  # of the flexion that is taken out
STRAIGHTENED_DEG = 22.0  # up to which a knee is bent because of the recording, and not on purpose
SQUAT_SHARE = 0.35  # of the samples of people who stand, those who squat, ...
SQUAT_DEG = (0.0, 80.0)  # ... whose thighs pitch forward by this in the middle of the window, ...
SQUAT_SPEED_DEG_S = 40.0  # ... and turn by this per second, one standard deviation
# forward, of the thigh's
SHANK_PITCH = (0.25, 0.75)
TRUNK_PITCH = (0.0, 0.8)
LEGS_DIFFER = 0.1  # spread of the factor between the pitches of the two legs
# of the squats, those in which arms are stretched forward, as people do to keep their balance
ARMS_AHEAD_SHARE = 0.4
# standard deviations
ARMS_DEG = {"elevation": 15.0, "azimuth": 12.0, "roll": 30.0, "elbow": 25.0, "sides": 5.0}
SPEED_SPREAD = 0.2  # of the logarithm of a motion's speed
SHAPE_LIMIT = 2.5  # in standard deviations
BONE_SPREAD = 0.04  # of the logarithm of each bone's length, left and right alike
# Bones whose lengths vary together: these, named by their ends, and the rest, the trunk.
SEGMENTS = (("elbow", "wrist", "hand"), ("knee", "ankle", "foot"))


class PoseSampler:
    """Draws augmented poses and shapes for one body.

    ``natural_share`` of the samples are as recorded; ``segment_spread`` is the standard deviation
    of the logarithm by which trunk, arms and legs vary in length, each as a whole.
    """

    def __init__(
        self,
        body: Body,
        motions: Motions,
        natural_share: float = 0.0,
        segment_spread: float = 0.0,
        device: str = "cpu",
    ) -> None:
        self.natural_share = natural_share
        self.segment_spread = segment_spread
        self.device = device
        names = body.joint_names
        on_device = partial(constant, device=device)
        self.joint_count = len(names)
        self._states = on_device(motions.Omega).reshape(-1, 3, 3)  # row F·24 + k
        self._cumulative = on_device(np.cumsum(motions.share), dtype=torch.float64)
        self._first, self._last = (on_device(ends, dtype=torch.long) for ends in motions.ends)
        self._fps = on_device(motions.fps)
        self._offsets_s = on_device(OFFSETS_S)
        self._stands = on_device(motions.kinds == "stand", dtype=torch.bool)
        self._squatting = [
            [names.index(f"{s}_{j}") for j in ("hip", "knee", "ankle")] for s in ("left", "right")
        ]
        self._arms = [
            [names.index(f"{s}_{j}") for j in ("shoulder", "elbow")] for s in ("left", "right")
        ]
        self.partner = on_device(
            [names.index(_other_side(name)) for name in names], dtype=torch.long
        )
        self._joints = torch.arange(self.joint_count, device=device)
        self._alike = torch.minimum(self._joints, self.partner)
        self._mirror_signs = on_device(np.outer([-1, 1, 1], [-1, 1, 1]))
        self._parts = [
            (on_device(_from(body, root), dtype=torch.bool), share) for root, share in SWAPS.items()
        ]
        self._noise = on_device(
            [next((v for k, v in JOINT_NOISE.items() if k in n), 0.0) for n in names]
        )
        segment = [
            next((1 + i for i, s in enumerate(SEGMENTS) if any(w in n for w in s)), 0)
            for n in names
        ]
        self._segment = on_device(segment, dtype=torch.long)
        at = list(body.keypoint_set("blazepose").values())
        self._bones = on_device(body.l)
        self._bone_shapes = on_device(body.S)
        self._keypoints = on_device(body.v_bar[at])
        self._keypoint_shapes = on_device(body.V[at])

    def mirror(self, Omega: Tensor) -> Tensor:
        """Return the mirror image of poses (..., 24, 3, 3) about the body's (and the world's) x =
        0.
        """
        return (Omega * self._mirror_signs)[..., self.partner, :, :]

    def _windows(self, n: int) -> tuple[Tensor, Tensor]:
        """Draw n windows of one recording each: frames (n, WINDOW), and (n,) bool: whether they are
        mirrored.
        """
        drawn = torch.searchsorted(
            self._cumulative, torch.rand(n, device=self.device, dtype=torch.float64)
        )
        middle = drawn.clamp(max=len(self._first) - 1)
        backwards = torch.where(chance(self._fps, 0.5, n), 1.0, -1.0)
        speed = torch.exp(SPEED_SPREAD * normal(self._fps, n)) * backwards
        steps = torch.round(self._offsets_s * (self._fps[middle] * speed)[:, None]).long()
        frames = torch.maximum(middle[:, None] + steps, self._first[middle][:, None])
        return torch.minimum(frames, self._last[middle][:, None]), chance(self._fps, 0.5, n)

    def motion_windows(self, n: int) -> Tensor:
        """Draw windows (n, WINDOW, 24, 3, 3); row 0 of a pose is R_world_root, y up, with a random
        heading.
        """
        natural = chance(self._fps, self.natural_share, n)
        frames, mirrored = self._windows(n)
        frames = frames[:, :, None].expand(-1, -1, self.joint_count)
        mirrored = mirrored[:, None]
        for part, share in self._parts:
            other, other_mirrored = self._windows(n)
            taken = (chance(self._fps, share, n) & ~natural)[:, None] & part
            frames = torch.where(taken[:, None], other[:, :, None], frames)
            mirrored = torch.where(taken, other_mirrored[:, None], mirrored)
        source = torch.where(mirrored, self.partner, self._joints)
        Omega = self._states[frames * self.joint_count + source[:, None]]
        Omega = torch.where(mirrored[:, None, :, None, None], Omega * self._mirror_signs, Omega)
        turned = ~natural & ~chance(self._fps, UNTURNED_SHARE, n)
        strength = (normal(self._fps, n).abs() * turned)[:, None, None]
        turn = normal(self._fps, n, self.joint_count, 3) * self._noise[:, None] * strength
        Omega = Omega @ rotation_matrices(turn)[:, None]
        stands = self._stands[frames[:, MIDDLE, 0]]
        Omega = self.squats(self.straightened(Omega, stands), stands)
        root = self._placement(natural)[:, None] @ Omega[:, :, 0]
        return torch.cat([root[:, :, None], Omega[:, :, 1:]], 2)

    def straightened(self, Omega: Tensor, stands: Tensor) -> Tensor:
        """Take a random part of the flexion out of the knees of some people who stand, where it is
        small.

        Hips and ankles turn by half of it each, so that the foot stays below the hip.

        :param Omega: (n, WINDOW, 24, 3, 3) motions;  stands: (n,) whose recording shows standing.
        """
        n = len(Omega)
        taken = stands & chance(self._fps, STRAIGHTENED_SHARE, n)
        Omega = Omega.clone()
        for hip, knee, ankle in self._squatting:
            R = Omega[:, :, knee]
            bend = torch.atan2(R[..., 2, 1] - R[..., 1, 2], R[..., 1, 1] + R[..., 2, 2])
            slight = (bend > 0.0) & (bend < math.radians(STRAIGHTENED_DEG))
            less = (
                torch.where(slight, bend, 0.0)
                * uniform(self._fps, STRAIGHTENED_PART, n, 1)
                * taken[:, None]
            )
            Omega[:, :, hip] = about_x(0.5 * less) @ Omega[:, :, hip]
            Omega[:, :, knee] = about_x(-less) @ R
            Omega[:, :, ankle] = about_x(0.5 * less) @ Omega[:, :, ankle]
        return Omega

    def squats(self, Omega: Tensor, stands: Tensor) -> Tensor:
        """Let some people who stand squat: thighs pitch backwards under the trunk, which leans
        forward as they do.

        With the pitches of thigh θ, shank φ and trunk τ in the world, hips flex by θ + τ, knees by
        θ + φ, and ankles by φ, so that the feet stay as they were.

        :param Omega: (n, WINDOW, 24, 3, 3) motions;  stands: (n,) whose recording shows standing.
        """
        n = len(Omega)
        taken = stands & chance(self._fps, SQUAT_SHARE, n)
        speed = SQUAT_SPEED_DEG_S * normal(self._fps, n, 1)
        thigh = uniform(self._fps, SQUAT_DEG, n, 1) + speed * self._offsets_s
        thigh = torch.deg2rad(thigh.clamp(*SQUAT_DEG)) * taken[:, None]
        shank = uniform(self._fps, SHANK_PITCH, n, 1) * thigh
        trunk = uniform(self._fps, TRUNK_PITCH, n, 1) * thigh
        Omega = Omega.clone()
        Omega[:, :, 0] = Omega[:, :, 0] @ about_x(trunk)
        for joints in self._squatting:
            share = torch.exp(LEGS_DIFFER * normal(self._fps, n, 1))
            flexions = (-trunk - share * thigh, share * (thigh + shank), -share * shank)
            for joint, angle in zip(joints, flexions, strict=True):
                Omega[:, :, joint] = about_x(angle) @ Omega[:, :, joint]
        return self._with_arms_ahead(Omega, trunk, taken & chance(self._fps, ARMS_AHEAD_SHARE, n))

    def _with_arms_ahead(self, Omega: Tensor, trunk: Tensor, taken: Tensor) -> Tensor:
        """Stretch both arms forward, about level in the world, where ``taken`` (n,).

        An upper arm at rest points to its side, s x with s = 1 for the left. It points ahead after

            R = R_x(−elevation) R_y(−s (90° − azimuth)) R_x(roll),

        where the elevation makes up for the trunk's pitch (n, WINDOW) in radians.
        """
        n = len(Omega)
        deviation = {name: math.radians(value) for name, value in ARMS_DEG.items()}
        elevation = trunk + deviation["elevation"] * normal(self._fps, n, 1)
        azimuth = deviation["azimuth"] * normal(self._fps, n, 1)
        for sign, (shoulder, elbow) in zip((1.0, -1.0), self._arms, strict=True):
            up = elevation + deviation["sides"] * normal(self._fps, n, 1)
            outward = azimuth + deviation["sides"] * normal(self._fps, n, 1)
            roll = deviation["roll"] * normal(self._fps, n, 1)
            flexion = deviation["elbow"] * normal(self._fps, n, 1).abs()
            ahead = about_x(-up) @ about_y(-sign * (0.5 * math.pi - outward)) @ about_x(roll)
            bent = about_y(-sign * flexion)
            for joint, R in ((shoulder, ahead), (elbow, bent)):
                Omega[:, :, joint] = torch.where(taken[:, None, None, None], R, Omega[:, :, joint])
        return Omega

    def _placement(self, natural: Tensor) -> Tensor:
        """Draw rotations (n, 3, 3) of the world's people: a heading, then a lean, less of it where
        ``natural`` (n,).
        """
        n = len(natural)
        heading, direction = 2 * math.pi * torch.rand(2, n, device=self.device)
        lean = normal(self._fps, n) * torch.where(
            chance(self._fps, STRONG_LEAN_SHARE, n), STRONG_LEAN, LEAN
        )
        lean = torch.where(natural, NATURAL_LEAN * lean, lean)
        zero = torch.zeros_like(lean)
        leaning = rotation_matrices(
            torch.stack([lean * torch.cos(direction), zero, lean * torch.sin(direction)], 1)
        )
        return leaning @ rotation_matrices(torch.stack([zero, heading, zero], 1))

    def proportions(self, n: int) -> tuple[Tensor, Tensor]:
        """Draw bodies: joints relative to parents (n, 24, 3), BlazePose keypoints relative to
        joints (n, 33, 3).
        """
        betas = normal(self._fps, n, self._bone_shapes.shape[-1]).clamp(-SHAPE_LIMIT, SHAPE_LIMIT)
        factor = BONE_SPREAD * normal(self._fps, n, self.joint_count)
        factor = (
            factor[:, self._alike]
            + (self.segment_spread * normal(self._fps, n, 1 + len(SEGMENTS)))[:, self._segment]
        )
        bones = self._bones + torch.einsum("ijp,np->nij", self._bone_shapes, betas)
        keypoints = self._keypoints + torch.einsum("ijp,np->nij", self._keypoint_shapes, betas)
        return bones * torch.exp(factor)[..., None], keypoints


def constant(values: object, device: str, dtype: torch.dtype = torch.float32) -> Tensor:
    """Copy an array to a device, once and for all batches."""
    return torch.as_tensor(np.asarray(values), dtype=dtype, device=device)


def normal(like: Tensor, *shape: int) -> Tensor:
    """Draw standard normal numbers on the device of a tensor."""
    return torch.randn(*shape, device=like.device)


def uniform(like: Tensor, limits: tuple[float, float], *shape: int) -> Tensor:
    """Draw evenly distributed numbers on the device of a tensor."""
    return limits[0] + (limits[1] - limits[0]) * torch.rand(*shape, device=like.device)


def chance(like: Tensor, share: float, *shape: int) -> Tensor:
    """Draw bools on the device of a tensor, a share of which is true."""
    return torch.rand(*shape, device=like.device) < share


def _other_side(name: str) -> str:
    partner = {"left": "right", "right": "left"}
    return "_".join(partner.get(word, word) for word in name.split("_"))


def _from(body: Body, joint: str) -> NDArray[np.bool_]:
    """Return (24,) bool: the joint and all its descendants."""
    inside = np.zeros(len(body.joint_names), bool)
    inside[body.joint_names.index(joint)] = True
    for k, parent in enumerate(body.parents[1:], 1):
        inside[k] |= inside[int(parent)]
    return inside


def about_x(angle: Tensor) -> Tensor:
    """Return rotations (..., 3, 3) about x by angles (...), radians."""
    zero = torch.zeros_like(angle)
    return rotation_matrices(torch.stack([angle, zero, zero], -1))


def about_y(angle: Tensor) -> Tensor:
    """Return rotations (..., 3, 3) about y by angles (...), radians."""
    zero = torch.zeros_like(angle)
    return rotation_matrices(torch.stack([zero, angle, zero], -1))


def rotation_matrices(phi: Tensor) -> Tensor:
    """Return exp of rotation vectors (..., 3), radians: I + sin θ/θ [φ] + (1 − cos θ)/θ² [φ]²."""
    x, y, z = phi.unbind(-1)
    theta = torch.sqrt(x * x + y * y + z * z) + 1e-8
    a = torch.sin(theta) / theta
    b = (1 - torch.cos(theta)) / (theta * theta)
    rows = [1 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y]
    rows += [b * x * y + a * z, 1 - b * (x * x + z * z), b * y * z - a * x]
    rows += [b * x * z - a * y, b * y * z + a * x, 1 - b * (x * x + y * y)]
    return torch.stack(rows, -1).reshape(*phi.shape, 3)
