# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of README and docs: captured bodies on a bare floor, with ground truth; footage of
the sample only.
"""
