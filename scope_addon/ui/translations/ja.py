# SPDX-License-Identifier: GPL-3.0-or-later
"""Japanese."""

from .operators.ja import OPERATORS as OPERATORS
from .options.ja import OPTIONS
from .stages.ja import STAGES

TEXTS = (
    STAGES
    | OPTIONS
    | {
        "'{action}' is an asset of this file; save the file in an asset "
        "library": "'{action}' はこのファイルのアセットです。ファイルをアセットライブラリに保存してください",
        "'{action}' is now an asset": "'{action}' をアセットにしました",
        "'{mesh}' is linked from {file}, so its keyframes would not be saved in this file: make it "
        "local": "'{mesh}' は {file} からリンクされているため、キーフレームがこのファイルに保存されません。ローカル化してください",
        "'{mesh}' is now animated by the action "
        "'{action}'": "'{mesh}' はアクション '{action}' で動くようになりました",
        "'{name}' has no action; choose one in the Action "
        "Editor": "'{name}' にはアクションがありません。アクションエディターで選択してください",
        "'{name}' is linked from {file}: make it "
        "local": "'{name}' は {file} からリンクされています。ローカル化してください",
        "'{name}' or its motion is linked from {file}, so changes would be lost: make both local "
        "(Object > Relations > Make Local > All) or edit them in that "
        "file": "'{name}' またはそのモーションは {file} からリンクされているため、変更は失われます。両方をローカル化する（オブジェクト > 関係 > ローカル化 "
        "> すべて）か、元のファイルで編集してください",
        "'{rig}' is linked from {file}, so its motion would not be saved in this file: make an "
        "override of it (Object > Library Override > "
        "Make)": "'{rig}' は {file} からリンクされているため、モーションはこのファイルに保存されません。オーバーライドを作成してください（オブジェクト > "
        "ライブラリオーバーライド > 作成）",
        "'{rig}' is not in the scene's view layer: add it to the scene, or enable its collection "
        "in the Outliner": "'{rig}' はシーンのビューレイヤーにありません。シーンに追加するか、アウトライナーでコレクションを有効にしてください",
        "'{rig}' is now animated by the action '{action}'": "'{rig}' はアクション '{action}' で動くようになりました",
        "'{rig}' is now animated by the action '{action}', with positions on the floor scaled by "
        "{scale:.3f}": "'{rig}' はアクション '{action}' で動くようになりました（床面上の位置の倍率 {scale:.3f}）",
        "'{strip}' is now a strip of {armature}'s NLA; to edit its keys, enter Tweak Mode (key "
        "Tab)": "'{strip}' は {armature} の NLA ストリップになりました。キーの編集にはトウィークモードに入ってください（Tab キー）",
        "0 keeps every frame as captured, 1 is the default of a capture, higher values smooth "
        "more": "0 は各フレームをキャプチャのまま保持、1 はキャプチャの標準、大きいほど強くスムージングします",
        "35 mm Equivalent": "35mm 換算",
        "35 mm equivalent focal length in millimetres; a phone's main camera has about "
        "26": "35mm 換算の焦点距離（ミリメートル）。スマートフォンのメインカメラは約 26",
        "A camera is in use; wait for it or stop it": "カメラを使用中です。終わるまで待つか停止してください",
        "A camera of this computer": "このコンピューターのカメラ",
        "A capture is running; wait for it or cancel it": "キャプチャを実行中です。完了を待つかキャンセルしてください",
        "A network camera or another stream": "ネットワークカメラなどのストリーム",
        "A supported GPU if there is one, otherwise the CPU": "対応する GPU があれば使用し、なければ CPU",
        "A video that is played in real time": "リアルタイムで再生する動画",
        "Active": "アクティブ",
        "Add": "追加",
        "Add an entry": "項目を追加",
        "Add an entry to the bone map, or remove the selected one": "ボーンマップに項目を追加、または選択した項目を削除",
        "Add an entry to the expression map, or remove the selected "
        "one": "表情マップに項目を追加、または選択した項目を削除",
        "Add the capture settings as a preset, or remove a "
        "preset": "キャプチャ設定をプリセットとして追加、またはプリセットを削除",
        "Add the footage with its sound to the video sequencer, synchronized with the "
        "motion": "フッテージを音声ごと、モーションに同期させてビデオシーケンサーに追加",
        "Address": "アドレス",
        "Address of the stream, such as rtsp://192.168.1.20/stream; name and password in it are "
        "kept until Blender ends, and never "
        "saved": "ストリームのアドレス (例: rtsp://192.168.1.20/stream)。含まれるユーザー名とパスワードは Blender "
        "の終了まで保持され、保存されることはありません",
        "All four limbs": "両腕と両脚",
        "All in the Scene": "シーン内のすべて",
        "An NVIDIA GPU": "NVIDIA の GPU",
        "An NVIDIA GPU with TensorRT, which takes minutes to compile each network on first "
        "use": "TensorRT を使う NVIDIA の GPU。初回は各ネットワークのコンパイルに数分かかります",
        "An empty carries position and heading, the rig moves relative to "
        "it": "エンプティが位置と向きを持ち、リグはそれに対して動きます",
        "An empty on the floor carries the root motion": "床上のエンプティがルートモーションを持ちます",
        "Angle": "角度",
        "Any GPU on Windows": "Windows の任意の GPU",
        "Apple silicon": "Apple シリコン",
        "Armature to animate with the captured motion": "キャプチャしたモーションで動かすアーマチュア",
        "Arms": "腕",
        "Arms Exchanged": "左右の腕の入れ替え",
        "Arms and Legs": "腕と脚",
        "Query the camera's formats, without taking an image. macOS may ask for "
        "permission": "カメラに対応形式を問い合わせます。画像は撮影しません。macOS が使用の許可を求めることがあります",
        "Querying the camera": "カメラに問い合わせ中",
        "Assign the face's shape keys, named as by ARKit, Oculus or VRM, or the controls of a "
        "known rig to expressions": "ARKit、Oculus、VRM の名前を持つ顔のシェイプキー、または既知のリグのコントロールを表情に割り当て",
        "Assign the rig's bones to body parts by their names and rest "
        "pose": "名前とレストポーズから、リグのボーンを体の部位に割り当てます",
        "Author": "作者",
        "Automatic": "自動",
        "Balanced": "バランス",
        "Best": "最高",
        "Blend": "ブレンド",
        "Body": "ボディ",
        "Body File": "ボディファイル",
        "Body Part": "体の部位",
        "Body with Hands": "手付きボディ",
        "Bone": "ボーン",
        "Bone of your rig": "自分のリグのボーン",
        "Choose the file in the file browser": "ファイルブラウザーでファイルを選択します",
        "Cache Folder": "キャッシュフォルダー",
        "Cache Size": "キャッシュサイズ",
        "Camera": "カメラ",
        "Camera (-Y)": "カメラ（-Y）",
        "Cancel the capture; the scene stays unchanged": "キャプチャをキャンセル。シーンは変更されません",
        "Cancel the live capture; the scene stays unchanged, and nothing is "
        "recorded": "ライブキャプチャをキャンセルします。シーンは変更されず、何も記録されません",
        "Capture": "キャプチャ",
        "Capture Presets": "キャプチャのプリセット",
        "Capture cancelled; the scene is unchanged": "キャプチャをキャンセルしました。シーンは変更されていません",
        "Capture finished": "キャプチャが完了しました",
        "Capture motion from video, and view, edit, retarget and export captured "
        "motion": "動画からモーションをキャプチャし、キャプチャしたモーションを表示、編集、リターゲット、エクスポート",
        "Leave the fingers at rest": "指を静止姿勢のままにします",
        "Capture hands that are large enough in the image to be read": "画像内で十分に大きく写っている手をキャプチャします",
        "Capture hands of all sizes": "あらゆる大きさの手をキャプチャします",
        "Off": "オフ",
        "On": "オン",
        "Capture the person in the footage as an animated body, while Blender stays "
        "usable": "Blender を使い続けながら、フッテージの人物をアニメーション付きボディとしてキャプチャ",
        "Capture whose result the panel shows": "パネルに結果を表示するキャプチャ",
        "Capture with Scope": "Scope でキャプチャ",
        "Captured Body": "キャプチャしたボディ",
        "Captured Motion (Mocap)": "キャプチャしたモーション (Mocap)",
        "Captured Motion as {format} (.{suffix})": "キャプチャしたモーションを {format} で (.{suffix})",
        "Captured expression that this entry follows": "この項目が従うキャプチャした表情",
        "Captured from {source}, {seconds:.1f} s": "{source} からキャプチャ、{seconds:.1f} 秒",
        "Captures": "キャプチャ",
        "Catalog": "カタログ",
        "Catalog of the Asset Browser, such as Motions/Walks; unassigned if left "
        "empty": "アセットブラウザーのカタログ（例: モーション/歩行）。空の場合は未割り当て",
        "Centimetres": "センチメートル",
        "Channel": "チャンネル",
        "Choose a mesh with shape keys, or a rig with face controls, "
        "first": "先にシェイプキーのあるメッシュ、または顔のコントロールがあるリグを選択してください",
        "Choose a video or image first": "先に動画または画像を選択してください",
        "Choose a video or image of a person": "人物の動画または画像を選択",
        "Choose where the person's root motion is stored": "人物のルートモーションの保存先を選択",
        "Choose your rig first": "先に自分のリグを選択してください",
        "Compare with Footage first": "先にフッテージと比較してください",
        "Compiling the solver in the background, {percent:.0f} "
        "%": "ソルバーをバックグラウンドでコンパイル中、{percent:.0f} %",
        "Confidence": "信頼度",
        "Confidence of the guess": "推測の信頼度",
        "Corrections": "修正",
        "Countdown (s)": "カウントダウン (s)",
        "Counted from 0; -1 removes all": "0 から数えます。-1 ですべて削除",
        "Custom SMPL, SMPL+H, SMPL-X or STAR model, for scenes without a body file of their "
        "own": "独自のボディファイルがないシーン用の SMPL、SMPL+H、SMPL-X または STAR モデル",
        "Custom detector (.onnx): YOLOX, YOLOv4, YOLOv8 and similar; built-in if "
        "empty": "カスタム検出器（.onnx）：YOLOX、YOLOv4、YOLOv8 など。空の場合は内蔵",
        "Custom keypoint network (.onnx): RTMPose, HRNet, ViTPose and similar; built-in if "
        "empty": "カスタムキーポイントネットワーク（.onnx）：RTMPose、HRNet、ViTPose など。空の場合は内蔵",
        "Cycle of {seconds:.2f} s; before closing, its ends were {distance:.1f} cm "
        "apart": "周期 {seconds:.2f} 秒。閉じる前の両端の差は {distance:.1f} cm",
        "Description": "説明",
        "Description of the asset; the footage and its duration if left "
        "empty": "アセットの説明。空の場合はフッテージとその長さ",
        "Details": "詳細",
        "Direction": "方向",
        "Direction of the scene in which the view looks": "ビューが向いているシーン内の方向",
        "Drag a handle to where the joint is.  Scrub or play to go to other frames.  Esc or Enter: "
        "done": "ハンドルを関節の位置にドラッグ。  再生やスクラブで他のフレームへ移動。  Esc か Enter：終了",
        "Drag handles on the body to where the joints are in this frame; the motion around is "
        "solved again": "ボディのハンドルを、このフレームの関節の位置にドラッグします。前後のモーションは再計算されます",
        "Draw a line along something upright: a door or post in the footage, or a standing person "
        "in a side view.  Esc: "
        "cancel": "垂直なものに沿って線を引いてください。フッテージではドアや柱、横からのビューでは立っている人物です。  Esc：キャンセル",
        "Draw a line along something upright, in the footage or a side view; it rotates the "
        "capture and its camera": "フッテージ内または横から、垂直なものに沿って線を引きます。キャプチャとカメラがそれに合わせて回転します",
        "Duration in seconds, at the end of the cycle, over which it is "
        "closed": "周期の終わりでつなぎ合わせる時間（秒）",
        "End": "終了",
        "Enter the 35 mm equivalent focal length": "35mm 換算の焦点距離を入力",
        "Enter the field of view along the longer side of the image": "画像の長辺方向の視野角を入力",
        "Every capture of the scene, with all its people": "シーンのすべてのキャプチャと人物",
        "Everyone": "全員",
        "Everyone who is clearly visible": "はっきり見える人物全員",
        "Exchange left and right from the first to the last frame; applying it again undoes "
        "it": "最初から最後のフレームまで左右を入れ替えます。もう一度行うと元に戻ります",
        "Execution provider for the networks; if unavailable, the CPU is used and the result shows "
        "a warning": "ネットワークの実行プロバイダー。使用できない場合は CPU を使い、結果に警告を表示します",
        "Export": "エクスポート",
        "Export the estimated camera": "推定カメラをエクスポート",
        "Expression": "表情",
        "Face": "顔",
        "Factor": "係数",
        "Fast": "高速",
        "Feet on the Floor": "足を床に接地",
        "File": "ファイル",
        "File per Person": "人物ごとにファイル",
        "Find the best cycle within a span of frames, close it, and repeat "
        "it": "フレーム範囲から最適な周期を見つけ、閉じて繰り返します",
        "First frame of the span": "範囲の最初のフレーム",
        "Floor": "床",
        "Folder for captured motion, so the same footage is not captured twice; if empty, "
        "Blender's user folder": "同じものを二度キャプチャしないための、キャプチャ済みモーションのフォルダー。空の場合は Blender のユーザーフォルダー",
        "Foot": "足",
        "Footage": "フッテージ",
        "Footage Opacity": "フッテージの不透明度",
        "For Omniverse, Houdini and other studio tools": "Omniverse、Houdini などのスタジオツール用",
        "For Unreal Engine, Unity, Maya and MotionBuilder: armature, mesh and "
        "animation": "Unreal Engine、Unity、Maya、MotionBuilder 用：アーマチュア、メッシュ、アニメーション",
        "For engines that limit morph targets to 0..1": "モーフターゲットを 0..1 に制限するエンジン用",
        "For research: SMPL-style arrays of the captured motion before any editing, one file per "
        "person": "研究用：編集前のキャプチャモーションの SMPL 形式の配列。人物ごとに 1 ファイル",
        "For the web, Godot and other engines: one .glb file with "
        "everything": "Web、Godot などのエンジン用：すべてを含む 1 つの .glb ファイル",
        "Formats of captured motion": "キャプチャしたモーションの形式",
        "Forward": "前",
        "Found {count} bone; check the list": "{count} 本のボーンが見つかりました。リストを確認してください",
        "Found {count} bones; check the list": "{count} 本のボーンが見つかりました。リストを確認してください",
        "Found {count} controls; check the list": "{count} 個のコントロールが見つかりました。リストを確認してください",
        "Found {count} shape key; check the list": "{count} 個のシェイプキーが見つかりました。リストを確認してください",
        "Found {count} shape keys; check the list": "{count} 個のシェイプキーが見つかりました。リストを確認してください",
        "Frame": "フレーム",
        "Frame rate of the keys; 0: one key on each frame of the "
        "scene": "キーのフレームレート。0：シーンの各フレームにキーを 1 つ",
        "Freed {size}": "{size} を解放しました",
        "From File": "ファイルから",
        "Gigabytes of captured motion to keep; the least recently used is removed "
        "first": "保持するキャプチャ済みモーションのギガバイト数。最も長く使われていないものから削除されます",
        "Go to the frame that the warning is about": "警告の対象フレームに移動",
        "Hands": "手",
        "Head": "頭",
        "Height of the most prominent person in centimetres; sets the scale of the scene. 0: "
        "estimated from the footage, for adults usually within 10 %; enter that of a "
        "child": "最も目立つ人物の身長（センチメートル）。シーンのスケールを決めます。0：フッテージから推定、大人なら通常は誤差 10 % 以内。子供の身長は入力してください",
        "Height {heights}": "身長 {heights}",
        "Hide": "隠す",
        "Hide the captured person, except when comparing with the "
        "footage": "フッテージとの比較時以外、キャプチャした人物を隠す",
        "How a control follows the expression, along the axes of the rig's "
        "face": "コントロールがリグの顔の軸に沿って表情に従う方法",
        "How the body's shape is exported": "体型のエクスポート方法",
        "How the captured person is shown after retargeting": "リターゲット後のキャプチャした人物の表示方法",
        "Import Motion with Scope": "Scope でモーションをインポート",
        "Import captured motions of Scope, AMASS or other tools that use SMPL's joints, as "
        "animated bodies": "Scope、AMASS など SMPL の関節を使うツールのモーションを、アニメーション付きボディとしてインポート",
        "Imported {files}": "{files} をインポートしました",
        "In Bones": "ボーン",
        "In Place": "その場",
        "In the Bones": "ボーン",
        "In the Image": "画像内",
        "In the Mesh": "メッシュ内",
        "In this frame, a foot rests on the floor: move the capture and its camera up or down "
        "until it does": "このフレームで足が床に着いているとして、キャプチャとカメラを上下に移動します",
        "Include the rotation about the vertical axis in the root motion": "垂直軸まわりの回転をルートモーションに含める",
        "Interpolated": "補間",
        "It has run for {time}. The scene stays unchanged": "{time} 実行しています。シーンは変更されません",
        "It reports no formats": "対応形式は示されていません",
        "Joints ± {sigma:.1f} cm (standard deviation, median)": "関節 ± {sigma:.1f} cm（標準偏差、中央値）",
        "Joint": "関節",
        "Keep": "維持",
        "Keep Footage": "映像を残す",
        "Keep a foot in place on the floor from the first to the last "
        "frame": "最初から最後のフレームまで、足を床の同じ位置に固定",
        "Keep at Most (GB)": "最大保持量（GB）",
        "Record the motion from now on; Stop writes it as "
        "keyframes": "これ以降の動きを記録します。「停止」でキーフレームとして書き込みます",
        "Keys": "キー",
        "Keys per Second": "毎秒キー数",
        "Largest network, most accurate": "最大のネットワーク、最も正確",
        "Last Frame": "最後のフレーム",
        "Last frame of the span, inclusive": "範囲の最後のフレーム（含む）",
        "Least Movement": "最小の動き",
        "Leave the scene's frame rate; one key on each of its "
        "frames": "シーンのフレームレートを維持し、各フレームにキーを 1 つ打ちます",
        "Leave the scene's frame rate; the motion keeps its speed, with keys between "
        "frames": "シーンのフレームレートを維持します。モーションの速さは変わらず、キーはフレームの間にも置かれます",
        "Left": "左",
        "Left Ankle": "左足首",
        "Left Elbow": "左肘",
        "Left Foot": "左足",
        "Left Foot Stands": "左足を接地",
        "Left Hip": "左股関節",
        "Left Knee": "左膝",
        "Left Shoulder": "左肩",
        "Left Wrist": "左手首",
        "Legs": "脚",
        "Legs Exchanged": "左右の脚の入れ替え",
        "Lens": "レンズ",
        "Lens: {lens}": "レンズ：{lens}",
        "Continue the capture": "キャプチャを続行します",
        "Make a captured body follow the person in front of the camera until the capture is "
        "stopped": "停止するまで、カメラの前の人物にキャプチャしたボディを追従させます",
        "Make the rig of the Retarget section follow as well": "「リターゲット」セクションのリグも追従させます",
        "Level the World": "ワールドを水平に",
        "Lift Sunken Feet": "沈んだ足を上げる",
        "Limbs": "手足",
        "Live": "ライブ",
        "Live capture cancelled; the scene is unchanged": "ライブキャプチャをキャンセルしました。シーンは変更されていません",
        "Live capture needs Blender's window; in a shell, use "
        "./scripts/live": "ライブキャプチャには Blender のウィンドウが必要です。シェルでは ./scripts/live を使ってください",
        "Live capture recorded": "ライブキャプチャを記録しました",
        "Live capture stopped": "ライブキャプチャを停止しました",
        "Load a bone map from a JSON file": "JSON ファイルからボーンマップを読み込み",
        "Load an expression map from a JSON file": "JSON ファイルから表情マップを読み込み",
        "Loaded {file}": "{file} を読み込みました",
        "Location": "位置",
        "Lock feet that are in contact, scaled to the rig, and keep them above the "
        "floor": "接地した足をリグの大きさに合わせて固定し、床より上に保ちます",
        "Lower Foot": "低い方の足",
        "Mark the captured motion as an asset with a preview image of its pose, for other files' "
        "Asset Browser": "キャプチャしたモーションをポーズの画像付きでアセットとしてマークし、アセットブラウザーから他のファイルで使えるようにします",
        "Maximum position error of the pelvis in millimetres": "骨盤の最大位置誤差（ミリメートル）",
        "Maximum rotation error of a bone in degrees": "ボーンの最大回転誤差（度）",
        "Mean distance in metres by which the joints must move within the cycle; 0 also loops a "
        "person who stays still": "周期内で関節が動くべき平均距離（メートル）。0 では静止した人物もループします",
        "Mesh with shape keys, or rig whose bones move its face, to animate with the captured "
        "expressions": "キャプチャした表情で動かす、シェイプキーのあるメッシュ、またはボーンが顔を動かすリグ",
        "Metres": "メートル",
        "Minimum duration of the cycle in seconds": "周期の最短時間（秒）",
        "Morph targets whose values are the shape coefficients": "値が体型係数であるモーフターゲット",
        "Motion Capture": "モーションキャプチャ",
        "Motion capture: animate a body with the motion of the person in a video or "
        "image": "モーションキャプチャ：動画または画像の人物の動きでボディをアニメーション化",
        "Move the motion to a new track of the Nonlinear Animation editor, where takes are mixed "
        "and repeated": "モーションを NLA エディターの新しいトラックに移し、テイクを混合・リピートできるようにします",
        "Moves forward, relative to mouth width, eye distance or lid "
        "gap": "前へ移動。口の幅、両目の間隔、まぶたの開きに対する割合",
        "Moves to the person's left, relative to mouth width, eye distance or lid "
        "gap": "人物の左へ移動。口の幅、両目の間隔、まぶたの開きに対する割合",
        "Moves up, relative to mouth width, eye distance or lid gap": "上へ移動。口の幅、両目の間隔、まぶたの開きに対する割合",
        "My Rig": "自分のリグ",
        "Name": "名前",
        "Name of the capture's collection": "キャプチャのコレクションの名前",
        "Name of the joint's bone": "関節のボーン名",
        "Name of the preset, used to make the path name": "プリセットの名前。パス名の作成に使用",
        "Networks on {processor}": "ネットワーク：{processor}",
        "New name of the take": "テイクの新しい名前",
        "No root motion: the character stays in place": "ルートモーションなし：キャラクターはその場に留まります",
        "No root motion: the person stays in place": "ルートモーションなし：人物はその場に留まります",
        "No shape keys: the shape is applied to the mesh, for engines that limit shape keys to "
        "0..1": "シェイプキーなし：体型をメッシュに適用します。シェイプキーを 0..1 に制限するエンジン用",
        "Nobody is seen": "誰も映っていません",
        "Not seen for a moment": "一時的に見えていません",
        "No image from the source for {seconds:.0f} s": "{seconds:.0f} 秒間、ソースから画像が届いていません",
        "Number": "人数",
        "Number of the camera, 0 for the first; on Linux also its device, such as "
        "/dev/video2": "カメラの番号 (最初は 0)。Linux では /dev/video2 などのデバイスも指定できます",
        "On Object": "オブジェクト",
        "On an Object": "オブジェクト",
        "One": "1 人",
        "One unit is a centimetre, as most tools expect": "1 単位を 1 センチメートルとします。多くのツールの標準です",
        "One unit is a metre": "1 単位を 1 メートルとします",
        "Only the arms": "腕のみ",
        "Only the legs": "脚のみ",
        "Only the motion of the skeleton, one file per person": "スケルトンのモーションのみ。人物ごとに 1 ファイル",
        "Open the guide, which comes with Scope, in the web browser; the network is not "
        "used": "Scope に付属のガイドをウェブブラウザーで開きます（ネットワークは使いません）",
        "Options": "オプション",
        "Overlap": "重ねる",
        "Part of the captured body that this bone follows": "このボーンが追従する、キャプチャしたボディの部位",
        "Pelvis": "骨盤",
        "Preview of Current Frame": "現在のフレームのプレビュー",
        "Pin a joint to a place in one frame, and solve the motion around it "
        "again": "1 フレームで関節を位置にピン留めし、前後のモーションを再計算します",
        "Pin the joint only in the camera's image; its distance from the camera is free, except "
        "the pelvis's": "カメラの画像内でのみ関節をピン留めします。骨盤を除き、カメラからの距離は自由です",
        "Pitch": "ピッチ",
        "Pixel of the footage, from its top left": "左上を原点とするフッテージのピクセル",
        "Play Scene": "シーンを再生",
        "Play the scene's animation from the First Frame while "
        "recording": "録画中にシーンのアニメーションを「最初のフレーム」から再生します",
        "Point of the scene": "シーンの点",
        "Position": "位置",
        "Press Compare with Footage or switch to an orthographic side view; the line is drawn "
        "there": "「フッテージと比較」を押すか、横からの平行投影ビューを表示してください。線はそこで引きます",
        "Put feet in contact on the floor, which is at the height of the armature's "
        "origin": "接地した足を、アーマチュアの原点の高さにある床に置きます",
        "Quality": "品質",
        "Raise the frames in which a foot is below the floor": "足が床より下にあるフレームを持ち上げる",
        "Reach": "影響範囲",
        "Read focal lengths, principal point and distortion from a calibration "
        "file": "キャリブレーションファイルから焦点距離、主点、歪みを読み込み",
        "Read from the file's metadata if present, estimated otherwise": "ファイルのメタデータがあれば使用し、なければ推定",
        "Recorded: {seconds:.1f} s": "記録済み: {seconds:.1f} 秒",
        "Reduced {before} key to {after}; maximum error {angle:.2f} degrees for bones, "
        "{distance:.1f} mm for "
        "joints": "キーを {before} から {after} に削減しました。最大誤差はボーン {angle:.2f} 度、関節 {distance:.1f} mm",
        "Reduced {before} keys to {after}; maximum error {angle:.2f} degrees for bones, "
        "{distance:.1f} mm for "
        "joints": "キーを {before} から {after} に削減しました。最大誤差はボーン {angle:.2f} 度、関節 {distance:.1f} mm",
        "Refine": "調整",
        "Remove": "削除",
        "Remove captured motion from the cache. Existing scenes and the compiled solver are not "
        "affected": "キャプチャ済みモーションをキャッシュから削除します。既存のシーンとコンパイル済みソルバーには影響しません",
        "Remove keys within a maximum error": "最大誤差の範囲内でキーを削除",
        "Remove the correction and restore the motion around it": "修正を削除します。前後のモーションは修正前の状態に戻ります",
        "Remove the selected entry": "選択した項目を削除",
        "Rename it with Object > Motion Capture > Rename "
        "Take": "名前の変更は「オブジェクト > モーションキャプチャ > テイク名を変更」",
        "Rename the capture with its objects and actions; exported animation has the same "
        "name": "キャプチャの名前を、そのオブジェクトとアクションとともに変更します。エクスポートするアニメーションも同じ名前です",
        "Repeat": "リピート",
        "Repeat the curves; each cycle starts where the previous one "
        "ended": "カーブを繰り返します。各周期は前の周期の終わりから始まります",
        "Replace frames by an interpolation between the pose before and the pose after "
        "them": "フレームを、前後のポーズの補間で置き換えます",
        "Replace the keys by keys at a constant frame rate": "キーを一定のフレームレートのキーに置き換えます",
        "Replaced {before} key by {after}": "{before} 個のキーを {after} 個に置き換えました",
        "Replaced {before} keys by {after}": "{before} 個のキーを {after} 個に置き換えました",
        "Reprojection error {pixels:.1f} px": "再投影誤差 {pixels:.1f} px",
        "Resample to Scene": "シーンに合わせて再サンプル",
        "Result": "結果",
        "Retarget": "リターゲット",
        "Rig": "リグ",
        "Rig Follows": "リグも追従",
        "Right": "右",
        "Right Ankle": "右足首",
        "Right Elbow": "右肘",
        "Right Foot": "右足",
        "Right Foot Stands": "右足を接地",
        "Right Hip": "右股関節",
        "Right Knee": "右膝",
        "Right Shoulder": "右肩",
        "Right Wrist": "右手首",
        "Roll": "ロール",
        "Root Motion": "ルートモーション",
        "Rotate the motion so that all foot contacts are level, after which the camera no longer "
        "matches": "すべての接地が水平になるようにモーションを回転します。以後カメラとは一致しません",
        "Rotation": "回転",
        "Scale of positions on the floor. 0: the ratio of leg lengths, so that steps fit the rig. "
        "Several people who touch or meet need the same value for all their "
        "rigs": "床の上の位置の倍率。0：脚の長さの比（歩幅がリグに合う）。触れ合ったり出会ったりする人物には、すべてのリグに同じ値が必要です",
        "Show this capture": "このキャプチャを表示",
        "Save the bone map as a JSON file for similar rigs": "似たリグ用にボーンマップを JSON ファイルとして保存",
        "Save the expression map as a JSON file for similar faces": "似た顔用に表情マップを JSON ファイルとして保存",
        "Saved {file}": "{file} を保存しました",
        "Scene": "シーン",
        "Scene frame": "シーンのフレーム",
        "Scope: {progress}   (Esc over the Scope panel to "
        "cancel)": "Scope：{progress}   （Scope パネル上で Esc：キャンセル）",
        "Seconds before and after the frame over which the correction fades "
        "out": "フレームの前後で修正が減衰する秒数",
        "Select a Captured Person": "キャプチャした人物を選択",
        "Select the armature of a capture first": "先にキャプチャのアーマチュアを選択してください",
        "Select the captured person whose face to retarget": "顔をリターゲットするキャプチャした人物を選択してください",
        "Selected": "選択中",
        "Set Frame Range": "フレーム範囲を設定",
        "Set Scene Frame Rate": "シーンフレームレートを設定",
        "Set from Footage": "フッテージから設定",
        "Set the scene to the motion's frame rate. Captures keep their speed, other animation "
        "keeps its frames": "シーンをモーションのフレームレートにします。キャプチャは速度を、他のアニメーションはフレーム番号を保ちます",
        "Set the scene's frame rate to the footage's": "シーンのフレームレートをフッテージに合わせます",
        "Set the scene's frame rate to the footage's unless something in the scene is "
        "animated": "シーンにアニメーションがなければ、シーンのフレームレートをフッテージに合わせます",
        "Set the scene's frame rate to the motion's; otherwise keys may be between "
        "frames": "シーンのフレームレートをモーションに合わせます。オフでは、キーがフレームの間に置かれることがあります",
        "Several people are captured: select the armature of the one whose motion to "
        "retarget": "複数の人物がキャプチャされています。リターゲットするモーションのアーマチュアを選択してください",
        "Shape": "体型",
        "Shape Key": "シェイプキー",
        "Shape Key or Control": "シェイプキーまたはコントロール",
        "Shape Keys": "シェイプキー",
        "Shape Keys per Frame": "フレームごとのシェイプキー",
        "Shape key of your mesh, or bone of your rig's face": "メッシュのシェイプキー、またはリグの顔のボーン",
        "Shape keys, or in the mesh for formats whose readers limit shape "
        "keys": "シェイプキー。読み込み側がシェイプキーを制限する形式ではメッシュ内",
        "Shortest": "最短",
        "Show both in the same place": "両方を同じ位置に表示",
        "Show both, the rig to the left of the captured person": "両方を表示し、リグをキャプチャした人物の左に置きます",
        "Show the captured body from its side in a second viewport, beside the one with the "
        "footage": "フッテージの隣の 2 つ目のビューポートで、キャプチャしたボディを横から表示",
        "Show the pose of the current frame in the preview image, instead of the first one that "
        "needs no review": "画像に、確認の要らない最初のポーズではなく現在のフレームのポーズを表示",
        "Side by Side": "並べる",
        "Sides Exchanged": "左右の入れ替え",
        "Slightly less accurate than Best, and faster": "「最高」よりわずかに精度が低く、高速",
        "Smallest network: for a first look or a slow computer": "最小のネットワーク：最初の確認や遅いコンピューター用",
        "Smooth the captured motion again, more or less strongly. Keeps corrections, discards "
        "other changes": "キャプチャしたモーションを強弱を変えて再度スムージングします。修正は保持し、他の変更は破棄します",
        "Source": "ソース",
        "Start": "開始",
        "Stop the Capture?": "キャプチャを停止しますか？",
        "Stop the live capture. What was recorded is written as keyframes; otherwise the last pose "
        "stays": "ライブキャプチャを停止します。記録した動きはキーフレームとして書き込まれ、記録がなければ最後のポーズが残ります",
        "Stream": "ストリーム",
        "Strength": "強さ",
        "Swap the left and right limbs within a span of frames": "フレーム範囲内で左右の手足を交換します",
        "Take": "テイク",
        "The axis along which the person is upright": "人物が直立する軸",
        "The body's shape as shape keys with one keyframe each": "体型を、キーフレームを 1 つずつ持つシェイプキーにします",
        "The built-in body with SMPL's 24 joints": "SMPL の 24 関節を持つ内蔵ボディ",
        "The built-in body with SMPL+H's 52 joints, fingers "
        "included": "指を含む SMPL+H の 52 関節を持つ内蔵ボディ",
        "The capture does not say where its footage is": "キャプチャにフッテージの場所が記録されていません",
        "The capture is linked from {file}: make it local": "キャプチャは {file} からリンクされています。ローカル化してください",
        "The capture that is selected in the panel, with all its people": "パネルで選択中のキャプチャとそのすべての人物",
        "The capture that the active object belongs to": "アクティブオブジェクトが属するキャプチャ",
        "The captured person was deleted": "キャプチャした人物は削除されました",
        "The collection '{name}' is hidden; show it in the "
        "Outliner": "コレクション '{name}' は非表示です。アウトライナーで表示してください",
        "The corrections put a foot up to {depth:.0f} cm under the floor: move the pin "
        "up": "修正により足が床下に最大 {depth:.0f} cm 沈んでいます。ピンを上に動かしてください",
        "The corrections put a foot up to {depth:.0f} cm under the floor in {count} of {total} "
        "frames: move the pin "
        "up": "修正により、{total} フレーム中 {count} フレームで足が床下に最大 {depth:.0f} cm 沈んでいます。ピンを上に動かしてください",
        "The footage is already in the sequencer": "フッテージはすでにシーケンサーにあります",
        "The left foot": "左足",
        "The lower one of the two in this frame": "このフレームで低い方の足",
        "The most prominent people, up to a number": "最も目立つ人物から、指定した人数まで",
        "The most prominent person": "最も目立つ人物",
        "The pelvis moves through the scene": "骨盤がシーン内を移動します",
        "The pelvis moves through the scene, as captured": "骨盤がキャプチャどおりシーン内を移動します",
        "The processor": "プロセッサー",
        "The rig chosen under Retarget, with its current animation and its "
        "meshes": "「リターゲット」で選択したリグと、現在のアニメーション、メッシュ",
        "The right foot": "右足",
        "The same, with a keyframe on every frame": "同じものを、すべてのフレームのキーフレームで",
        "The scene contains no capture yet": "シーンにはまだキャプチャがありません",
        "The scene contains no captured video or imported "
        "motion": "シーンにはキャプチャした動画もインポートしたモーションもありません",
        "The scene has no camera of a capture: capture with the option Camera with "
        "Footage": "シーンにキャプチャのカメラがありません。「フッテージ付きカメラ」を有効にしてキャプチャしてください",
        "The scene has {rate:.5g} frames/s, like the motion": "シーンはモーションと同じ {rate:.5g} フレーム/秒です",
        "The scene has {rate:.5g} frames/s; animation that was not captured plays {factor:.3g} "
        "times as fast": "シーンは {rate:.5g} フレーム/秒です。キャプチャ以外のアニメーションは {factor:.3g} 倍の速さで再生されます",
        "The scene has {scene:.5g} frames/s and the footage {footage:.5g}: the strip will not stay "
        "synchronized with the "
        "motion": "シーンは {scene:.5g} フレーム/秒、フッテージは {footage:.5g} です。ストリップはモーションと同期しません",
        "The scene's frame rate was changed from {was:.5g} to {now:.5g}, which changed the "
        "motion's speed; importing an FBX file does "
        "that": "シーンのフレームレートが {was:.5g} から {now:.5g} に変わり、モーションの速さが変わりました。FBX ファイルのインポートで起こります",
        "This Blender was built without USD; use a build from blender.org, or another "
        "format": "この Blender は USD なしでビルドされています。blender.org のビルドか、他の形式を使ってください",
        "This motion was captured on uneven ground, where feet rest at any height: use Floor "
        "Here": "このモーションは平らでない地面でキャプチャされ、足はどの高さでも接地します。「ここが床」を使ってください",
        "Threads": "スレッド",
        "Toggle the view of the body over the footage. Sets the scene's camera and "
        "resolution": "フッテージに重ねたボディの表示を切り替えます。シーンのカメラと解像度を設定します",
        "Transfer the captured expressions to the mesh's shape keys or the rig's face, as a new "
        "action": "キャプチャした表情をメッシュのシェイプキーまたはリグの顔に新しいアクションとして転送",
        "Transfer the captured motion to your rig, as a new action. One of the same capture is "
        "replaced if unchanged": "キャプチャしたモーションを新しいアクションとして自分のリグに転送します。同じキャプチャのアクションは、変更がなければ置き換えます",
        "Travel Scale": "移動の倍率",
        "Turn the capture and its camera so that a line in an orthographic view from a side is "
        "upright": "横からの平行投影ビューの線が垂直になるように、キャプチャとカメラを回転",
        "Turn the capture and its camera so that a line in the footage is "
        "upright": "フッテージの線が垂直になるように、キャプチャとカメラを回転",
        "Turns down, in degrees": "下へ回転(度)",
        "Turns to the person's left, in degrees": "人物の左へ回転(度)",
        "Turns with the left side up, in degrees": "左側を上げて回転(度)",
        "Uneven Ground": "平らでない地面",
        "Upright Line": "垂直線",
        "Use the short clip that is included with Scope": "Scope に付属の短いクリップを使用",
        "Use this in the viewport with the footage": "フッテージのあるビューポートで使ってください",
        "Value of a shape key": "シェイプキーの値",
        "Value where the expression is 1: at most 10, or 180 degrees; several expressions add "
        "up": "表情が 1 のときの値。最大 10、角度は最大 180 度。複数の表情は合計されます",
        "Video": "動画",
        "Video of a person, which is played in real time": "リアルタイムで再生する人物の動画",
        "Video or image of a person to capture": "キャプチャする人物の動画または画像",
        "Wait until somebody is seen": "誰かが映るまでお待ちください",
        "Waiting for the source": "ソースを待っています",
        "Warnings": "警告",
        "What to export": "エクスポートする対象",
        "Where the joint is in that frame": "そのフレームでの関節の位置",
        "Source of the images": "映像の取得元",
        "Where the root motion is stored": "ルートモーションの保存先",
        "Where the root motion of the rig is stored": "リグのルートモーションの保存先",
        "Which foot rests on the floor": "どちらの足が床に着いているか",
        "Which foot stands": "接地する足",
        "Which limbs are exchanged": "入れ替える手足",
        "Who made this asset": "このアセットの作成者",
        "With Heading": "向きを含める",
        "A foot is up to {depth:.0f} cm under this floor in {count} of {total} frames: press Floor "
        "Here in a frame in which it rests on the floor, or use Snap Feet to "
        "Floor": "この床では {total} フレーム中 {count} フレームで足が床より最大 {depth:.0f} cm "
        "下になります。足が着いているフレームで「ここが床」を押すか、「足を床にスナップ」を使ってください",
        "Write a separate file for each person": "人物ごとに別のファイルを書き出す",
        "Write captures to a file": "キャプチャをファイルに書き出す",
        "Write the recorded images of a camera or stream as a video beside the .blend file, from "
        "which a more accurate motion of the same take can be "
        "captured": "カメラやストリームの録画した映像を .blend ファイルの隣に動画として書き出します。同じテイクのより正確なモーションをそこからキャプチャできます",
        "Writing the recording": "記録を書き込んでいます",
        "Wrote {files} in {folder}": "{files} を {folder} に書き出しました",
        "Y points down, as in the camera's axes of pose estimation "
        "networks": "Y が下向き。姿勢推定ネットワークのカメラ軸と同じ",
        "Y points up, as in AIST++ and most engines": "Y が上向き。AIST++ や多くのエンジンと同じ",
        "Yaw": "ヨー",
        "Your own SMPL, SMPL+H, SMPL-X or STAR file": "自分の SMPL、SMPL+H、SMPL-X または STAR ファイル",
        "Z points up, as in AMASS": "Z が上向き。AMASS と同じ",
        "removed": "削除済み",
        "{count} bone": "ボーン {count} 本",
        "{count} bones": "ボーン {count} 本",
        "{count} entries": "項目 {count} 件",
        "{count} entry": "項目 {count} 件",
        "{count} frame": "{count} フレーム",
        "{count} frames": "{count} フレーム",
        "{count} people": "{count} 人",
        "{count} person": "{count} 人",
        "{frames}, captured in {time}": "{frames}、キャプチャ時間 {time}",
        "{joint} cannot reach the pin and stays {distance} away: move the pin closer, or pin the "
        "pelvis too": "{joint} はピンに届かず、{distance} 離れています。ピンを近づけるか、骨盤もピン留めしてください",
        "{path} is not a file; choose a video or image": "{path} はファイルではありません。動画または画像を選択してください",
        "{rate:.0f} pose/s, latency {latency:.0f} ms": "{rate:.0f} ポーズ/秒、遅延 {latency:.0f} ms",
        "{rate:.0f} poses/s, latency {latency:.0f} ms": "{rate:.0f} ポーズ/秒、遅延 {latency:.0f} ms",
        "{size} of captures in {folder}": "{folder} にキャプチャ {size}",
    }
)
