# SPDX-License-Identifier: GPL-3.0-or-later
"""Convert MediaPipe's TFLite pose, hand and face networks into ONNX files for onnxruntime.

``python -m scope.tools.convert_networks [--out assets/networks]`` fetches the pinned packages
(`fetch`), reads the models (`tflite`), folds compressed weights into plain constants (`constants`),
and writes one ONNX graph per entry of the `catalogue` (`graph`, `operators`, `arithmetic`,
`layout`, `to_onnx`). `build` runs all steps and skips networks that were already built from the
same source.
"""
