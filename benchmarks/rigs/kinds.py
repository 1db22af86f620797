# SPDX-License-Identifier: GPL-3.0-or-later
"""The names, hierarchies and rest poses of common kinds of rigs, written down from their public
documentation and exports.

Chains are written as ``parent > bone@place, bone@place``: every bone is the child of the one
before. ``{s}`` stands for the side, and chains with it exist twice.
"""

from __future__ import annotations

from dataclasses import dataclass

# Places of the centre and of the left side in a T-pose, metres; the person looks along -y.
PLACES = {
    "ground": (0, 0, 0), "low": (0, 0, 0.55), "root": (0, 0, 0.99), "pelvis": (0, 0, 0.97),
    "spine1": (0, 0, 1.07), "spine2": (0, 0, 1.15), "spine3": (0, 0.01, 1.23),
    "spine4": (0, 0.01, 1.33), "spine5": (0, 0.015, 1.40), "neck": (0, 0.02, 1.47),
    "neck2": (0, 0.01, 1.53), "head": (0, 0, 1.58), "top": (0, 0, 1.78),
    "hip": (0.1, 0, 0.93), "thigh2": (0.1, 0, 0.72), "knee": (0.1, -0.005, 0.5),
    "shin2": (0.1, 0.01, 0.3), "ankle": (0.1, 0.03, 0.09), "meta": (0.1, -0.03, 0.06),
    "ball": (0.1, -0.1, 0.025), "toe": (0.1, -0.18, 0.025), "heel": (0.1, 0.08, 0.02),
    "collar": (0.03, 0.01, 1.42), "shoulder": (0.17, 0.01, 1.42), "shoulder0": (0.17, 0.01, 1.42),
    "arm2": (0.30, 0.015, 1.42),
    "elbow": (0.43, 0.02, 1.42), "fore2": (0.55, 0.015, 1.42), "wrist": (0.68, 0.01, 1.42),
    "thumb1": (0.71, -0.03, 1.41), "thumb2": (0.74, -0.055, 1.405), "thumb3": (0.765, -0.07, 1.4),
    "index0": (0.70, -0.01, 1.42), "index1": (0.775, -0.02, 1.42), "index2": (0.815, -0.022, 1.42),
    "index3": (0.84, -0.023, 1.42), "middle0": (0.70, 0.0, 1.42), "middle1": (0.78, 0.005, 1.42),
    "middle2": (0.825, 0.005, 1.42), "middle3": (0.85, 0.005, 1.42), "ring0": (0.70, 0.015, 1.42),
    "ring1": (0.77, 0.028, 1.42), "ring2": (0.81, 0.029, 1.42), "ring3": (0.835, 0.03, 1.42),
    "pinky0": (0.70, 0.025, 1.42), "pinky1": (0.755, 0.047, 1.42), "pinky2": (0.785, 0.05, 1.42),
    "pinky3": (0.805, 0.052, 1.42), "tip": (0.88, 0.005, 1.42),
}  # fmt: skip
ARM = ("shoulder0", "shoulder", "arm2", "elbow", "fore2", "wrist", "tip")
FINGERS = ("thumb", "index", "middle", "ring", "pinky")


@dataclass(frozen=True)
class RigKind:
    """One kind of rig, and what is odd about its rest pose."""

    name: str
    chains: tuple[str, ...]
    sides: tuple[str, str] = ("Left", "Right")
    # Pattern of a finger's bones with {s}, {f} and {k}, the parent is the wrist; empty: no fingers.
    fingers: str = ""
    finger_names: tuple[str, ...] = ("Thumb", "Index", "Middle", "Ring", "Pinky")
    phalanges: tuple[str, ...] = ("1", "2", "3")
    arms_down: float = 0.0  # degrees below the T-pose
    tails: str = "along"  # "along" the bones, all "up", "deep" below the floor, or at "random"
    turned: float = 0.0  # heading, degrees about the vertical
    unit: float = 1.0  # metres of a length of 1 in the armature, the object's scale
    lying: bool = False  # whether y is up in the armature, under a turned object
    height: float = 1.0  # of the person, as a multiple
    lift: float = 0.0  # of the soles above the rig's origin, metres
    rigid: bool = False  # whether bones carry rigid parts instead of one skin
    other_armature: bool = False


