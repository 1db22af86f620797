# SPDX-License-Identifier: GPL-3.0-or-later
"""Simplified Chinese."""

from .operators.zh import OPERATORS as OPERATORS
from .options.zh import OPTIONS
from .stages.zh import STAGES

TEXTS = (
    STAGES
    | OPTIONS
    | {
        "'{action}' is an asset of this file; save the file in an asset "
        "library": "“{action}”是此文件的资产；请将文件保存到资产库中",
        "'{action}' is now an asset": "“{action}”现为资产",
        "'{mesh}' is linked from {file}, so its keyframes would not be saved in this file: make it "
        "local": "“{mesh}”链接自 {file}，其关键帧不会保存在此文件中：请使其本地化",
        "'{mesh}' is now animated by the action '{action}'": "“{mesh}”现由动作“{action}”驱动",
        "'{name}' has no action; choose one in the Action Editor": "“{name}”没有动作；请在动作编辑器中选择",
        "'{name}' is linked from {file}: make it local": "“{name}”链接自 {file}：请转为本地项",
        "'{name}' or its motion is linked from {file}, so changes would be lost: make both local "
        "(Object > Relations > Make Local > All) or edit them in that "
        "file": "“{name}”或其动作链接自 {file}，更改将会丢失：请将两者都转为本地项（物体 > 关系 > 转为本地项 > 全部），或在该文件中编辑",
        "'{rig}' is linked from {file}, so its motion would not be saved in this file: make an "
        "override of it (Object > Library Override > "
        "Make)": "“{rig}”链接自 {file}，其动作不会保存在此文件中：请为其创建库重写（物体 > 库重写 > 创建）",
        "'{rig}' is not in the scene's view layer: add it to the scene, or enable its collection "
        "in the Outliner": "“{rig}”不在场景的视图层中：请将其添加到场景，或在大纲视图中启用其集合",
        "'{rig}' is now animated by the action '{action}'": "“{rig}”现由动作“{action}”驱动",
        "'{rig}' is now animated by the action '{action}', with positions on the floor scaled by "
        "{scale:.3f}": "“{rig}”现由动作“{action}”驱动，地面位置按 {scale:.3f} 缩放",
        "'{strip}' is now a strip of {armature}'s NLA; to edit its keys, enter Tweak Mode (key "
        "Tab)": "“{strip}”现为 {armature} 的 NLA 片段；要编辑其关键帧，请进入调整模式（Tab 键）",
        "0 keeps every frame as captured, 1 is the default of a capture, higher values smooth "
        "more": "0 保持每帧的捕捉结果，1 为捕捉默认值，值越大平滑越强",
        "35 mm Equivalent": "35 mm 等效",
        "35 mm equivalent focal length in millimetres; a phone's main camera has about "
        "26": "35 mm 等效焦距（毫米）；手机主摄像头约为 26",
        "A camera is in use; wait for it or stop it": "相机正在使用中；请等待或停止",
        "A camera of this computer": "本机的摄像头",
        "A capture is running; wait for it or cancel it": "正在捕捉；请等待或取消",
        "A network camera or another stream": "网络摄像机或其他流",
        "A supported GPU if there is one, otherwise the CPU": "有受支持的 GPU 时使用 GPU，否则使用 CPU",
        "A video that is played in real time": "实时播放的视频",
        "Active": "活动项",
        "Add": "添加",
        "Add an entry": "添加一项",
        "Add an entry to the bone map, or remove the selected one": "向骨骼映射添加一项，或移除选中项",
        "Add an entry to the expression map, or remove the selected one": "向表情映射添加条目，或移除所选条目",
        "Add the capture settings as a preset, or remove a preset": "将捕捉设置添加为预设，或移除预设",
        "Add the footage with its sound to the video sequencer, synchronized with the "
        "motion": "将素材及其声音添加到视频序列编辑器，与动作同步",
        "Address": "地址",
        "Address of the stream, such as rtsp://192.168.1.20/stream; name and password in it are "
        "kept until Blender ends, and never "
        "saved": "流的地址，例如 rtsp://192.168.1.20/stream；其中的用户名和密码保留到 Blender 结束，绝不保存",
        "All four limbs": "双臂和双腿",
        "All in the Scene": "场景中全部",
        "An NVIDIA GPU": "NVIDIA GPU",
        "An NVIDIA GPU with TensorRT, which takes minutes to compile each network on first "
        "use": "使用 TensorRT 的 NVIDIA GPU，首次使用时编译每个网络需要数分钟",
        "An empty carries position and heading, the rig moves relative to "
        "it": "空物体承载位置和朝向，骨架绑定相对其运动",
        "An empty on the floor carries the root motion": "地面上的空物体承载根运动",
        "Angle": "角度",
        "Any GPU on Windows": "Windows 上的任意 GPU",
        "Apple silicon": "Apple 芯片",
        "Armature to animate with the captured motion": "要用捕捉动作驱动的骨架",
        "Arms": "手臂",
        "Arms Exchanged": "手臂已互换",
        "Arms and Legs": "手臂和腿",
        "Query the camera's formats, without taking an image. macOS may ask for "
        "permission": "询问相机支持的格式，不会拍摄画面。macOS 可能会询问是否允许使用相机",
        "Querying the camera": "正在询问相机",
        "Assign the face's shape keys, named as by ARKit, Oculus or VRM, or the controls of a "
        "known rig to expressions": "将面部的形态键(按 ARKit、Oculus 或 VRM 命名)或已知骨架的控制器对应到表情",
        "Assign the rig's bones to body parts by their names and rest "
        "pose": "根据名称和静置姿态，将绑定的骨骼分配给身体部位",
        "Author": "作者",
        "Automatic": "自动",
        "Balanced": "均衡",
        "Best": "最佳",
        "Blend": "混合",
        "Body": "身体",
        "Body File": "身体文件",
        "Body Part": "身体部位",
        "Body with Hands": "带手的身体",
        "Bone": "骨骼",
        "Bone of your rig": "您的绑定中的骨骼",
        "Choose the file in the file browser": "在文件浏览器中选择文件",
        "Cache Folder": "缓存文件夹",
        "Cache Size": "缓存大小",
        "Camera": "摄像机",
        "Camera (-Y)": "摄像机 (-Y)",
        "Cancel the capture; the scene stays unchanged": "取消捕捉；场景保持不变",
        "Cancel the live capture; the scene stays unchanged, and nothing is "
        "recorded": "取消实时捕捉；场景保持不变，也不录制任何内容",
        "Capture": "捕捉",
        "Capture Presets": "捕捉预设",
        "Capture cancelled; the scene is unchanged": "捕捉已取消；场景未改变",
        "Capture finished": "捕捉完成",
        "Capture motion from video, and view, edit, retarget and export captured "
        "motion": "从视频捕捉动作，并查看、编辑、重定向和导出捕捉的动作",
        "Leave the fingers at rest": "手指保持静止姿势",
        "Capture hands that are large enough in the image to be read": "捕捉画面中足够大的手",
        "Capture hands of all sizes": "捕捉任何大小的手",
        "Off": "关",
        "On": "开",
        "Capture the person in the footage as an animated body, while Blender stays "
        "usable": "将素材中的人物捕捉为动画身体，期间 Blender 仍可使用",
        "Capture whose result the panel shows": "面板显示其结果的捕捉",
        "Capture with Scope": "用 Scope 捕捉",
        "Captured Body": "捕捉的身体",
        "Captured Motion (Mocap)": "捕捉的动作 (Mocap)",
        "Captured Motion as {format} (.{suffix})": "捕捉的动作存为 {format} (.{suffix})",
        "Captured expression that this entry follows": "此条目所跟随的捕捉表情",
        "Captured from {source}, {seconds:.1f} s": "捕捉自 {source}，{seconds:.1f} 秒",
        "Captures": "捕捉",
        "Catalog": "编录",
        "Catalog of the Asset Browser, such as Motions/Walks; unassigned if left "
        "empty": "资产浏览器的编录，例如 动作/行走；留空则不分配",
        "Centimetres": "厘米",
        "Channel": "通道",
        "Choose a mesh with shape keys, or a rig with face controls, "
        "first": "请先选择带形态键的网格，或带面部控制器的骨架",
        "Choose a video or image first": "请先选择视频或图像",
        "Choose a video or image of a person": "选择人物的视频或图像",
        "Choose where the person's root motion is stored": "选择人物根运动的存储位置",
        "Choose your rig first": "请先选择您的绑定",
        "Compare with Footage first": "请先与素材对比",
        "Compiling the solver in the background, {percent:.0f} %": "正在后台编译解算器，{percent:.0f} %",
        "Confidence": "置信度",
        "Confidence of the guess": "猜测的置信度",
        "Corrections": "修正",
        "Countdown (s)": "倒计时 (s)",
        "Counted from 0; -1 removes all": "从 0 开始计数；-1 移除全部",
        "Custom SMPL, SMPL+H, SMPL-X or STAR model, for scenes without a body file of their "
        "own": "自定义 SMPL、SMPL+H、SMPL-X 或 STAR 模型，用于没有自己身体文件的场景",
        "Custom detector (.onnx): YOLOX, YOLOv4, YOLOv8 and similar; built-in if "
        "empty": "自定义检测器 (.onnx)：YOLOX、YOLOv4、YOLOv8 等；为空则使用内置",
        "Custom keypoint network (.onnx): RTMPose, HRNet, ViTPose and similar; built-in if "
        "empty": "自定义关键点网络 (.onnx)：RTMPose、HRNet、ViTPose 等；为空则使用内置",
        "Cycle of {seconds:.2f} s; before closing, its ends were {distance:.1f} cm "
        "apart": "循环长 {seconds:.2f} 秒；闭合前两端相距 {distance:.1f} cm",
        "Description": "描述",
        "Description of the asset; the footage and its duration if left empty": "资产的描述；留空则为素材及其时长",
        "Details": "详情",
        "Direction": "方向",
        "Direction of the scene in which the view looks": "视图在场景中的朝向",
        "Drag a handle to where the joint is.  Scrub or play to go to other frames.  Esc or Enter: "
        "done": "将手柄拖到关节所在位置。  拖动时间线或播放以转到其他帧。  Esc 或回车：完成",
        "Drag handles on the body to where the joints are in this frame; the motion around is "
        "solved again": "将身体上的手柄拖到此帧中关节的位置；其前后的动作会重新解算",
        "Draw a line along something upright: a door or post in the footage, or a standing person "
        "in a side view.  Esc: cancel": "沿竖直物体画一条线：素材中的门或柱子，侧面视图中站立的人。  Esc：取消",
        "Draw a line along something upright, in the footage or a side view; it rotates the "
        "capture and its camera": "在素材中或从侧面沿竖直物体画一条线；捕捉及其摄像机随之旋转",
        "Duration in seconds, at the end of the cycle, over which it is closed": "循环末尾用于闭合的时长（秒）",
        "End": "结束",
        "Enter the 35 mm equivalent focal length": "输入 35 mm 等效焦距",
        "Enter the field of view along the longer side of the image": "输入沿图像长边的视野",
        "Every capture of the scene, with all its people": "场景的每个捕捉及其所有人物",
        "Everyone": "所有人",
        "Everyone who is clearly visible": "所有清晰可见的人物",
        "Exchange left and right from the first to the last frame; applying it again undoes "
        "it": "从首帧到末帧互换左右；再次执行即可撤销",
        "Execution provider for the networks; if unavailable, the CPU is used and the result shows "
        "a warning": "网络的执行后端；不可用时使用 CPU，并在结果中显示警告",
        "Export": "导出",
        "Export the estimated camera": "导出估算的摄像机",
        "Expression": "表情",
        "Face": "面部",
        "Factor": "系数",
        "Fast": "快速",
        "Feet on the Floor": "双脚贴地",
        "File": "文件",
        "File per Person": "每人一个文件",
        "Find the best cycle within a span of frames, close it, and repeat "
        "it": "在帧范围内寻找最佳循环，将其闭合并重复",
        "First frame of the span": "范围的首帧",
        "Floor": "地面",
        "Folder for captured motion, so the same footage is not captured twice; if empty, "
        "Blender's user folder": "已捕捉动作的文件夹，避免重复捕捉；为空则使用 Blender 的用户文件夹",
        "Foot": "脚",
        "Footage": "素材",
        "Footage Opacity": "素材不透明度",
        "For Omniverse, Houdini and other studio tools": "用于 Omniverse、Houdini 等制作工具",
        "For Unreal Engine, Unity, Maya and MotionBuilder: armature, mesh and "
        "animation": "用于 Unreal Engine、Unity、Maya 和 MotionBuilder：骨架、网格和动画",
        "For engines that limit morph targets to 0..1": "用于将变形目标限制在 0..1 的引擎",
        "For research: SMPL-style arrays of the captured motion before any editing, one file per "
        "person": "用于研究：编辑前捕捉动作的 SMPL 格式数组，每人一个文件",
        "For the web, Godot and other engines: one .glb file with "
        "everything": "用于 Web、Godot 等引擎：一个包含全部内容的 .glb 文件",
        "Formats of captured motion": "捕捉动作的格式",
        "Forward": "前",
        "Found {count} bone; check the list": "找到 {count} 根骨骼；请检查列表",
        "Found {count} bones; check the list": "找到 {count} 根骨骼；请检查列表",
        "Found {count} controls; check the list": "找到 {count} 个控制器；请检查列表",
        "Found {count} shape key; check the list": "找到 {count} 个形态键；请检查列表",
        "Found {count} shape keys; check the list": "找到 {count} 个形态键；请检查列表",
        "Frame": "帧",
        "Frame rate of the keys; 0: one key on each frame of the scene": "关键帧的帧率；0：场景每帧一个关键帧",
        "Freed {size}": "已释放 {size}",
        "From File": "来自文件",
        "Gigabytes of captured motion to keep; the least recently used is removed "
        "first": "保留的已捕捉动作的 GB 数；最久未使用的最先移除",
        "Go to the frame that the warning is about": "转到警告所指的帧",
        "Hands": "手",
        "Head": "头",
        "Height of the most prominent person in centimetres; sets the scale of the scene. 0: "
        "estimated from the footage, for adults usually within 10 %; enter that of a "
        "child": "最显著人物的身高（厘米）；决定场景的缩放。0：根据素材估算，成人的误差通常在 10 % 以内；儿童的身高请输入",
        "Height {heights}": "身高 {heights}",
        "Hide": "隐藏",
        "Hide the captured person, except when comparing with the footage": "隐藏捕捉的人物，与素材对比时除外",
        "How a control follows the expression, along the axes of the rig's "
        "face": "控制器如何沿骨架面部的轴跟随表情",
        "How the body's shape is exported": "身体形状的导出方式",
        "How the captured person is shown after retargeting": "重定向后捕捉人物的显示方式",
        "Import Motion with Scope": "用 Scope 导入动作",
        "Import captured motions of Scope, AMASS or other tools that use SMPL's joints, as "
        "animated bodies": "将 Scope、AMASS 或其他使用 SMPL 关节的工具的动作导入为动画身体",
        "Imported {files}": "已导入 {files}",
        "In Bones": "骨骼",
        "In Place": "原地",
        "In the Bones": "骨骼",
        "In the Image": "图像内",
        "In the Mesh": "网格内",
        "In this frame, a foot rests on the floor: move the capture and its camera up or down "
        "until it does": "此帧中有一只脚踩在地面上：上下移动捕捉及其摄像机，直到踩实",
        "Include the rotation about the vertical axis in the root motion": "在根运动中包含绕竖直轴的旋转",
        "Interpolated": "已插值",
        "It has run for {time}. The scene stays unchanged": "已运行 {time}。场景保持不变",
        "It reports no formats": "相机未提供格式",
        "Joints ± {sigma:.1f} cm (standard deviation, median)": "关节 ± {sigma:.1f} cm（标准差，中位数）",
        "Joint": "关节",
        "Keep": "保持",
        "Keep Footage": "保留素材",
        "Keep a foot in place on the floor from the first to the last frame": "从首帧到末帧将一只脚固定在地面上",
        "Keep at Most (GB)": "最多保留 (GB)",
        "Record the motion from now on; Stop writes it as keyframes": "从现在起录制动作；停止时写为关键帧",
        "Keys": "关键帧",
        "Keys per Second": "每秒关键帧数",
        "Largest network, most accurate": "最大的网络，最精确",
        "Last Frame": "末帧",
        "Last frame of the span, inclusive": "范围的末帧（含）",
        "Least Movement": "最小运动",
        "Leave the scene's frame rate; one key on each of its frames": "保持场景帧率；场景每帧一个关键帧",
        "Leave the scene's frame rate; the motion keeps its speed, with keys between "
        "frames": "保持场景帧率；动作速度不变，关键帧可位于帧之间",
        "Left": "左",
        "Left Ankle": "左脚踝",
        "Left Elbow": "左肘",
        "Left Foot": "左脚",
        "Left Foot Stands": "左脚站立",
        "Left Hip": "左髋",
        "Left Knee": "左膝",
        "Left Shoulder": "左肩",
        "Left Wrist": "左手腕",
        "Legs": "腿",
        "Legs Exchanged": "腿已互换",
        "Lens": "镜头",
        "Lens: {lens}": "镜头：{lens}",
        "Continue the capture": "让捕捉继续进行",
        "Make a captured body follow the person in front of the camera until the capture is "
        "stopped": "让捕捉的身体跟随摄像机前的人，直到停止",
        "Make the rig of the Retarget section follow as well": "让重定向部分的绑定也跟随",
        "Level the World": "校平世界",
        "Lift Sunken Feet": "抬起陷入的脚",
        "Limbs": "四肢",
        "Live": "实时",
        "Live capture cancelled; the scene is unchanged": "实时捕捉已取消；场景未改变",
        "Live capture needs Blender's window; in a shell, use "
        "./scripts/live": "实时捕捉需要 Blender 的窗口；在终端中请使用 ./scripts/live",
        "Live capture recorded": "实时捕捉已录制",
        "Live capture stopped": "实时捕捉已停止",
        "Load a bone map from a JSON file": "从 JSON 文件加载骨骼映射",
        "Load an expression map from a JSON file": "从 JSON 文件加载表情映射",
        "Loaded {file}": "已加载 {file}",
        "Location": "位置",
        "Lock feet that are in contact, scaled to the rig, and keep them above the "
        "floor": "按绑定的大小锁定接触地面的脚，并使其保持在地面之上",
        "Lower Foot": "较低的脚",
        "Mark the captured motion as an asset with a preview image of its pose, for other files' "
        "Asset Browser": "将捕捉的动作标记为带姿态图片的资产，以便通过资产浏览器在其他文件中使用",
        "Maximum position error of the pelvis in millimetres": "骨盆的最大位置误差（毫米）",
        "Maximum rotation error of a bone in degrees": "骨骼的最大旋转误差（度）",
        "Mean distance in metres by which the joints must move within the cycle; 0 also loops a "
        "person who stays still": "循环内关节至少移动的平均距离（米）；0 也允许静止的人物循环",
        "Mesh with shape keys, or rig whose bones move its face, to animate with the captured "
        "expressions": "要用捕捉的表情驱动的带形态键的网格，或由骨骼驱动面部的骨架",
        "Metres": "米",
        "Minimum duration of the cycle in seconds": "循环的最短时长（秒）",
        "Morph targets whose values are the shape coefficients": "值为形状系数的变形目标",
        "Motion Capture": "动作捕捉",
        "Motion capture: animate a body with the motion of the person in a video or "
        "image": "动作捕捉：用视频或图像中人物的动作驱动身体",
        "Move the motion to a new track of the Nonlinear Animation editor, where takes are mixed "
        "and repeated": "将动作移到非线性动画编辑器的新轨道，以便混合和重复镜次",
        "Moves forward, relative to mouth width, eye distance or lid gap": "向前移动；以嘴宽、眼距、眼睑间距为单位",
        "Moves to the person's left, relative to mouth width, eye distance or lid "
        "gap": "向人物左侧移动；以嘴宽、眼距、眼睑间距为单位",
        "Moves up, relative to mouth width, eye distance or lid gap": "向上移动；以嘴宽、眼距、眼睑间距为单位",
        "My Rig": "我的绑定",
        "Name": "名称",
        "Name of the capture's collection": "捕捉集合的名称",
        "Name of the joint's bone": "关节的骨骼名称",
        "Name of the preset, used to make the path name": "预设名称，用于生成路径名",
        "Networks on {processor}": "网络运行于 {processor}",
        "New name of the take": "镜次的新名称",
        "No root motion: the character stays in place": "无根运动：角色留在原地",
        "No root motion: the person stays in place": "无根运动：人物留在原地",
        "No shape keys: the shape is applied to the mesh, for engines that limit shape keys to "
        "0..1": "无形态键：形状应用到网格，用于将形态键限制在 0..1 的引擎",
        "Nobody is seen": "看不到任何人",
        "Not seen for a moment": "暂时看不到",
        "No image from the source for {seconds:.0f} s": "已有 {seconds:.0f} 秒没有收到来源的画面",
        "Number": "数量",
        "Number of the camera, 0 for the first; on Linux also its device, such as "
        "/dev/video2": "摄像头的编号，第一个为 0；在 Linux 上也可以是设备，例如 /dev/video2",
        "On Object": "物体",
        "On an Object": "物体",
        "One": "一人",
        "One unit is a centimetre, as most tools expect": "一个单位为一厘米，符合大多数工具",
        "One unit is a metre": "一个单位为一米",
        "Only the arms": "仅手臂",
        "Only the legs": "仅腿",
        "Only the motion of the skeleton, one file per person": "仅骨架的动作，每人一个文件",
        "Open the guide, which comes with Scope, in the web browser; the network is not "
        "used": "在网页浏览器中打开 Scope 附带的指南；不使用网络",
        "Options": "选项",
        "Overlap": "重叠",
        "Part of the captured body that this bone follows": "此骨骼所跟随的捕捉身体部位",
        "Pelvis": "骨盆",
        "Preview of Current Frame": "当前帧的预览图",
        "Pin a joint to a place in one frame, and solve the motion around it "
        "again": "在一帧中将关节钉在某处，并重新解算其前后的动作",
        "Pin the joint only in the camera's image; its distance from the camera is free, except "
        "the pelvis's": "仅在摄像机图像中钉住关节；除骨盆外，其与摄像机的距离不受限制",
        "Pitch": "俯仰",
        "Pixel of the footage, from its top left": "素材的像素，从左上角算起",
        "Play Scene": "播放场景",
        "Play the scene's animation from the First Frame while recording": "录制时从“首帧”开始播放场景的动画",
        "Point of the scene": "场景中的点",
        "Position": "位置",
        "Press Compare with Footage or switch to an orthographic side view; the line is drawn "
        "there": "请按“与素材对比”，或显示侧面的正交视图：线在那里绘制",
        "Put feet in contact on the floor, which is at the height of the armature's "
        "origin": "将接触地面的脚放到地面上，地面位于骨架原点的高度",
        "Quality": "品质",
        "Raise the frames in which a foot is below the floor": "抬高脚低于地面的帧",
        "Reach": "影响范围",
        "Read focal lengths, principal point and distortion from a calibration "
        "file": "从校准文件读取焦距、主点和畸变",
        "Read from the file's metadata if present, estimated otherwise": "从文件元数据读取（如有），否则估算",
        "Recorded: {seconds:.1f} s": "已录制：{seconds:.1f} 秒",
        "Reduced {before} key to {after}; maximum error {angle:.2f} degrees for bones, "
        "{distance:.1f} mm for "
        "joints": "关键帧由 {before} 精简为 {after}；最大误差：骨骼 {angle:.2f} 度，关节 {distance:.1f} mm",
        "Reduced {before} keys to {after}; maximum error {angle:.2f} degrees for bones, "
        "{distance:.1f} mm for "
        "joints": "关键帧由 {before} 精简为 {after}；最大误差：骨骼 {angle:.2f} 度，关节 {distance:.1f} mm",
        "Refine": "优化",
        "Remove": "移除",
        "Remove captured motion from the cache. Existing scenes and the compiled solver are not "
        "affected": "从缓存中移除已捕捉的动作。现有场景和已编译的解算器不受影响",
        "Remove keys within a maximum error": "在最大误差内移除关键帧",
        "Remove the correction and restore the motion around it": "移除修正；其前后的动作恢复为修正前的状态",
        "Remove the selected entry": "移除选中项",
        "Rename it with Object > Motion Capture > Rename Take": "重命名：物体 > 动作捕捉 > 重命名镜次",
        "Rename the capture with its objects and actions; exported animation has the same "
        "name": "重命名捕捉及其物体和动作；导出的动画使用相同名称",
        "Repeat": "重复",
        "Repeat the curves; each cycle starts where the previous one ended": "重复曲线；每个循环从上一个结束处开始",
        "Replace frames by an interpolation between the pose before and the pose after "
        "them": "用前后姿态之间的插值替换帧",
        "Replace the keys by keys at a constant frame rate": "用恒定帧率的关键帧替换现有关键帧",
        "Replaced {before} key by {after}": "已将 {before} 个关键帧替换为 {after} 个",
        "Replaced {before} keys by {after}": "已将 {before} 个关键帧替换为 {after} 个",
        "Reprojection error {pixels:.1f} px": "重投影误差 {pixels:.1f} px",
        "Resample to Scene": "按场景重采样",
        "Result": "结果",
        "Retarget": "重定向",
        "Rig": "绑定",
        "Rig Follows": "绑定跟随",
        "Right": "右",
        "Right Ankle": "右脚踝",
        "Right Elbow": "右肘",
        "Right Foot": "右脚",
        "Right Foot Stands": "右脚站立",
        "Right Hip": "右髋",
        "Right Knee": "右膝",
        "Right Shoulder": "右肩",
        "Right Wrist": "右手腕",
        "Roll": "翻滚",
        "Root Motion": "根运动",
        "Rotate the motion so that all foot contacts are level, after which the camera no longer "
        "matches": "旋转动作使所有脚部接触点处于同一水平面，之后摄像机不再匹配",
        "Rotation": "旋转",
        "Scale of positions on the floor. 0: the ratio of leg lengths, so that steps fit the rig. "
        "Several people who touch or meet need the same value for all their "
        "rigs": "地面上位置的比例。0：腿长之比，使步幅适合绑定。相互接触或相遇的人物，其所有绑定需要相同的值",
        "Show this capture": "显示此捕捉",
        "Save the bone map as a JSON file for similar rigs": "将骨骼映射保存为 JSON 文件，供类似绑定使用",
        "Save the expression map as a JSON file for similar faces": "将表情映射保存为 JSON 文件，供类似面部使用",
        "Saved {file}": "已保存 {file}",
        "Scene": "场景",
        "Scene frame": "场景帧",
        "Scope: {progress}   (Esc over the Scope panel to "
        "cancel)": "Scope：{progress}   （在 Scope 面板上按 Esc 取消）",
        "Seconds before and after the frame over which the correction fades out": "修正在该帧前后淡出的秒数",
        "Select a Captured Person": "请选择捕捉的人物",
        "Select the armature of a capture first": "请先选择捕捉的骨架",
        "Select the captured person whose face to retarget": "请选择要重定向其面部的捕捉人物",
        "Selected": "选中的",
        "Set Frame Range": "设置帧范围",
        "Set Scene Frame Rate": "设置场景帧率",
        "Set from Footage": "取自素材",
        "Set the scene to the motion's frame rate. Captures keep their speed, other animation "
        "keeps its frames": "将场景设为动作的帧率。捕捉保持原有速度，其他动画保持原有帧号",
        "Set the scene's frame rate to the footage's": "将场景帧率设为素材的帧率",
        "Set the scene's frame rate to the footage's unless something in the scene is "
        "animated": "将场景帧率设为素材的帧率，除非场景中已有动画",
        "Set the scene's frame rate to the motion's; otherwise keys may be between "
        "frames": "将场景帧率设为动作的帧率；否则关键帧可能位于帧之间",
        "Several people are captured: select the armature of the one whose motion to "
        "retarget": "捕捉了多个人物：请选择要重定向其动作的骨架",
        "Shape": "形状",
        "Shape Key": "形态键",
        "Shape Key or Control": "形态键或控制器",
        "Shape Keys": "形态键",
        "Shape Keys per Frame": "逐帧形态键",
        "Shape key of your mesh, or bone of your rig's face": "您网格的形态键，或您骨架面部的骨骼",
        "Shape keys, or in the mesh for formats whose readers limit shape "
        "keys": "形态键；对于读取时限制形态键的格式则在网格内",
        "Shortest": "最短",
        "Show both in the same place": "在同一位置显示两者",
        "Show both, the rig to the left of the captured person": "显示两者，绑定位于捕捉人物的左侧",
        "Show the captured body from its side in a second viewport, beside the one with the "
        "footage": "在素材旁的第二个视图中，从侧面显示捕捉的身体",
        "Show the pose of the current frame in the preview image, instead of the first one that "
        "needs no review": "在图片中显示当前帧的姿态，而不是首个无需检查的姿态",
        "Side by Side": "并排",
        "Sides Exchanged": "左右已互换",
        "Slightly less accurate than Best, and faster": "精度略低于“最佳”，速度更快",
        "Smallest network: for a first look or a slow computer": "最小的网络：用于初步查看或较慢的电脑",
        "Smooth the captured motion again, more or less strongly. Keeps corrections, discards "
        "other changes": "以不同强度重新平滑捕捉的动作。保留修正，丢弃其他更改",
        "Source": "来源",
        "Start": "开始",
        "Stop the Capture?": "停止捕捉？",
        "Stop the live capture. What was recorded is written as keyframes; otherwise the last pose "
        "stays": "停止实时捕捉。录制的内容写为关键帧；否则保留最后的姿势",
        "Stream": "流",
        "Strength": "强度",
        "Swap the left and right limbs within a span of frames": "在帧范围内对调左右肢体",
        "Take": "镜次",
        "The axis along which the person is upright": "人物直立所沿的轴",
        "The body's shape as shape keys with one keyframe each": "将身体形状存为形态键，每个一个关键帧",
        "The built-in body with SMPL's 24 joints": "具有 SMPL 24 个关节的内置身体",
        "The built-in body with SMPL+H's 52 joints, fingers included": "具有 SMPL+H 52 个关节的内置身体，包括手指",
        "The capture does not say where its footage is": "此捕捉未记录素材的位置",
        "The capture is linked from {file}: make it local": "捕捉链接自 {file}：请转为本地项",
        "The capture that is selected in the panel, with all its people": "面板中选中的捕捉及其所有人物",
        "The capture that the active object belongs to": "活动物体所属的捕捉",
        "The captured person was deleted": "捕捉的人物已被删除",
        "The collection '{name}' is hidden; show it in the Outliner": "集合“{name}”已隐藏；请在大纲视图中显示",
        "The corrections put a foot up to {depth:.0f} cm under the floor: move the pin "
        "up": "修正使脚低于地面最多 {depth:.0f} 厘米：请将图钉上移",
        "The corrections put a foot up to {depth:.0f} cm under the floor in {count} of {total} "
        "frames: move the pin up": "修正使脚在 {total} 帧中的 {count} 帧里低于地面最多 {depth:.0f} 厘米：请将图钉上移",
        "The footage is already in the sequencer": "素材已在序列编辑器中",
        "The left foot": "左脚",
        "The lower one of the two in this frame": "此帧中两只脚里较低的一只",
        "The most prominent people, up to a number": "最显著的人物，不超过指定数量",
        "The most prominent person": "最显著的人物",
        "The pelvis moves through the scene": "骨盆在场景中移动",
        "The pelvis moves through the scene, as captured": "骨盆按捕捉结果在场景中移动",
        "The processor": "处理器",
        "The rig chosen under Retarget, with its current animation and its "
        "meshes": "“重定向”中选择的绑定，连同其当前动画和网格",
        "The right foot": "右脚",
        "The same, with a keyframe on every frame": "同上，每帧一个关键帧",
        "The scene contains no capture yet": "场景中尚无捕捉",
        "The scene contains no captured video or imported motion": "场景中没有已捕捉的视频或导入的动作",
        "The scene has no camera of a capture: capture with the option Camera with "
        "Footage": "场景中没有捕捉的摄像机：请启用“带素材的摄像机”选项进行捕捉",
        "The scene has {rate:.5g} frames/s, like the motion": "场景为 {rate:.5g} 帧/秒，与动作相同",
        "The scene has {rate:.5g} frames/s; animation that was not captured plays {factor:.3g} "
        "times as fast": "场景为 {rate:.5g} 帧/秒；非捕捉的动画以 {factor:.3g} 倍速播放",
        "The scene has {scene:.5g} frames/s and the footage {footage:.5g}: the strip will not stay "
        "synchronized with the motion": "场景为 {scene:.5g} 帧/秒，素材为 {footage:.5g}：片段将无法与动作保持同步",
        "The scene's frame rate was changed from {was:.5g} to {now:.5g}, which changed the "
        "motion's speed; importing an FBX file does "
        "that": "场景帧率已从 {was:.5g} 变为 {now:.5g}，动作速度也随之改变；导入 FBX 文件会导致这种情况",
        "This Blender was built without USD; use a build from blender.org, or another "
        "format": "此 Blender 构建不含 USD；请使用 blender.org 的版本或其他格式",
        "This motion was captured on uneven ground, where feet rest at any height: use Floor "
        "Here": "此动作捕捉于不平地面，双脚可停在任何高度：请使用“地面在此”",
        "Threads": "线程",
        "Toggle the view of the body over the footage. Sets the scene's camera and "
        "resolution": "切换身体叠加在素材上的视图。会设置场景的摄像机和分辨率",
        "Transfer the captured expressions to the mesh's shape keys or the rig's face, as a new "
        "action": "将捕捉的表情作为新动作传递到网格的形态键或骨架的面部",
        "Transfer the captured motion to your rig, as a new action. One of the same capture is "
        "replaced if unchanged": "将捕捉的动作作为新动作传递到您的绑定。同一次捕捉先前生成且未修改的动作会被替换",
        "Travel Scale": "移动比例",
        "Turn the capture and its camera so that a line in an orthographic view from a side is "
        "upright": "旋转捕捉及其摄像机，使侧面正交视图中的一条线竖直",
        "Turn the capture and its camera so that a line in the footage is "
        "upright": "旋转捕捉及其摄像机，使素材中的一条线竖直",
        "Turns down, in degrees": "向下转动，单位为度",
        "Turns to the person's left, in degrees": "向人物左侧转动，单位为度",
        "Turns with the left side up, in degrees": "左侧向上转动，单位为度",
        "Uneven Ground": "不平地面",
        "Upright Line": "竖直线",
        "Use the short clip that is included with Scope": "使用 Scope 自带的短片",
        "Use this in the viewport with the footage": "请在显示素材的视图中使用",
        "Value of a shape key": "形态键的值",
        "Value where the expression is 1: at most 10, or 180 degrees; several expressions add "
        "up": "表情为 1 时的值：最多 10，或 180 度；多个表情会相加",
        "Video": "视频",
        "Video of a person, which is played in real time": "一个人的视频，实时播放",
        "Video or image of a person to capture": "要捕捉的人物的视频或图像",
        "Wait until somebody is seen": "请等到有人出现",
        "Waiting for the source": "正在等待来源",
        "Warnings": "警告",
        "What to export": "要导出的内容",
        "Where the joint is in that frame": "关节在该帧中的位置",
        "Source of the images": "画面的来源",
        "Where the root motion is stored": "根运动的存储位置",
        "Where the root motion of the rig is stored": "绑定的根运动的存储位置",
        "Which foot rests on the floor": "哪只脚踩在地面上",
        "Which foot stands": "哪只脚站立",
        "Which limbs are exchanged": "互换哪些肢体",
        "Who made this asset": "此资产的作者",
        "With Heading": "包含朝向",
        "A foot is up to {depth:.0f} cm under this floor in {count} of {total} frames: press Floor "
        "Here in a frame in which it rests on the floor, or use Snap Feet to "
        "Floor": "按此地面，{total} 帧中有 {count} 帧的脚最多低于地面 {depth:.0f} cm：请在脚踩地的帧按“地面在此”，或使用“双脚吸附到地面”",
        "Write a separate file for each person": "为每个人物写出单独的文件",
        "Write captures to a file": "将捕捉写入文件",
        "Write the recorded images of a camera or stream as a video beside the .blend file, from "
        "which a more accurate motion of the same take can be "
        "captured": "将摄像头或流的已录制画面作为视频写入 .blend 文件旁边，可据此捕捉同一镜次的更精确动作",
        "Writing the recording": "正在写入录制",
        "Wrote {files} in {folder}": "已将 {files} 写入 {folder}",
        "Y points down, as in the camera's axes of pose estimation networks": "Y 向下，与姿态估计网络的摄像机轴相同",
        "Y points up, as in AIST++ and most engines": "Y 向上，与 AIST++ 和大多数引擎相同",
        "Yaw": "偏航",
        "Your own SMPL, SMPL+H, SMPL-X or STAR file": "您自己的 SMPL、SMPL+H、SMPL-X 或 STAR 文件",
        "Z points up, as in AMASS": "Z 向上，与 AMASS 相同",
        "removed": "已移除",
        "{count} bone": "{count} 根骨骼",
        "{count} bones": "{count} 根骨骼",
        "{count} entries": "{count} 个条目",
        "{count} entry": "{count} 个条目",
        "{count} frame": "{count} 帧",
        "{count} frames": "{count} 帧",
        "{count} people": "{count} 人",
        "{count} person": "{count} 人",
        "{frames}, captured in {time}": "{frames}，捕捉用时 {time}",
        "{joint} cannot reach the pin and stays {distance} away: move the pin closer, or pin the "
        "pelvis too": "{joint} 够不到图钉，仍相距 {distance}：请将图钉移近，或同时钉住骨盆",
        "{path} is not a file; choose a video or image": "{path} 不是文件；请选择视频或图像",
        "{rate:.0f} pose/s, latency {latency:.0f} ms": "{rate:.0f} 姿势/秒，延迟 {latency:.0f} 毫秒",
        "{rate:.0f} poses/s, latency {latency:.0f} ms": "{rate:.0f} 姿势/秒，延迟 {latency:.0f} 毫秒",
        "{size} of captures in {folder}": "{folder} 中有 {size} 的捕捉",
    }
)
