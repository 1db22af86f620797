# SPDX-License-Identifier: GPL-3.0-or-later
"""The silhouette of the body against person masks: measurements of the outline, and the shape that fits them."""
