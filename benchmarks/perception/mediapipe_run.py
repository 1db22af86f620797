# SPDX-License-Identifier: GPL-3.0-or-later
"""Run MediaPipe's own Python pipeline over a video, in a separate environment, and print frames per
second.

    python mediapipe_run.py VIDEO COMPLEXITY FRAMES

Decoding by OpenCV and MediaPipe's pose solution with its defaults for video (tracking and
smoothing), without post-processing. Loading and the first frame are not counted.
"""

import sys
import time

import cv2
import mediapipe


def main() -> None:
    """Run the command line."""
    path = sys.argv[1]
    complexity = int(sys.argv[2])
    most = int(sys.argv[3])
    video = cv2.VideoCapture(path)
    count = 0
    since = 0.0
    with mediapipe.solutions.pose.Pose(model_complexity=complexity) as pose:
        while count <= most:
            ok, image = video.read()
            if not ok:
                break
            pose.process(cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
            count += 1
            if count == 1:
                since = time.perf_counter()
    print((count - 1) / (time.perf_counter() - since))


if __name__ == "__main__":
    main()
