# SPDX-License-Identifier: GPL-3.0-or-later
"""German."""

OPTIONS = {
    "Add the estimated camera, with the footage in its "
    "background": "Die geschätzte Kamera mit dem Filmmaterial im Hintergrund hinzufügen",
    "Add timeline markers where the motion should be "
    "reviewed": "Zeitleistenmarker setzen, wo die Bewegung geprüft werden sollte",
    "At Most": "Höchstens",
    "Calibration": "Kalibrierung",
    "Camera with Footage": "Kamera mit Film",
    "Capture only a part of the video": "Nur einen Teil des Videos erfassen",
    "Capture the expressions of the face and the gaze as well; takes "
    "longer": "Auch Mimik und Blickrichtung erfassen; dauert länger",
    "Capture the fingers as well, on the body with hands; takes "
    "longer": "Auch die Finger erfassen, am Körper mit Händen; dauert länger",
    "CPU threads for the networks; 0: all cores": "CPU-Threads für die Netze; 0: alle Kerne",
    "End of the captured part, in seconds": "Ende des erfassten Teils in Sekunden",
    "Execution Provider": "Recheneinheit",
    "Field of View": "Bildwinkel",
    "Field of view along the longer side of the image": "Bildwinkel entlang der längeren Bildseite",
    "First Frame": "Erstes Bild",
    "Focal Length": "Brennweite",
    "Frame Rate": "Bildrate",
    "Frames per second, if the file does not state them; 0: "
    "30": "Bilder pro Sekunde, falls die Datei sie nicht angibt; 0: 30",
    "From": "Von",
    "Height (cm)": "Größe (cm)",
    "How the person's body shape is stored": "Wie die Körperform der Person gespeichert wird",
    "How the scene's frame rate is set": "Wie die Bildrate der Szene gesetzt wird",
    "JSON file with OpenCV intrinsics (3x3), optionally dist (five values) and size (width, "
    "height)": "JSON-Datei mit OpenCV-Intrinsiken (3x3), wahlweise dist (fünf Werte) und size "
    "(Breite, Höhe)",
    "Keypoint Network": "Keypoint-Netz",
    "Markers": "Marker",
    "Maximum number of people": "Höchstzahl der Personen",
    "Maximum number of people to follow; each one takes "
    "time": "Wie vielen Personen höchstens gefolgt wird; jede kostet Zeit",
    "Name of the next capture, its actions and the exported animation; if empty, the footage's "
    "name": "Name der nächsten Erfassung, ihrer Aktionen und der exportierten Animation; leer: "
    "Name des Filmmaterials",
    "Part of the Video": "Teil des Videos",
    "People": "Personen",
    "People to capture": "Zu erfassende Personen",
    "People walk on stairs, steps or slopes: feet rest at any height instead of on one horizontal "
    "floor": "Menschen gehen auf Treppen, Stufen oder Schrägen: Füße ruhen in jeder Höhe statt auf "
    "einem waagrechten Boden",
    "Person Detector": "Personendetektor",
    "Remove jitter and lock feet in contact with the floor; off keeps the per-frame "
    "solution": "Zittern entfernen und Füße mit Bodenkontakt festhalten; aus: die Lösung der "
    "Einzelbilder bleibt",
    "Scene frame at which the footage starts": "Bild der Szene, bei dem das Filmmaterial beginnt",
    "Set the scene's frame range to the captured "
    "frames": "Den Bildbereich der Szene auf die erfassten Bilder setzen",
    "Smooth": "Glätten",
    "SMPL, SMPL+H, SMPL-X or STAR model (.npz or .pkl); if empty, the one in the "
    "preferences": "SMPL-, SMPL+H-, SMPL-X- oder STAR-Modell (.npz oder .pkl); leer: das in den "
    "Einstellungen",
    "Speed versus accuracy": "Geschwindigkeit gegen Genauigkeit",
    "Start of the captured part, in seconds": "Beginn des erfassten Teils in Sekunden",
    "The body that is fitted to the person": "Der Körper, der an die Person angepasst wird",
    "To": "Bis",
    "Unit": "Einheit",
    "Unit of length in .bvh files": "Längeneinheit in .bvh-Dateien",
    "Up": "Oben",
    "Where the camera's focal length comes from": "Woher die Brennweite der Kamera kommt",
    "Which way is up in the file; files written by Scope have z "
    "up": "Wo in der Datei oben ist; in Dateien von Scope zeigt z nach oben",
}
