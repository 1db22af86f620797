# SPDX-License-Identifier: GPL-3.0-or-later
"""An optimizer in the manner of SMPLify, the slow baseline of the solver's paper, on the default
body.

- ``objective.py``: residuals of one frame from its 2D keypoints alone
- ``dense.py``: Levenberg-Marquardt with a dense numeric Jacobian
- ``comparison.py``: accuracy and time beside Scope's, on the same frames
"""
