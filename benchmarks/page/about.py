# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tables of a command show, and what they were measured on: one or two sentences each."""

from __future__ import annotations

ABOUT = {  # by the name of the benchmark, or of the script
    "gate": (
        "Preset best on Pose2Sim's four cameras and on the sample clip, and ratios of times within "
        "one run. "
        "The gate fails if a figure is worse than recorded by more than its noise."
    ),
    "solver": (
        "K is the number of joints (scope: 23, as SMPL has; scope_h: 51, as SMPL+H), P that of "
        "shape "
        "coefficients, N that of measurements. The dense step is an unconstrained baseline: "
        "compiled "
        "Jacobian, BLAS, Cholesky factorization."
    ),
    "perception": (
        "Speed: one person, 1920 × 1088 pixels, from video to motion file, alternating with "
        "MediaPipe's "
        "Python pipeline with the same network. Accuracy: Pose2Sim's four cameras, 100 frames "
        "each, one at a "
        "time."
    ),
    "ablation": (
        "Preset best. Every clip is observed once and solved again without one of the parts. Means "
        "of four "
        "cameras, 14 renders and the people of 20 development scenes; IoU: with the capture's own "
        "person "
        "masks, of the cameras and of six clips without ground truth. Parentheses: 95 % intervals "
        "by "
        "bootstrap over people."
    ),
    "renders": (
        "Random bodies, which move as in fourteen recordings that the lifting network was not "
        "trained on, "
        "before random cameras, in clips of up to 1.5 s; the means leave out the sample clip. "
        "Parentheses: "
        "95 % intervals by bootstrap over clips. Depth flips: of the fit of the clip, and of every "
        "frame "
        "fitted alone."
    ),
    "scenes": (
        "Rendered scenes of 1.2 s with one or two people. Choices were based on the development "
        "scenes; "
        "nothing was trained on the new performers, and, with two exceptions, nothing was chosen "
        "on them. "
        "Errors are means over the frames in which a person was found. Parentheses: 95 % intervals "
        "by "
        "bootstrap over people. Depth flips: of the fit of the clip, and of every frame fitted "
        "alone."
    ),
    "stills": (
        "Single frames of the clips with ground truth, each captured as an image by itself. Means "
        "over clips, "
        "medians over people who were found. Parentheses: 95 % intervals by bootstrap over clips."
    ),
    "two_people": (
        "Pose2Sim's man with a computer-generated woman drawn beside him, captured one camera at a "
        "time with "
        "--people all. Her ground truth is triangulated from keypoints of all four cameras."
    ),
    "climbs": (
        "Rendered people who climb onto boxes that are not drawn: 4 s each, camera at rest, "
        "stature given, "
        "preset best. The share is that of the lower ankle's true rise; in the world, the clip is "
        "aligned by "
        "heading and position."
    ),
    "smplify": (
        "Every tenth frame of Pose2Sim's four cameras and of the sample clip, from the same "
        "keypoints and "
        "focal lengths."
    ),
    "outline": (
        "Medians over frames: intersection over union of the captured body's silhouette with the "
        "person mask "
        "of the largest landmark network, and the shares of each that lie outside the other."
    ),
    "faces": (
        "Rendered faces with known expressions and gaze, by method and by condition: mean absolute "
        "errors of weights from 0 to 1."
    ),
}
