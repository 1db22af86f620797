# SPDX-License-Identifier: GPL-3.0-or-later
"""All poses of a clip and its shape as one problem, with terms that couple the frames."""
