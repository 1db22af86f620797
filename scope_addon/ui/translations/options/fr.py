# SPDX-License-Identifier: GPL-3.0-or-later
"""French."""

OPTIONS = {
    "Add the estimated camera, with the footage in its "
    "background": "Ajouter la caméra estimée, avec le métrage en arrière-plan",
    "Add timeline markers where the motion should be "
    "reviewed": "Ajouter des marqueurs de timeline là où le mouvement est à vérifier",
    "At Most": "Au plus",
    "Calibration": "Calibration",
    "Camera with Footage": "Caméra avec métrage",
    "Capture only a part of the video": "Ne capturer qu’une partie de la vidéo",
    "Capture the expressions of the face and the gaze as well; takes "
    "longer": "Capturer aussi les expressions du visage et le regard ; plus long",
    "Capture the fingers as well, on the body with hands; takes "
    "longer": "Capturer aussi les doigts, sur le corps avec mains ; plus long",
    "CPU threads for the networks; 0: all "
    "cores": "Threads CPU pour les réseaux ; 0 : tous les cœurs",
    "End of the captured part, in seconds": "Fin de la partie capturée, en secondes",
    "Execution Provider": "Moteur d’exécution",
    "Field of View": "Champ de vision",
    "Field of view along the longer side of the "
    "image": "Champ de vision le long du plus grand côté de l’image",
    "First Frame": "Première frame",
    "Focal Length": "Longueur focale",
    "Frame Rate": "Fréquence d’images",
    "Frames per second, if the file does not state them; 0: "
    "30": "Images par seconde, si le fichier ne les indique pas ; 0 : 30",
    "From": "De",
    "Height (cm)": "Taille (cm)",
    "How the person's body shape is stored": "Comment la forme du corps de la personne est stockée",
    "How the scene's frame rate is set": "Comment la fréquence d’images de la scène est définie",
    "JSON file with OpenCV intrinsics (3x3), optionally dist (five values) and size (width, "
    "height)": "Fichier JSON avec les paramètres intrinsèques OpenCV (3x3), éventuellement dist "
    "(cinq valeurs) et size (largeur, hauteur)",
    "Keypoint Network": "Réseau de points clés",
    "Markers": "Marqueurs",
    "Maximum number of people": "Nombre maximal de personnes",
    "Maximum number of people to follow; each one takes "
    "time": "Nombre maximal de personnes à suivre ; chacune prend du temps",
    "Name of the next capture, its actions and the exported animation; if empty, the footage's "
    "name": "Nom de la prochaine capture, de ses actions et de l’animation exportée ; vide : nom "
    "du métrage",
    "Part of the Video": "Partie de la vidéo",
    "People": "Personnes",
    "People to capture": "Personnes à capturer",
    "People walk on stairs, steps or slopes: feet rest at any height instead of on one horizontal "
    "floor": "Les personnes marchent sur des escaliers, des marches ou des pentes : les pieds se "
    "posent à toute hauteur et non sur un seul sol horizontal",
    "Person Detector": "Détecteur de personnes",
    "Remove jitter and lock feet in contact with the floor; off keeps the per-frame "
    "solution": "Supprimer les tremblements et verrouiller les pieds en contact avec le sol ; "
    "désactivé : garder la solution image par image",
    "Scene frame at which the footage starts": "Frame de la scène où commence le métrage",
    "Set the scene's frame range to the captured "
    "frames": "Définir l’intervalle de frames de la scène sur les frames capturées",
    "Smooth": "Lisser",
    "SMPL, SMPL+H, SMPL-X or STAR model (.npz or .pkl); if empty, the one in the "
    "preferences": "Modèle SMPL, SMPL+H, SMPL-X ou STAR (.npz ou .pkl) ; vide : celui des "
    "préférences",
    "Speed versus accuracy": "Vitesse ou précision",
    "Start of the captured part, in seconds": "Début de la partie capturée, en secondes",
    "The body that is fitted to the person": "Le corps ajusté à la personne",
    "To": "À",
    "Unit": "Unité",
    "Unit of length in .bvh files": "Unité de longueur des fichiers .bvh",
    "Up": "Haut",
    "Where the camera's focal length comes from": "D’où vient la longueur focale de la caméra",
    "Which way is up in the file; files written by Scope have z "
    "up": "Où est le haut dans le fichier ; les fichiers écrits par Scope ont z vers le haut",
}
