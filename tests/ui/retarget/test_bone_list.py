# SPDX-License-Identifier: GPL-3.0-or-later
"""The bone list leaves out what all names of a rig begin with, so that the rest has room."""

import pytest
from scope.scope_addon.ui.retarget.bone_list import common_prefix


@pytest.mark.parametrize(
    ("bones", "prefix"),
    [
        (["mixamorig:Hips", "mixamorig:LeftHand", "mixamorig:LeftHandPinky3"], "mixamorig:"),
        (["CC_Base_Hip", "CC_Base_Head"], "CC_Base_"),
        (["Bip01 Pelvis", "Bip01 L Hand"], "Bip01 "),
        (["spine_fk", "spine_fk.001", "upper_arm_fk.L"], ""),
        (["LeftArm", "LeftLeg"], ""),
        (["mixamorig:Hips"], ""),
        ([], ""),
    ],
)
def test_the_common_prefix_ends_at_a_separator(bones, prefix):
    assert common_prefix(bones) == prefix
