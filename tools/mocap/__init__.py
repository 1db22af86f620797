# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion data for training: read archives and sets of motion capture and fit the default body to
them.

- ``take.py``: one recorded motion as named joints, and the coordinate frame of all sources
- ``formats``: the archives' files and .bvh
- ``library.py``: the archives as a list of takes
- ``position_sets.py``: sets of joint positions of people who stand with straighter legs than CMU's
- ``straight_legs.py``: CMU's takes with straighter legs
- ``kinds.py``: the kind of motion that a take shows
- ``retarget.py``: the correspondence between a source's skeleton and the body's parts
- ``markers.py``: joint centres from optical markers
- ``joint_centres.py``: takes from joint positions alone
- ``new_performers.py``: performers that nothing was trained on, for tests
- ``fit_body.py``: poses, translations and shapes of the body for all takes; ``python -m
    scope.tools.mocap.fit_body``
"""
