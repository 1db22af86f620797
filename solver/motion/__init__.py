# SPDX-License-Identifier: Apache-2.0
"""All poses of a clip and its shape as one problem, with terms that couple the frames."""
