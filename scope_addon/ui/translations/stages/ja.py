# SPDX-License-Identifier: GPL-3.0-or-later
"""Japanese."""

STAGES = {
    "Starting": "開始中",
    "Finding the person": "人物を検出中",
    "Finding the shape": "体型を推定中",
    "Solving": "解析中",
    "Solving the clip": "クリップ全体を解析中",
    "Solving each frame": "各フレームを解析中",
    "Writing": "書き込み中",
    "Building the scene": "シーンを構築中",
    "Compiling the solver": "ソルバーをコンパイル中",
    "{stage} (first capture only)": "{stage}（初回のキャプチャのみ）",
    "{stage}, {done} of {total}": "{stage}、{done} / {total}",
    "{rate:.1f} frames/s": "{rate:.1f} フレーム/秒",
    "{time} left": "残り {time}",
}
