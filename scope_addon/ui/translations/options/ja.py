# SPDX-License-Identifier: GPL-3.0-or-later
"""Japanese."""

OPTIONS = {
    "Add the estimated camera, with the footage in its background": "フッテージを下絵にした推定カメラを追加",
    "Add timeline markers where the motion should be reviewed": "モーションの確認が必要な箇所にタイムラインマーカーを追加",
    "At Most": "最大人数",
    "Calibration": "キャリブレーション",
    "Camera with Footage": "フッテージ付きカメラ",
    "Capture only a part of the video": "動画の一部だけをキャプチャ",
    "Capture the expressions of the face and the gaze as well; takes "
    "longer": "顔の表情と視線もキャプチャします。時間がかかります",
    "Capture the fingers as well, on the body with hands; takes "
    "longer": "手付きボディで指もキャプチャします。時間がかかります",
    "CPU threads for the networks; 0: all cores": "ネットワーク用の CPU スレッド数。0：全コア",
    "End of the captured part, in seconds": "キャプチャする範囲の終了（秒）",
    "Execution Provider": "実行プロバイダー",
    "Field of View": "視野角",
    "Field of view along the longer side of the image": "画像の長辺方向の視野角",
    "First Frame": "最初のフレーム",
    "Focal Length": "焦点距離",
    "Frame Rate": "フレームレート",
    "Frames per second, if the file does not state them; 0: 30": "ファイルに記載がない場合の毎秒フレーム数。0：30",
    "From": "開始",
    "Height (cm)": "身長（cm）",
    "How the person's body shape is stored": "人物の体型の保存方法",
    "How the scene's frame rate is set": "シーンのフレームレートの設定方法",
    "JSON file with OpenCV intrinsics (3x3), optionally dist (five values) and size (width, "
    "height)": "OpenCV の内部パラメーター（3x3）と、任意で dist（5 つの値）、size（幅、高さ）を含む JSON ファイル",
    "Keypoint Network": "キーポイントネットワーク",
    "Markers": "マーカー",
    "Maximum number of people": "最大人数",
    "Maximum number of people to follow; each one takes time": "追跡する人物の最大数。一人ごとに時間がかかります",
    "Name of the next capture, its actions and the exported animation; if empty, the footage's "
    "name": "次のキャプチャ、そのアクション、エクスポートするアニメーションの名前。空の場合はフッテージの名前",
    "Part of the Video": "動画の一部",
    "People": "人物",
    "People to capture": "キャプチャする人物",
    "People walk on stairs, steps or slopes: feet rest at any height instead of on one horizontal "
    "floor": "階段、段差、斜面を歩く場合：足は一つの水平な床ではなく、任意の高さで接地します",
    "Person Detector": "人物検出器",
    "Remove jitter and lock feet in contact with the floor; off keeps the per-frame "
    "solution": "ジッターを除去し、接地した足を固定します。オフではフレームごとの解を保持します",
    "Scene frame at which the footage starts": "フッテージが始まるシーンのフレーム",
    "Set the scene's frame range to the captured frames": "シーンのフレーム範囲をキャプチャしたフレームに設定",
    "Smooth": "スムーズ",
    "SMPL, SMPL+H, SMPL-X or STAR model (.npz or .pkl); if empty, the one in the "
    "preferences": "SMPL、SMPL+H、SMPL-X または STAR モデル（.npz、.pkl）。空の場合はプリファレンスのもの",
    "Speed versus accuracy": "速度と精度のどちらを優先するか",
    "Start of the captured part, in seconds": "キャプチャする範囲の開始（秒）",
    "The body that is fitted to the person": "人物に合わせるボディ",
    "To": "終了",
    "Unit": "単位",
    "Unit of length in .bvh files": ".bvh ファイルの長さの単位",
    "Up": "上方向",
    "Where the camera's focal length comes from": "カメラの焦点距離の取得元",
    "Which way is up in the file; files written by Scope have z "
    "up": "ファイルの上方向。Scope が書き出すファイルは z が上です",
}
