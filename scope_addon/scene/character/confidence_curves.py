# SPDX-License-Identifier: GPL-3.0-or-later
"""What the capture knows beside the pose, keyed: confidence on every bone, contact on the feet's, markers at doubts.

``confidence`` (0..1) says how far keypoints, not priors, fix the bone. ``contact`` (0..1) is the probability that the
heel (on the ankle's bone) or the toes (on the foot's) stand still on the floor; drivers and constraints can use it.
"""

from __future__ import annotations

import bpy
import numpy as np

from ....solver.body import Body
from ...motion import Motion
from ...review_spans import REASONS, find_review_spans
from ..animation_data.actions import Channels, bone_property_path

CONFIDENCE, CONTACT = "confidence", "contact"
# The bones that carry the columns of ``Motion.foot_contact``.
CONTACT_BONES = ("left_ankle", "left_foot", "right_ankle", "right_foot")
_DESCRIPTIONS = {
    CONFIDENCE: "How far the footage, not experience, fixes this bone",
    CONTACT: "Probability that this end of the foot stands on the floor",
}
MARKER_NAMES = {"unseen": "not seen", "far": "check", "unsure": "unsure"}
_MOST_MARKERS = 40  # more would only hide the timeline
_GAP_S = 0.5  # spans nearer than this share a marker


def key_measurements(
    armature: bpy.types.Object, channels: Channels, body: Body, motion: Motion, frames: np.ndarray
) -> None:
    """Key confidence and contact as custom properties of the bones, at scene frames (T,).

    The curves are hidden in the graph editor, where they would only be in the way of the rotations'.
    """
    columns = {(name, CONFIDENCE): motion.joint_confidence[:, i] for i, name in enumerate(body.joint_names)}
    columns |= {
        (name, CONTACT): motion.foot_contact[:, i] for i, name in enumerate(CONTACT_BONES) if name in body.joint_names
    }
    for (bone_name, name), values in columns.items():
        bone = armature.pose.bones[bone_name]
        bone[name] = float(values[0])
        bone.id_properties_ui(name).update(
            min=0.0, max=1.0, soft_min=0.0, soft_max=1.0, description=_DESCRIPTIONS[name]
        )
        for curve in channels.write(bone_property_path(bone_name, name), frames, values, group=name.title()):
            curve.hide = True


def mark_low_confidence(scene: bpy.types.Scene, whose: str, motion: Motion, frames: np.ndarray) -> int:
    """Put a marker on the timeline where each span that deserves a look begins; returns how many.

    Of very many the longest get one. What a marker means stands in its name: "not seen 12-18".

    :param whose: put before the name, for several people.
    """
    spans = sorted(find_review_spans(motion, _GAP_S), key=lambda span: span.first - span.last)[:_MOST_MARKERS]
    there = {(marker.name, marker.frame) for marker in scene.timeline_markers}
    for span in sorted(spans, key=lambda span: span.first):
        first, last = round(float(frames[span.first])), round(float(frames[span.last]))
        at = f"{first}" if first == last else f"{first}-{last}"
        name = f"{whose}{MARKER_NAMES[span.reason]} {at}"
        if (name, first) not in there:
            scene.timeline_markers.new(name, frame=first)
    return len(spans)


assert MARKER_NAMES.keys() == REASONS.keys()