KINDS = (
    RigKind(
        "Mixamo",
        (
            "> mixamorig:Hips@pelvis, mixamorig:Spine@spine1, mixamorig:Spine1@spine3, "
            "mixamorig:Spine2@spine4, mixamorig:Neck@neck, mixamorig:Head@head, "
            "mixamorig:HeadTop_End@top",
            "mixamorig:Hips > mixamorig:{s}UpLeg@hip, mixamorig:{s}Leg@knee, "
            "mixamorig:{s}Foot@ankle, mixamorig:{s}ToeBase@ball, mixamorig:{s}Toe_End@toe",
            "mixamorig:Spine2 > mixamorig:{s}Shoulder@collar, mixamorig:{s}Arm@shoulder, "
            "mixamorig:{s}ForeArm@elbow, mixamorig:{s}Hand@wrist",
        ),
        fingers="mixamorig:{s}Hand{f}{k}",
        unit=0.01,
        lying=True,
    ),
    RigKind(
        "Mixamo, three.js",
        (
            "> mixamorigHips@pelvis, mixamorigSpine@spine1, mixamorigSpine1@spine3, "
            "mixamorigSpine2@spine4, mixamorigNeck@neck, mixamorigHead@head",
            "mixamorigHips > mixamorig{s}UpLeg@hip, mixamorig{s}Leg@knee, mixamorig{s}Foot@ankle, "
            "mixamorig{s}ToeBase@ball",
            "mixamorigSpine2 > mixamorig{s}Shoulder@collar, mixamorig{s}Arm@shoulder, "
            "mixamorig{s}ForeArm@elbow, mixamorig{s}Hand@wrist",
        ),
        tails="up",
        height=0.9,
    ),
    RigKind(
        "Unreal 5",
        (
            "> root@ground, pelvis@pelvis, spine_01@spine1, spine_02@spine2, spine_03@spine3, "
            "spine_04@spine4, spine_05@spine5, neck_01@neck, neck_02@neck2, head@head",
            "pelvis > thigh_{s}@hip, calf_{s}@knee, foot_{s}@ankle, ball_{s}@ball",
            "thigh_{s} > thigh_twist_01_{s}@thigh2",
            "calf_{s} > calf_twist_01_{s}@shin2",
            "spine_05 > clavicle_{s}@collar, upperarm_{s}@shoulder, lowerarm_{s}@elbow, "
            "hand_{s}@wrist",
            "upperarm_{s} > upperarm_twist_01_{s}@arm2",
            "lowerarm_{s} > lowerarm_twist_01_{s}@fore2",
            "root > ik_foot_root@ground, ik_foot_{s}@ankle",
            "root > ik_hand_root@ground, ik_hand_gun@ground, ik_hand_{s}@wrist",
        ),
        ("l", "r"),
        fingers="{f}_0{k}_{s}",
        finger_names=FINGERS,
        arms_down=45,
        tails="random",
    ),
    RigKind(
        "MetaHuman",
        (
            "> root@ground, pelvis@pelvis, spine_01@spine1, spine_02@spine2, spine_03@spine3, "
            "spine_04@spine4, spine_05@spine5, neck_01@neck, neck_02@neck2, head@head",
            "pelvis > thigh_{s}@hip, calf_{s}@knee, foot_{s}@ankle, ball_{s}@ball",
            "thigh_{s} > thigh_correctiveRoot_{s}@hip, thigh_fwd_{s}@hip",
            "thigh_{s} > thigh_twistCor_01_{s}@thigh2",
            "calf_{s} > calf_correctiveRoot_{s}@knee, calf_kneeBack_{s}@knee",
            "spine_04 > spine_04_latissimus_{s}@arm2",
            "spine_05 > clavicle_{s}@collar, upperarm_{s}@shoulder, lowerarm_{s}@elbow, "
            "hand_{s}@wrist",
            "upperarm_{s} > upperarm_correctiveRoot_{s}@shoulder, upperarm_bicep_{s}@arm2",
            "hand_{s} > wrist_inner_{s}@wrist",
        ),
        ("l", "r"),
        fingers="{f}_0{k}_{s}",
        finger_names=FINGERS,
        arms_down=40,
        tails="up",
        unit=0.01,
        turned=90,
    ),
    RigKind(
        "Rigify metarig",
        (
            "> spine@pelvis, spine.001@spine1, spine.002@spine3, spine.003@spine4, "
            "spine.004@neck, spine.005@neck2, spine.006@head",
            "spine > thigh.{s}@hip, shin.{s}@knee, foot.{s}@ankle, toe.{s}@ball",
            "foot.{s} > heel.02.{s}@heel",
            "spine.003 > shoulder.{s}@collar, upper_arm.{s}@shoulder, forearm.{s}@elbow, "
            "hand.{s}@wrist",
        ),
        ("L", "R"),
        fingers="f_{f}.0{k}.{s}",
        finger_names=FINGERS,
        arms_down=15,
    ),
    RigKind(
        "DAZ Genesis 8",
        (
            "> hip@root, pelvis@pelvis",
            "hip > abdomenLower@spine1, abdomenUpper@spine2, chestLower@spine3, chestUpper@spine4, "
            "neckLower@neck, neckUpper@neck2, head@head",
            "pelvis > {s}ThighBend@hip, {s}ThighTwist@thigh2, {s}Shin@knee, {s}Foot@ankle, "
            "{s}Metatarsals@meta, {s}Toe@ball, {s}BigToe@toe",
            "chestUpper > {s}Collar@collar, {s}ShldrBend@shoulder, {s}ShldrTwist@arm2, "
            "{s}ForearmBend@elbow, {s}ForearmTwist@fore2, {s}Hand@wrist",
        ),
        ("l", "r"),
        fingers="{s}{f}{k}",
        finger_names=("Thumb", "Index", "Mid", "Ring", "Pinky"),
        arms_down=45,
        unit=0.01,
        tails="deep",
    ),
    RigKind(
        "DAZ Genesis 9",
        (
            "> hip@root, pelvis@pelvis",
            "hip > spine1@spine1, spine2@spine2, spine3@spine3, spine4@spine4, neck1@neck, "
            "neck2@neck2, head@head",
            "pelvis > {s}_thigh@hip, {s}_shin@knee, {s}_foot@ankle, {s}_metatarsals@meta, "
            "{s}_toes@ball, {s}_bigtoe1@toe",
            "{s}_thigh > {s}_thightwist1@hip, {s}_thightwist2@thigh2",
            "spine4 > {s}_shoulder@collar, {s}_upperarm@shoulder, {s}_forearm@elbow, "
            "{s}_hand@wrist",
            "{s}_upperarm > {s}_upperarmtwist1@shoulder, {s}_upperarmtwist2@arm2",
        ),
        ("l", "r"),
        fingers="{s}_{f}{k}",
        finger_names=("thumb", "index", "mid", "ring", "pinky"),
        arms_down=45,
        lying=True,
    ),
    RigKind(
        "Auto-Rig Pro",
        (
            "> c_traj@ground, c_root_master.x@pelvis, c_root.x@pelvis",
            "c_root_master.x > c_spine_01.x@spine1, c_spine_02.x@spine3, c_neck.x@neck, "
            "c_head.x@head",
            "c_root.x > c_thigh_fk.{s}@hip, c_leg_fk.{s}@knee, c_foot_fk.{s}@ankle, "
            "c_toes_fk.{s}@ball",
            "c_root.x > thigh_stretch.{s}@hip, leg_stretch.{s}@knee, foot.{s}@ankle, "
            "toes_01.{s}@ball",
            "c_traj > c_foot_ik.{s}@ankle, c_toes_ik.{s}@ball",
            "c_traj > c_leg_pole.{s}@knee",
            "c_spine_02.x > c_shoulder.{s}@collar, c_arm_fk.{s}@shoulder, c_forearm_fk.{s}@elbow, "
            "c_hand_fk.{s}@wrist",
            "c_traj > c_hand_ik.{s}@wrist",
        ),
        ("l", "r"),
        arms_down=50,
    ),
    RigKind(
        "VRM, VRoid",
        (
            "> Root@ground, J_Bip_C_Hips@pelvis, J_Bip_C_Spine@spine1, J_Bip_C_Chest@spine3, "
            "J_Bip_C_UpperChest@spine4, J_Bip_C_Neck@neck, J_Bip_C_Head@head",
            "J_Bip_C_Head > J_Sec_Hair1_01@top, J_Sec_Hair2_01@ground",
            "J_Bip_C_Hips > J_Bip_{s}_UpperLeg@hip, J_Bip_{s}_LowerLeg@knee, J_Bip_{s}_Foot@ankle, "
            "J_Bip_{s}_ToeBase@ball",
            "J_Bip_C_UpperChest > J_Bip_{s}_Shoulder@collar, J_Bip_{s}_UpperArm@shoulder, "
            "J_Bip_{s}_LowerArm@elbow, J_Bip_{s}_Hand@wrist",
        ),
        ("L", "R"),
        fingers="J_Bip_{s}_{f}{k}",
        finger_names=("Thumb", "Index", "Middle", "Ring", "Little"),
        tails="up",
        turned=180,
        height=0.8,
    ),
    RigKind(
        "MMD",
        (
            "> 全ての親@ground, センター@low, グルーブ@low, 腰@root, 下半身@pelvis",
            "腰 > 上半身@spine1, 上半身2@spine3, 首@neck, 頭@head",
            "下半身 > {s}足@hip, {s}ひざ@knee, {s}足首@ankle, {s}つま先@ball",
            "下半身 > {s}足D@hip, {s}ひざD@knee, {s}足首D@ankle, {s}足先EX@ball",
            "全ての親 > {s}足IK親@ground, {s}足ＩＫ@ankle, {s}つま先ＩＫ@ball",
            "上半身2 > {s}肩P@collar, {s}肩@collar, {s}肩C@shoulder0, {s}腕@shoulder, "
            "{s}腕捩@arm2, {s}ひじ@elbow, {s}手捩@fore2, {s}手首@wrist",
        ),
        ("左", "右"),
        arms_down=37,
        tails="random",
    ),
    RigKind(
        "MMD, English",
        (
            "> mother@ground, center@low, lower body@pelvis",
            "center > upper body@spine1, upper body2@spine3, neck@neck, head@head",
            "lower body > leg_{s}@hip, knee_{s}@knee, ankle_{s}@ankle, toe_{s}@ball",
            "mother > leg IK_{s}@ankle, toe IK_{s}@ball",
            "upper body2 > shoulder_{s}@collar, arm_{s}@shoulder, arm twist_{s}@arm2, "
            "elbow_{s}@elbow, hand twist_{s}@fore2, wrist_{s}@wrist",
        ),
        ("L", "R"),
        arms_down=37,
        height=0.95,
    ),
    RigKind(
        "Character Creator 4",
        (
            "> CC_Base_BoneRoot@ground, CC_Base_Hip@root, CC_Base_Pelvis@pelvis",
            "CC_Base_Hip > CC_Base_Waist@spine1, CC_Base_Spine01@spine2, CC_Base_Spine02@spine4, "
            "CC_Base_NeckTwist01@neck, CC_Base_NeckTwist02@neck2, CC_Base_Head@head",
            "CC_Base_Pelvis > CC_Base_{s}_Thigh@hip, CC_Base_{s}_Calf@knee, "
            "CC_Base_{s}_Foot@ankle, CC_Base_{s}_ToeBase@ball",
            "CC_Base_{s}_Thigh > CC_Base_{s}_ThighTwist01@hip, CC_Base_{s}_ThighTwist02@thigh2",
            "CC_Base_{s}_Calf > CC_Base_{s}_KneeShareBone@knee",
            "CC_Base_Spine02 > CC_Base_{s}_Clavicle@collar, CC_Base_{s}_Upperarm@shoulder, "
            "CC_Base_{s}_Forearm@elbow, CC_Base_{s}_Hand@wrist",
        ),
        ("L", "R"),
        fingers="CC_Base_{s}_{f}{k}",
        finger_names=("Thumb", "Index", "Mid", "Ring", "Pinky"),
        arms_down=30,
        unit=0.01,
        tails="up",
        other_armature=True,
    ),
    RigKind(
        "Xsens MVN",
        (
            "> Pelvis@pelvis, L5@spine1, L3@spine2, T12@spine3, T8@spine4, Neck@neck, Head@head",
            "Pelvis > {s}UpperLeg@hip, {s}LowerLeg@knee, {s}Foot@ankle, {s}Toe@ball",
            "T8 > {s}Shoulder@collar, {s}UpperArm@shoulder, {s}ForeArm@elbow, {s}Hand@wrist",
        ),
        turned=-90,
        tails="random",
    ),
    RigKind(
        "Roblox R15",
        (
            "> HumanoidRootPart@root, LowerTorso@pelvis, UpperTorso@spine1, Head@neck",
            "LowerTorso > {s}UpperLeg@hip, {s}LowerLeg@knee, {s}Foot@ankle",
            "UpperTorso > {s}UpperArm@shoulder, {s}LowerArm@elbow, {s}Hand@wrist",
        ),
        arms_down=85,
        rigid=True,
        lift=0.4,
        height=0.9,
    ),
    RigKind(
        "Unity humanoid",
        (
            "> Hips@pelvis, Spine@spine1, Chest@spine3, UpperChest@spine4, Neck@neck, Head@head",
            "Hips > {s}UpperLeg@hip, {s}LowerLeg@knee, {s}Foot@ankle, {s}Toes@ball",
            "UpperChest > {s}Shoulder@collar, {s}UpperArm@shoulder, {s}LowerArm@elbow, "
            "{s}Hand@wrist",
        ),
        fingers="{s} {f} {k}",
        finger_names=("Thumb", "Index", "Middle", "Ring", "Little"),
        phalanges=("Proximal", "Intermediate", "Distal"),
        arms_down=70,
        lift=-0.05,
        tails="deep",
    ),
    RigKind(
        "3ds Max Biped",
        (
            "> Bip01@pelvis, Bip01 Pelvis@pelvis, Bip01 Spine@spine1, Bip01 Spine1@spine2, "
            "Bip01 Spine2@spine4, Bip01 Neck@neck, Bip01 Head@head, Bip01 HeadNub@top",
            "Bip01 Pelvis > Bip01 {s} Thigh@hip, Bip01 {s} Calf@knee, Bip01 {s} Foot@ankle, "
            "Bip01 {s} Toe0@ball, Bip01 {s} Toe0Nub@toe",
            "Bip01 Neck > Bip01 {s} Clavicle@collar, Bip01 {s} UpperArm@shoulder, "
            "Bip01 {s} Forearm@elbow, Bip01 {s} Hand@wrist",
        ),
        ("L", "R"),
        arms_down=60,
        tails="random",
    ),
    RigKind(
        "Advanced Skeleton",
        (
            "> Group|Root_M@pelvis, Group|Spine1_M@spine1, Group|Chest_M@spine4, "
            "Group|Neck_M@neck, Group|Head_M@head, Group|HeadEnd_M@top",
            "Group|Root_M > Group|Hip_{s}@hip, Group|Knee_{s}@knee, Group|Ankle_{s}@ankle, "
            "Group|Toes_{s}@ball, Group|ToesEnd_{s}@toe",
            "Group|Chest_M > Group|Scapula_{s}@collar, Group|Shoulder_{s}@shoulder, "
            "Group|Elbow_{s}@elbow, Group|Wrist_{s}@wrist, Group|MiddleFinger1_{s}@middle1",
        ),
        ("L", "R"),
        tails="up",
    ),
    RigKind(
        "CMU",
        (
            "> root@pelvis, lowerback@spine1, upperback@spine3, thorax@spine4, lowerneck@neck, "
            "upperneck@neck2, head@head",
            "root > {s}hipjoint@pelvis, {s}femur@hip, {s}tibia@knee, {s}foot@ankle, {s}toes@ball",
            "thorax > {s}clavicle@collar, {s}humerus@shoulder, {s}radius@elbow, {s}wrist@wrist, "
            "{s}hand@middle1",
        ),
        ("l", "r"),
        tails="random",
    ),
)
