# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion data for training: read three archives of motion capture and fit our body to them.

    take.py        one recorded motion as named joints, and the frame all sources share
    asf_amc.py     Acclaim skeleton and motion files (CMU)
    expmap.py      comma separated exponential-map values on the CMU skeleton
    deepmimic.py   DeepMimic's humanoid motions (JSON)
    library.py     the archives -> list of takes
    retarget.py    how a source's skeleton corresponds to our body's parts
    fit_body.py    takes -> poses, translations and shapes of our body; ``python -m scope.tools.mocap.fit_body``
"""
