# SPDX-License-Identifier: GPL-3.0-or-later
"""Simplified Chinese."""

STAGES = {
    "Starting": "正在启动",
    "Finding the person": "正在查找人物",
    "Finding the shape": "正在估算体型",
    "Solving": "正在解算",
    "Solving the clip": "正在解算片段",
    "Solving each frame": "正在逐帧解算",
    "Writing": "正在写入",
    "Building the scene": "正在构建场景",
    "Compiling the solver": "正在编译解算器",
    "{stage} (first capture only)": "{stage}（仅首次捕捉）",
    "{stage}, {done} of {total}": "{stage}，{done} / {total}",
    "{rate:.1f} frames/s": "{rate:.1f} 帧/秒",
    "{time} left": "剩余 {time}",
}
