# SPDX-License-Identifier: GPL-3.0-or-later
"""French."""

from .operators.fr import OPERATORS as OPERATORS
from .options.fr import OPTIONS
from .stages.fr import STAGES

TEXTS = (
    STAGES
    | OPTIONS
    | {
        "'{action}' is an asset of this file; save the file in an asset "
        "library": "'{action}' est une ressource de ce fichier ; enregistrez le fichier dans une "
        "bibliothèque de ressources",
        "'{action}' is now an asset": "'{action}' est maintenant une ressource",
        "'{mesh}' is linked from {file}, so its keyframes would not be saved in this file: make it "
        "local": "'{mesh}' est lié depuis {file}, ses images clés ne seraient pas enregistrées "
        "dans ce fichier : rendez-le local",
        "'{mesh}' is now animated by the action "
        "'{action}'": "'{mesh}' est maintenant animé par l’action '{action}'",
        "'{name}' has no action; choose one in the Action "
        "Editor": "'{name}' n’a pas d’action ; choisissez-en une dans l’éditeur d’action",
        "'{name}' is linked from {file}: make it "
        "local": "'{name}' est lié depuis {file} : rendez-le local",
        "'{name}' or its motion is linked from {file}, so changes would be lost: make both local "
        "(Object > Relations > Make Local > All) or edit them in that "
        "file": "'{name}' ou son mouvement est lié depuis {file}, les changements seraient perdus "
        ": rendez les deux locaux (Objet > Relations > Rendre local > Tout) ou éditez-les "
        "dans ce fichier",
        "'{rig}' is linked from {file}, so its motion would not be saved in this file: make an "
        "override of it (Object > Library Override > "
        "Make)": "'{rig}' est lié depuis {file}, son mouvement ne serait pas enregistré dans ce "
        "fichier : créez-en une redéfinition (Objet > Redéfinition de bibliothèque > "
        "Créer)",
        "'{rig}' is not in the scene's view layer: add it to the scene, or enable its collection "
        "in the Outliner": "'{rig}' n’est pas dans le calque de vue de la scène : ajoutez-le à la "
        "scène ou activez sa collection dans le synoptique",
        "'{rig}' is now animated by the action "
        "'{action}'": "'{rig}' est maintenant animé par l’action '{action}'",
        "'{rig}' is now animated by the action '{action}', with positions on the floor scaled by "
        "{scale:.3f}": "'{rig}' est maintenant animé par l’action '{action}', positions au sol à "
        "l’échelle {scale:.3f}",
        "'{strip}' is now a strip of {armature}'s NLA; to edit its keys, enter Tweak Mode (key "
        "Tab)": "'{strip}' est maintenant une bande NLA de {armature} ; pour éditer ses clés, "
        "passez en mode d’ajustement (touche Tab)",
        "0 keeps every frame as captured, 1 is the default of a capture, higher values smooth "
        "more": "0 garde chaque frame telle que capturée, 1 est la valeur par défaut d’une "
        "capture, au-delà le lissage est plus fort",
        "35 mm Equivalent": "Équivalent 35 mm",
        "35 mm equivalent focal length in millimetres; a phone's main camera has about "
        "26": "Longueur focale équivalente 35 mm en millimètres ; environ 26 pour l’appareil "
        "principal d’un téléphone",
        "A camera is in use; wait for it or stop "
        "it": "Une caméra est en cours d'utilisation ; attendre ou l'arrêter",
        "A camera of this computer": "Une caméra de cet ordinateur",
        "A capture is running; wait for it or cancel "
        "it": "Une capture est en cours ; attendez sa fin ou annulez-la",
        "A network camera or another stream": "Une caméra réseau ou un autre flux",
        "A supported GPU if there is one, otherwise the "
        "CPU": "Un GPU pris en charge s’il y en a un, sinon le CPU",
        "A video that is played in real time": "Une vidéo lue en temps réel",
        "Active": "Active",
        "Add": "Ajouter",
        "Add an entry": "Ajouter une entrée",
        "Add an entry to the bone map, or remove the selected "
        "one": "Ajouter une entrée à la table des os, ou supprimer celle sélectionnée",
        "Add an entry to the expression map, or remove the selected "
        "one": "Ajouter une entrée à la table des expressions, ou supprimer celle sélectionnée",
        "Add the capture settings as a preset, or remove a "
        "preset": "Ajouter les réglages de capture comme préréglage, ou supprimer un préréglage",
        "Add the footage with its sound to the video sequencer, synchronized with the "
        "motion": "Ajouter le métrage avec le son au séquenceur vidéo, synchronisé avec le "
        "mouvement",
        "Address": "Adresse",
        "Address of the stream, such as rtsp://192.168.1.20/stream; name and password in it are "
        "kept until Blender ends, and never "
        "saved": "Adresse du flux, par exemple rtsp://192.168.1.20/stream ; le nom et le mot de "
        "passe qu'elle contient sont gardés jusqu'à la fermeture de Blender et jamais "
        "enregistrés",
        "All four limbs": "Les quatre membres",
        "All in the Scene": "Toutes dans la scène",
        "An NVIDIA GPU": "Un GPU NVIDIA",
        "An NVIDIA GPU with TensorRT, which takes minutes to compile each network on first "
        "use": "Un GPU NVIDIA avec TensorRT, qui met des minutes à compiler chaque réseau à la "
        "première utilisation",
        "An empty carries position and heading, the rig moves relative to "
        "it": "Un vide porte la position et l’orientation, le rig bouge relativement à lui",
        "An empty on the floor carries the root motion": "Un vide au sol porte le mouvement racine",
        "Angle": "Angle",
        "Any GPU on Windows": "Tout GPU sous Windows",
        "Apple silicon": "Processeurs Apple",
        "Armature to animate with the captured "
        "motion": "Armature à animer avec le mouvement capturé",
        "Arms": "Bras",
        "Arms Exchanged": "Bras échangés",
        "Arms and Legs": "Bras et jambes",
        "Query the camera's formats, without taking an image. macOS may ask for "
        "permission": "Demander à la caméra ses formats, sans prendre d'image. macOS peut demander "
        "si elle peut être utilisée",
        "Querying the camera": "Interrogation de la caméra",
        "Assign the face's shape keys, named as by ARKit, Oculus or VRM, or the controls of a "
        "known rig to "
        "expressions": "Associer aux expressions les clés de forme du visage, nommées comme par "
        "ARKit, Oculus ou VRM, ou les contrôleurs d’un rig connu",
        "Assign the rig's bones to body parts by their names and rest "
        "pose": "Associer les os du rig aux parties du corps d’après leurs noms et la pose de "
        "repos",
        "Author": "Auteur",
        "Automatic": "Automatique",
        "Balanced": "Équilibrée",
        "Best": "Meilleure",
        "Blend": "Fondu",
        "Body": "Corps",
        "Body File": "Fichier du corps",
        "Body Part": "Partie du corps",
        "Body with Hands": "Corps avec mains",
        "Bone": "Os",
        "Bone of your rig": "Os de votre rig",
        "Choose the file in the file browser": "Choisir le fichier dans le navigateur de fichiers",
        "Cache Folder": "Dossier du cache",
        "Cache Size": "Taille du cache",
        "Camera": "Caméra",
        "Camera (-Y)": "Caméra (-Y)",
        "Cancel the capture; the scene stays "
        "unchanged": "Annuler la capture ; la scène reste inchangée",
        "Cancel the live capture; the scene stays unchanged, and nothing is "
        "recorded": "Annuler la capture en direct ; la scène reste inchangée et rien n'est "
        "enregistré",
        "Capture": "Capture",
        "Capture Presets": "Préréglages de capture",
        "Capture cancelled; the scene is unchanged": "Capture annulée ; la scène est inchangée",
        "Capture finished": "Capture terminée",
        "Capture motion from video, and view, edit, retarget and export captured "
        "motion": "Capturer un mouvement depuis une vidéo, et voir, éditer, recibler et exporter "
        "des mouvements capturés",
        "Leave the fingers at rest": "Laisser les doigts au repos",
        "Capture hands that are large enough in the image to be "
        "read": "Capturer les mains assez grandes dans l’image",
        "Capture hands of all sizes": "Capturer les mains de toute taille",
        "Off": "Désactivé",
        "On": "Activé",
        "Capture the person in the footage as an animated body, while Blender stays "
        "usable": "Capturer la personne du métrage comme corps animé, pendant que Blender reste "
        "utilisable",
        "Capture whose result the panel shows": "Capture dont le panneau montre le résultat",
        "Capture with Scope": "Capturer avec Scope",
        "Captured Body": "Corps capturé",
        "Captured Motion (Mocap)": "Mouvement capturé (Mocap)",
        "Captured Motion as {format} (.{suffix})": "Mouvement capturé en {format} (.{suffix})",
        "Captured expression that this entry follows": "Expression capturée que cette entrée suit",
        "Captured from {source}, {seconds:.1f} s": "Capturé depuis {source}, {seconds:.1f} s",
        "Captures": "Captures",
        "Catalog": "Catalogue",
        "Catalog of the Asset Browser, such as Motions/Walks; unassigned if left "
        "empty": "Catalogue du navigateur de ressources, par exemple Mouvements/Marche ; non "
        "assigné si vide",
        "Centimetres": "Centimètres",
        "Channel": "Canal",
        "Choose a mesh with shape keys, or a rig with face controls, "
        "first": "Choisissez d’abord un maillage à clés de forme, ou un rig à contrôleurs de "
        "visage",
        "Choose a video or image first": "Choisissez d’abord une vidéo ou une image",
        "Choose a video or image of a person": "Choisir une vidéo ou une image d’une personne",
        "Choose where the person's root motion is "
        "stored": "Choisir où le mouvement racine de la personne est stocké",
        "Choose your rig first": "Choisissez d’abord votre rig",
        "Compare with Footage first": "Comparez d’abord avec le métrage",
        "Compiling the solver in the background, {percent:.0f} "
        "%": "Compilation du solveur en arrière-plan, {percent:.0f} %",
        "Confidence": "Confiance",
        "Confidence of the guess": "Confiance dans la correspondance",
        "Corrections": "Corrections",
        "Countdown (s)": "Compte à rebours (s)",
        "Counted from 0; -1 removes all": "Compté à partir de 0 ; -1 supprime tout",
        "Custom SMPL, SMPL+H, SMPL-X or STAR model, for scenes without a body file of their "
        "own": "Modèle SMPL, SMPL+H, SMPL-X ou STAR personnalisé, pour les scènes sans fichier de "
        "corps propre",
        "Custom detector (.onnx): YOLOX, YOLOv4, YOLOv8 and similar; built-in if "
        "empty": "Détecteur personnalisé (.onnx) : YOLOX, YOLOv4, YOLOv8 et similaires ; vide : "
        "celui intégré",
        "Custom keypoint network (.onnx): RTMPose, HRNet, ViTPose and similar; built-in if "
        "empty": "Réseau de points clés personnalisé (.onnx) : RTMPose, HRNet, ViTPose et "
        "similaires ; vide : celui intégré",
        "Cycle of {seconds:.2f} s; before closing, its ends were {distance:.1f} cm "
        "apart": "Cycle de {seconds:.2f} s ; avant fermeture, ses extrémités étaient distantes de "
        "{distance:.1f} cm",
        "Description": "Description",
        "Description of the asset; the footage and its duration if left "
        "empty": "Description de la ressource ; si vide, le métrage et sa durée",
        "Details": "Détails",
        "Direction": "Direction",
        "Direction of the scene in which the view "
        "looks": "Direction de la scène dans laquelle la vue regarde",
        "Drag a handle to where the joint is.  Scrub or play to go to other frames.  Esc or Enter: "
        "done": "Tirez une poignée là où est l’articulation.  Déplacez-vous ou jouez pour changer "
        "de frame.  Échap ou Entrée : terminé",
        "Drag handles on the body to where the joints are in this frame; the motion around is "
        "solved again": "Tirer les poignées du corps là où sont les articulations dans cette frame "
        "; le mouvement autour est recalculé",
        "Draw a line along something upright: a door or post in the footage, or a standing person "
        "in a side view.  Esc: "
        "cancel": "Tracez une ligne le long d’un élément vertical : porte ou poteau dans le "
        "métrage, personne debout dans une vue de côté.  Échap : annuler",
        "Draw a line along something upright, in the footage or a side view; it rotates the "
        "capture and its "
        "camera": "Tracer dans le métrage ou de côté une ligne le long d’un élément vertical ; la "
        "capture et sa caméra tournent avec elle",
        "Duration in seconds, at the end of the cycle, over which it is "
        "closed": "Durée en secondes, à la fin du cycle, sur laquelle il est fermé",
        "End": "Fin",
        "Enter the 35 mm equivalent focal length": "Saisir la longueur focale équivalente 35 mm",
        "Enter the field of view along the longer side of the "
        "image": "Saisir le champ de vision le long du plus grand côté de l’image",
        "Every capture of the scene, with all its "
        "people": "Toutes les captures de la scène, avec toutes leurs personnes",
        "Everyone": "Tout le monde",
        "Everyone who is clearly visible": "Toutes les personnes clairement visibles",
        "Exchange left and right from the first to the last frame; applying it again undoes "
        "it": "Échanger gauche et droite de la première à la dernière frame ; recommencer annule "
        "l’échange",
        "Execution provider for the networks; if unavailable, the CPU is used and the result shows "
        "a warning": "Moteur d’exécution des réseaux ; s’il est indisponible, le CPU est utilisé "
        "et le résultat affiche un avertissement",
        "Export": "Exporter",
        "Export the estimated camera": "Exporter la caméra estimée",
        "Expression": "Expression",
        "Face": "Visage",
        "Factor": "Facteur",
        "Fast": "Rapide",
        "Feet on the Floor": "Pieds au sol",
        "File": "Fichier",
        "File per Person": "Un fichier par personne",
        "Find the best cycle within a span of frames, close it, and repeat "
        "it": "Trouver le meilleur cycle dans un intervalle de frames, le fermer et le répéter",
        "First frame of the span": "Première frame de l’intervalle",
        "Floor": "Sol",
        "Folder for captured motion, so the same footage is not captured twice; if empty, "
        "Blender's user "
        "folder": "Dossier des mouvements capturés, pour ne rien capturer deux fois ; vide : "
        "dossier utilisateur de Blender",
        "Foot": "Pied",
        "Footage": "Métrage",
        "Footage Opacity": "Opacité du métrage",
        "For Omniverse, Houdini and other studio "
        "tools": "Pour Omniverse, Houdini et d’autres outils de studio",
        "For Unreal Engine, Unity, Maya and MotionBuilder: armature, mesh and "
        "animation": "Pour Unreal Engine, Unity, Maya et MotionBuilder : armature, maillage et "
        "animation",
        "For engines that limit morph targets to "
        "0..1": "Pour les moteurs qui limitent les cibles de morphing à 0..1",
        "For research: SMPL-style arrays of the captured motion before any editing, one file per "
        "person": "Pour la recherche : tableaux à la SMPL du mouvement capturé avant toute "
        "édition, un fichier par personne",
        "For the web, Godot and other engines: one .glb file with "
        "everything": "Pour le web, Godot et d’autres moteurs : un seul fichier .glb avec tout",
        "Formats of captured motion": "Formats des mouvements capturés",
        "Forward": "Avant",
        "Found {count} bone; check the list": "{count} os trouvé ; vérifiez la liste",
        "Found {count} bones; check the list": "{count} os trouvés ; vérifiez la liste",
        "Found {count} controls; check the list": "{count} contrôleurs trouvés ; vérifiez la liste",
        "Found {count} shape key; check the "
        "list": "{count} clé de forme trouvée ; vérifiez la liste",
        "Found {count} shape keys; check the "
        "list": "{count} clés de forme trouvées ; vérifiez la liste",
        "Frame": "Frame",
        "Frame rate of the keys; 0: one key on each frame of the "
        "scene": "Fréquence d’images des clés ; 0 : une clé sur chaque frame de la scène",
        "Freed {size}": "{size} libérés",
        "From File": "Depuis un fichier",
        "Gigabytes of captured motion to keep; the least recently used is removed "
        "first": "Gigaoctets de mouvements capturés à garder ; les moins récemment utilisés sont "
        "supprimés d’abord",
        "Go to the frame that the warning is "
        "about": "Aller à la frame concernée par l’avertissement",
        "Hands": "Mains",
        "Head": "Tête",
        "Height of the most prominent person in centimetres; sets the scale of the scene. 0: "
        "estimated from the footage, for adults usually within 10 %; enter that of a "
        "child": "Taille de la personne principale en centimètres ; fixe l’échelle de la scène. 0 "
        ": estimée d’après le métrage, pour un adulte en général à 10 % près ; saisissez "
        "celle d’un enfant",
        "Height {heights}": "Taille {heights}",
        "Hide": "Cacher",
        "Hide the captured person, except when comparing with the "
        "footage": "Cacher la personne capturée, sauf pendant la comparaison avec le métrage",
        "How a control follows the expression, along the axes of the rig's "
        "face": "Comment un contrôleur suit l’expression, selon les axes du visage du rig",
        "How the body's shape is exported": "Comment la forme du corps est exportée",
        "How the captured person is shown after "
        "retargeting": "Comment la personne capturée est montrée après le reciblage",
        "Import Motion with Scope": "Importer un mouvement avec Scope",
        "Import captured motions of Scope, AMASS or other tools that use SMPL's joints, as "
        "animated "
        "bodies": "Importer comme corps animés des mouvements de Scope, d’AMASS ou d’autres outils "
        "utilisant les articulations de SMPL",
        "Imported {files}": "{files} importé",
        "In Bones": "Dans les os",
        "In Place": "Sur place",
        "In the Bones": "Dans les os",
        "In the Image": "Dans l’image",
        "In the Mesh": "Dans le maillage",
        "In this frame, a foot rests on the floor: move the capture and its camera up or down "
        "until it "
        "does": "Dans cette frame, un pied repose sur le sol : monter ou descendre la capture et "
        "sa caméra jusqu’à ce que ce soit le cas",
        "Include the rotation about the vertical axis in the root "
        "motion": "Inclure la rotation autour de l’axe vertical dans le mouvement racine",
        "Interpolated": "Interpolées",
        "It has run for {time}. The scene stays "
        "unchanged": "Elle est en cours depuis {time}. La scène reste inchangée",
        "It reports no formats": "Elle n'indique aucun format",
        "Joints ± {sigma:.1f} cm (standard deviation, "
        "median)": "Articulations ± {sigma:.1f} cm (écart type, médiane)",
        "Joint": "Articulation",
        "Keep": "Garder",
        "Keep Footage": "Conserver les images",
        "Keep a foot in place on the floor from the first to the last "
        "frame": "Garder un pied en place sur le sol de la première à la dernière frame",
        "Keep at Most (GB)": "Garder au plus (Go)",
        "Record the motion from now on; Stop writes it as "
        "keyframes": "Enregistrer le mouvement à partir de maintenant ; Arrêter l'écrit en images "
        "clés",
        "Keys": "Clés",
        "Keys per Second": "Clés par seconde",
        "Largest network, most accurate": "Le plus grand réseau, le plus précis",
        "Last Frame": "Dernière frame",
        "Last frame of the span, inclusive": "Dernière frame de l’intervalle, incluse",
        "Least Movement": "Mouvement minimal",
        "Leave the scene's frame rate; one key on each of its "
        "frames": "Laisser la fréquence d’images de la scène ; une clé sur chacune de ses frames",
        "Leave the scene's frame rate; the motion keeps its speed, with keys between "
        "frames": "Laisser la fréquence d’images de la scène ; le mouvement garde sa vitesse, avec "
        "des clés entre les frames",
        "Left": "Gauche",
        "Left Ankle": "Cheville gauche",
        "Left Elbow": "Coude gauche",
        "Left Foot": "Pied gauche",
        "Left Foot Stands": "Pied gauche posé",
        "Left Hip": "Hanche gauche",
        "Left Knee": "Genou gauche",
        "Left Shoulder": "Épaule gauche",
        "Left Wrist": "Poignet gauche",
        "Legs": "Jambes",
        "Legs Exchanged": "Jambes échangées",
        "Lens": "Objectif",
        "Lens: {lens}": "Objectif : {lens}",
        "Continue the capture": "Laisser la capture se poursuivre",
        "Make a captured body follow the person in front of the camera until the capture is "
        "stopped": "Faire suivre à un corps capturé la personne devant la caméra, jusqu'à l'arrêt",
        "Make the rig of the Retarget section follow as "
        "well": "Faire suivre aussi le rig de la section Recibler",
        "Level the World": "Mettre le monde à niveau",
        "Lift Sunken Feet": "Relever les pieds enfoncés",
        "Limbs": "Membres",
        "Live": "En direct",
        "Live capture cancelled; the scene is "
        "unchanged": "Capture en direct annulée ; la scène est inchangée",
        "Live capture needs Blender's window; in a shell, use "
        "./scripts/live": "La capture en direct a besoin de la fenêtre de Blender ; dans un "
        "terminal, utilisez ./scripts/live",
        "Live capture recorded": "Capture en direct enregistrée",
        "Live capture stopped": "Capture en direct arrêtée",
        "Load a bone map from a JSON file": "Charger une table des os depuis un fichier JSON",
        "Load an expression map from a JSON "
        "file": "Charger une table des expressions depuis un fichier JSON",
        "Loaded {file}": "{file} chargé",
        "Location": "Position",
        "Lock feet that are in contact, scaled to the rig, and keep them above the "
        "floor": "Verrouiller les pieds en contact, à l’échelle du rig, et les garder au-dessus du "
        "sol",
        "Lower Foot": "Pied le plus bas",
        "Mark the captured motion as an asset with a preview image of its pose, for other files' "
        "Asset Browser": "Marquer le mouvement capturé comme ressource, avec une image de sa pose, "
        "pour l’utiliser dans d’autres fichiers depuis le navigateur de "
        "ressources",
        "Maximum position error of the pelvis in "
        "millimetres": "Erreur maximale de position du bassin en millimètres",
        "Maximum rotation error of a bone in "
        "degrees": "Erreur maximale de rotation d’un os en degrés",
        "Mean distance in metres by which the joints must move within the cycle; 0 also loops a "
        "person who stays "
        "still": "Distance moyenne en mètres dont les articulations doivent bouger dans le cycle ; "
        "0 accepte aussi une personne immobile",
        "Mesh with shape keys, or rig whose bones move its face, to animate with the captured "
        "expressions": "Maillage à clés de forme, ou rig dont les os animent le visage, à animer "
        "avec les expressions capturées",
        "Metres": "Mètres",
        "Minimum duration of the cycle in seconds": "Durée minimale du cycle en secondes",
        "Morph targets whose values are the shape "
        "coefficients": "Cibles de morphing dont les valeurs sont les coefficients de forme",
        "Motion Capture": "Capture de mouvement",
        "Motion capture: animate a body with the motion of the person in a video or "
        "image": "Capture de mouvement : animer un corps avec le mouvement de la personne d’une "
        "vidéo ou d’une image",
        "Move the motion to a new track of the Nonlinear Animation editor, where takes are mixed "
        "and repeated": "Déplacer le mouvement vers une nouvelle piste de l’éditeur NLA, où les "
        "prises se mélangent et se répètent",
        "Moves forward, relative to mouth width, eye distance or lid "
        "gap": "Déplace vers l’avant ; en largeurs de bouche, distances des yeux, ouvertures des "
        "paupières",
        "Moves to the person's left, relative to mouth width, eye distance or lid "
        "gap": "Déplace vers la gauche de la personne ; en largeurs de bouche, distances des yeux, "
        "ouvertures des paupières",
        "Moves up, relative to mouth width, eye distance or lid "
        "gap": "Déplace vers le haut ; en largeurs de bouche, distances des yeux, ouvertures des "
        "paupières",
        "My Rig": "Mon rig",
        "Name": "Nom",
        "Name of the capture's collection": "Nom de la collection de la capture",
        "Name of the joint's bone": "Nom de l’os de l’articulation",
        "Name of the preset, used to make the path "
        "name": "Nom du préréglage, utilisé pour former le nom de fichier",
        "Networks on {processor}": "Réseaux sur {processor}",
        "New name of the take": "Nouveau nom de la prise",
        "No root motion: the character stays in "
        "place": "Pas de mouvement racine : le personnage reste sur place",
        "No root motion: the person stays in "
        "place": "Pas de mouvement racine : la personne reste sur place",
        "No shape keys: the shape is applied to the mesh, for engines that limit shape keys to "
        "0..1": "Pas de clés de forme : la forme est appliquée au maillage, pour les moteurs qui "
        "limitent les clés de forme à 0..1",
        "Nobody is seen": "Personne n'est visible",
        "Not seen for a moment": "Perdu de vue un instant",
        "No image from the source for {seconds:.0f} "
        "s": "Aucune image de la source depuis {seconds:.0f} s",
        "Number": "Nombre",
        "Number of the camera, 0 for the first; on Linux also its device, such as "
        "/dev/video2": "Numéro de la caméra, 0 pour la première ; sous Linux aussi son "
        "périphérique, comme /dev/video2",
        "On Object": "Sur l’objet",
        "On an Object": "Sur un objet",
        "One": "Une",
        "One unit is a centimetre, as most tools "
        "expect": "Une unité vaut un centimètre, comme l’attendent la plupart des outils",
        "One unit is a metre": "Une unité vaut un mètre",
        "Only the arms": "Seulement les bras",
        "Only the legs": "Seulement les jambes",
        "Only the motion of the skeleton, one file per "
        "person": "Seulement le mouvement du squelette, un fichier par personne",
        "Open the guide, which comes with Scope, in the web browser; the network is not "
        "used": "Ouvrir dans le navigateur web le guide fourni avec Scope ; le réseau n’est pas "
        "utilisé",
        "Options": "Options",
        "Overlap": "Superposer",
        "Part of the captured body that this bone "
        "follows": "Partie du corps capturé que cet os suit",
        "Pelvis": "Bassin",
        "Preview of Current Frame": "Aperçu de la frame actuelle",
        "Pin a joint to a place in one frame, and solve the motion around it "
        "again": "Épingler une articulation à un endroit dans une frame, et recalculer le "
        "mouvement autour",
        "Pin the joint only in the camera's image; its distance from the camera is free, except "
        "the pelvis's": "N’épingler l’articulation que dans l’image de la caméra ; sa distance à "
        "la caméra est libre, sauf celle du bassin",
        "Pitch": "Tangage",
        "Pixel of the footage, from its top "
        "left": "Pixel du métrage, depuis le coin supérieur gauche",
        "Play Scene": "Lire la scène",
        "Play the scene's animation from the First Frame while "
        "recording": "Lire l’animation de la scène à partir de « Première frame » pendant "
        "l’enregistrement",
        "Point of the scene": "Point de la scène",
        "Position": "Position",
        "Press Compare with Footage or switch to an orthographic side view; the line is drawn "
        "there": "Cliquez sur Comparer avec le métrage ou affichez une vue orthographique de côté "
        ": la ligne s’y trace",
        "Put feet in contact on the floor, which is at the height of the armature's "
        "origin": "Poser les pieds en contact sur le sol, qui est à la hauteur de l’origine de "
        "l’armature",
        "Quality": "Qualité",
        "Raise the frames in which a foot is below the "
        "floor": "Relever les frames où un pied est sous le sol",
        "Reach": "Portée",
        "Read focal lengths, principal point and distortion from a calibration "
        "file": "Lire focales, point principal et distorsion dans un fichier de calibration",
        "Read from the file's metadata if present, estimated "
        "otherwise": "Lue dans les métadonnées du fichier si elles existent, sinon estimée",
        "Recorded: {seconds:.1f} s": "Enregistré : {seconds:.1f} s",
        "Reduced {before} key to {after}; maximum error {angle:.2f} degrees for bones, "
        "{distance:.1f} mm for "
        "joints": "{before} clé réduite à {after} ; erreur maximale {angle:.2f} degrés pour les "
        "os, {distance:.1f} mm pour les articulations",
        "Reduced {before} keys to {after}; maximum error {angle:.2f} degrees for bones, "
        "{distance:.1f} mm for "
        "joints": "{before} clés réduites à {after} ; erreur maximale {angle:.2f} degrés pour les "
        "os, {distance:.1f} mm pour les articulations",
        "Refine": "Affiner",
        "Remove": "Supprimer",
        "Remove captured motion from the cache. Existing scenes and the compiled solver are not "
        "affected": "Supprimer du cache les mouvements capturés. Les scènes existantes et le "
        "solveur compilé ne sont pas affectés",
        "Remove keys within a maximum "
        "error": "Supprimer des clés dans la limite d’une erreur maximale",
        "Remove the correction and restore the motion around "
        "it": "Supprimer la correction ; le mouvement autour redevient ce qu’il était sans elle",
        "Remove the selected entry": "Supprimer l’entrée sélectionnée",
        "Rename it with Object > Motion Capture > Rename "
        "Take": "Pour la renommer : Objet > Capture de mouvement > Renommer la prise",
        "Rename the capture with its objects and actions; exported animation has the same "
        "name": "Renommer la capture avec ses objets et actions ; l’animation exportée porte le "
        "même nom",
        "Repeat": "Répéter",
        "Repeat the curves; each cycle starts where the previous one "
        "ended": "Répéter les courbes ; chaque cycle commence là où le précédent finit",
        "Replace frames by an interpolation between the pose before and the pose after "
        "them": "Remplacer des frames par une interpolation entre la pose d’avant et celle d’après",
        "Replace the keys by keys at a constant frame "
        "rate": "Remplacer les clés par des clés à fréquence constante",
        "Replaced {before} key by {after}": "{before} clé remplacée par {after}",
        "Replaced {before} keys by {after}": "{before} clés remplacées par {after}",
        "Reprojection error {pixels:.1f} px": "Erreur de reprojection {pixels:.1f} px",
        "Resample to Scene": "Rééchantillonner à la scène",
        "Result": "Résultat",
        "Retarget": "Recibler",
        "Rig": "Rig",
        "Rig Follows": "Le rig suit",
        "Right": "Droite",
        "Right Ankle": "Cheville droite",
        "Right Elbow": "Coude droit",
        "Right Foot": "Pied droit",
        "Right Foot Stands": "Pied droit posé",
        "Right Hip": "Hanche droite",
        "Right Knee": "Genou droit",
        "Right Shoulder": "Épaule droite",
        "Right Wrist": "Poignet droit",
        "Roll": "Roulis",
        "Root Motion": "Mouvement racine",
        "Rotate the motion so that all foot contacts are level, after which the camera no longer "
        "matches": "Tourner le mouvement pour que tous les contacts des pieds soient de niveau ; "
        "ensuite la caméra ne correspond plus",
        "Rotation": "Rotation",
        "Scale of positions on the floor. 0: the ratio of leg lengths, so that steps fit the rig. "
        "Several people who touch or meet need the same value for all their "
        "rigs": "Échelle des positions au sol. 0 : le rapport des longueurs de jambe, pour que les "
        "pas conviennent au rig. Des personnes qui se touchent ou se rencontrent ont "
        "besoin de la même valeur pour tous leurs rigs",
        "Show this capture": "Afficher cette capture",
        "Save the bone map as a JSON file for similar "
        "rigs": "Enregistrer la table des os en fichier JSON pour des rigs similaires",
        "Save the expression map as a JSON file for similar "
        "faces": "Enregistrer la table des expressions en fichier JSON pour des visages similaires",
        "Saved {file}": "{file} enregistré",
        "Scene": "Scène",
        "Scene frame": "Frame de la scène",
        "Scope: {progress}   (Esc over the Scope panel to "
        "cancel)": "Scope : {progress}   (Échap au-dessus du panneau Scope pour annuler)",
        "Seconds before and after the frame over which the correction fades "
        "out": "Secondes avant et après la frame sur lesquelles la correction s’estompe",
        "Select a Captured Person": "Sélectionnez une personne capturée",
        "Select the armature of a capture first": "Sélectionnez d’abord l’armature d’une capture",
        "Select the captured person whose face to "
        "retarget": "Sélectionnez la personne capturée dont le visage est à recibler",
        "Selected": "Sélectionnée",
        "Set Frame Range": "Intervalle de frames",
        "Set Scene Frame Rate": "Définir la fréquence d’images de la scène",
        "Set from Footage": "Celle du métrage",
        "Set the scene to the motion's frame rate. Captures keep their speed, other animation "
        "keeps its "
        "frames": "Donner à la scène la fréquence d’images du mouvement. Les captures gardent leur "
        "vitesse, les autres animations leurs numéros d’image",
        "Set the scene's frame rate to the "
        "footage's": "Donner à la scène la fréquence d’images du métrage",
        "Set the scene's frame rate to the footage's unless something in the scene is "
        "animated": "Donner à la scène la fréquence d’images du métrage, sauf si quelque chose y "
        "est animé",
        "Set the scene's frame rate to the motion's; otherwise keys may be between "
        "frames": "Donner à la scène la fréquence d’images du mouvement ; sinon des clés peuvent "
        "tomber entre les frames",
        "Several people are captured: select the armature of the one whose motion to "
        "retarget": "Plusieurs personnes sont capturées : sélectionnez l’armature de celle dont le "
        "mouvement est à recibler",
        "Shape": "Forme",
        "Shape Key": "Clé de forme",
        "Shape Key or Control": "Clé de forme ou contrôleur",
        "Shape Keys": "Clés de forme",
        "Shape Keys per Frame": "Clés de forme par frame",
        "Shape key of your mesh, or bone of your rig's "
        "face": "Clé de forme de votre maillage, ou os du visage de votre rig",
        "Shape keys, or in the mesh for formats whose readers limit shape "
        "keys": "Clés de forme, ou dans le maillage pour les formats dont les lecteurs limitent "
        "les clés de forme",
        "Shortest": "Durée minimale",
        "Show both in the same place": "Montrer les deux au même endroit",
        "Show both, the rig to the left of the captured "
        "person": "Montrer les deux, le rig à gauche de la personne capturée",
        "Show the captured body from its side in a second viewport, beside the one with the "
        "footage": "Montrer le corps capturé de profil dans une seconde vue, à côté de celle du "
        "métrage",
        "Show the pose of the current frame in the preview image, instead of the first one that "
        "needs no "
        "review": "Montrer dans l’image la pose de la frame actuelle, au lieu de la première qui "
        "ne demande pas de vérification",
        "Side by Side": "Côte à côte",
        "Sides Exchanged": "Côtés échangés",
        "Slightly less accurate than Best, and "
        "faster": "Un peu moins précise que Meilleure, et plus rapide",
        "Smallest network: for a first look or a slow "
        "computer": "Le plus petit réseau : pour un premier aperçu ou un ordinateur lent",
        "Smooth the captured motion again, more or less strongly. Keeps corrections, discards "
        "other changes": "Lisser de nouveau le mouvement capturé, plus ou moins fort. Garde les "
        "corrections, perd les autres changements",
        "Source": "Source",
        "Start": "Début",
        "Stop the Capture?": "Arrêter la capture ?",
        "Stop the live capture. What was recorded is written as keyframes; otherwise the last pose "
        "stays": "Arrêter la capture en direct. Ce qui a été enregistré est écrit en images clés ; "
        "sinon, la dernière pose reste",
        "Stream": "Flux",
        "Strength": "Force",
        "Swap the left and right limbs within a span of "
        "frames": "Permuter les membres gauches et droits dans un intervalle de frames",
        "Take": "Prise",
        "The axis along which the person is upright": "Axe le long duquel la personne est debout",
        "The body's shape as shape keys with one keyframe "
        "each": "La forme du corps en clés de forme, avec une image clé chacune",
        "The built-in body with SMPL's 24 "
        "joints": "Le corps intégré avec les 24 articulations de SMPL",
        "The built-in body with SMPL+H's 52 joints, fingers "
        "included": "Le corps intégré avec les 52 articulations de SMPL+H, doigts compris",
        "The capture does not say where its footage "
        "is": "La capture n’indique pas où est son métrage",
        "The capture is linked from {file}: make it "
        "local": "La capture est liée depuis {file} : rendez-la locale",
        "The capture that is selected in the panel, with all its "
        "people": "La capture sélectionnée dans le panneau, avec toutes ses personnes",
        "The capture that the active object belongs "
        "to": "La capture à laquelle appartient l’objet actif",
        "The captured person was deleted": "La personne capturée a été supprimée",
        "The collection '{name}' is hidden; show it in the "
        "Outliner": "La collection '{name}' est cachée ; affichez-la dans le synoptique",
        "The corrections put a foot up to {depth:.0f} cm under the floor: move the pin "
        "up": "Les corrections placent un pied jusqu’à {depth:.0f} cm sous le sol : remontez "
        "l’épingle",
        "The corrections put a foot up to {depth:.0f} cm under the floor in {count} of {total} "
        "frames: move the pin "
        "up": "Les corrections placent un pied jusqu’à {depth:.0f} cm sous le sol dans {count} "
        "images sur {total} : remontez l’épingle",
        "The footage is already in the sequencer": "Le métrage est déjà dans le séquenceur",
        "The left foot": "Le pied gauche",
        "The lower one of the two in this frame": "Le plus bas des deux dans cette frame",
        "The most prominent people, up to a "
        "number": "Les personnes principales, jusqu’à un certain nombre",
        "The most prominent person": "La personne principale",
        "The pelvis moves through the scene": "Le bassin se déplace dans la scène",
        "The pelvis moves through the scene, as "
        "captured": "Le bassin se déplace dans la scène, tel que capturé",
        "The processor": "Le processeur",
        "The rig chosen under Retarget, with its current animation and its "
        "meshes": "Le rig choisi sous Recibler, avec son animation actuelle et ses maillages",
        "The right foot": "Le pied droit",
        "The same, with a keyframe on every frame": "Idem, avec une image clé sur chaque frame",
        "The scene contains no capture yet": "La scène ne contient pas encore de capture",
        "The scene contains no captured video or imported "
        "motion": "La scène ne contient aucune vidéo capturée ni mouvement importé",
        "The scene has no camera of a capture: capture with the option Camera with "
        "Footage": "La scène n’a aucune caméra de capture : capturez avec l’option Caméra avec "
        "métrage",
        "The scene has {rate:.5g} frames/s, like the "
        "motion": "La scène a {rate:.5g} images/s, comme le mouvement",
        "The scene has {rate:.5g} frames/s; animation that was not captured plays {factor:.3g} "
        "times as "
        "fast": "La scène a {rate:.5g} images/s ; les animations non capturées vont {factor:.3g} "
        "fois plus vite",
        "The scene has {scene:.5g} frames/s and the footage {footage:.5g}: the strip will not stay "
        "synchronized with the "
        "motion": "La scène a {scene:.5g} images/s et le métrage {footage:.5g} : la bande ne "
        "restera pas synchronisée avec le mouvement",
        "The scene's frame rate was changed from {was:.5g} to {now:.5g}, which changed the "
        "motion's speed; importing an FBX file does "
        "that": "La fréquence d’images de la scène est passée de {was:.5g} à {now:.5g}, ce qui a "
        "changé la vitesse du mouvement ; l’import d’un fichier FBX a cet effet",
        "This Blender was built without USD; use a build from blender.org, or another "
        "format": "Ce Blender est compilé sans USD ; utilisez une version de blender.org ou un "
        "autre format",
        "This motion was captured on uneven ground, where feet rest at any height: use Floor "
        "Here": "Ce mouvement a été capturé sur un sol irrégulier, où les pieds reposent à "
        "n’importe quelle hauteur : utilisez « Le sol est ici »",
        "Threads": "Threads",
        "Toggle the view of the body over the footage. Sets the scene's camera and "
        "resolution": "Afficher ou non le corps sur le métrage. Définit la caméra et la résolution "
        "de la scène",
        "Transfer the captured expressions to the mesh's shape keys or the rig's face, as a new "
        "action": "Transférer les expressions capturées aux clés de forme du maillage ou au visage "
        "du rig, dans une nouvelle action",
        "Transfer the captured motion to your rig, as a new action. One of the same capture is "
        "replaced if "
        "unchanged": "Transférer le mouvement capturé à votre rig, en nouvelle action. Celle de la "
        "même capture est remplacée si elle est inchangée",
        "Travel Scale": "Échelle du trajet",
        "Turn the capture and its camera so that a line in an orthographic view from a side is "
        "upright": "Tourner la capture et sa caméra pour qu’une ligne d’une vue orthographique de "
        "côté soit verticale",
        "Turn the capture and its camera so that a line in the footage is "
        "upright": "Tourner la capture et sa caméra pour qu’une ligne du métrage soit verticale",
        "Turns down, in degrees": "Tourne vers le bas, en degrés",
        "Turns to the person's left, in degrees": "Tourne vers la gauche de la personne, en degrés",
        "Turns with the left side up, in degrees": "Tourne côté gauche vers le haut, en degrés",
        "Uneven Ground": "Sol irrégulier",
        "Upright Line": "Ligne verticale",
        "Use the short clip that is included with "
        "Scope": "Utiliser le court clip fourni avec Scope",
        "Use this in the viewport with the footage": "À utiliser dans la vue avec le métrage",
        "Value of a shape key": "Valeur d’une clé de forme",
        "Value where the expression is 1: at most 10, or 180 degrees; several expressions add "
        "up": "Valeur là où l’expression vaut 1 : au plus 10, ou 180 degrés ; plusieurs "
        "expressions s’additionnent",
        "Video": "Vidéo",
        "Video of a person, which is played in real "
        "time": "Vidéo d'une personne, lue en temps réel",
        "Video or image of a person to capture": "Vidéo ou image d’une personne à capturer",
        "Wait until somebody is seen": "Attendez que quelqu'un soit visible",
        "Waiting for the source": "En attente de la source",
        "Warnings": "Avertissements",
        "What to export": "Ce qu’il faut exporter",
        "Where the joint is in that frame": "Où est l’articulation dans cette frame",
        "Source of the images": "D'où viennent les images",
        "Where the root motion is stored": "Où le mouvement racine est stocké",
        "Where the root motion of the rig is stored": "Où le mouvement racine du rig est stocké",
        "Which foot rests on the floor": "Quel pied repose sur le sol",
        "Which foot stands": "Quel pied est posé",
        "Which limbs are exchanged": "Quels membres sont échangés",
        "Who made this asset": "Qui a créé cette ressource",
        "With Heading": "Avec l’orientation",
        "A foot is up to {depth:.0f} cm under this floor in {count} of {total} frames: press Floor "
        "Here in a frame in which it rests on the floor, or use Snap Feet to "
        "Floor": "Avec ce sol, un pied est jusqu’à {depth:.0f} cm en dessous dans {count} images "
        "sur {total} : appuyez sur « Le sol est ici » dans une image où il est posé, ou "
        "utilisez « Poser les pieds au sol »",
        "Write a separate file for each person": "Écrire un fichier par personne",
        "Write captures to a file": "Écrire des captures dans un fichier",
        "Write the recorded images of a camera or stream as a video beside the .blend file, from "
        "which a more accurate motion of the same take can be "
        "captured": "Écrire les images enregistrées d’une caméra ou d’un flux dans une vidéo à "
        "côté du fichier .blend, à partir de laquelle un mouvement plus précis de la "
        "même prise peut être capturé",
        "Writing the recording": "Écriture de l'enregistrement",
        "Wrote {files} in {folder}": "{files} écrit dans {folder}",
        "Y points down, as in the camera's axes of pose estimation "
        "networks": "Y pointe vers le bas, comme les axes de caméra des réseaux d’estimation de "
        "pose",
        "Y points up, as in AIST++ and most "
        "engines": "Y pointe vers le haut, comme dans AIST++ et la plupart des moteurs",
        "Yaw": "Lacet",
        "Your own SMPL, SMPL+H, SMPL-X or STAR "
        "file": "Votre propre fichier SMPL, SMPL+H, SMPL-X ou STAR",
        "Z points up, as in AMASS": "Z pointe vers le haut, comme dans AMASS",
        "removed": "supprimée",
        "{count} bone": "{count} os",
        "{count} bones": "{count} os",
        "{count} entries": "{count} entrées",
        "{count} entry": "{count} entrée",
        "{count} frame": "{count} frame",
        "{count} frames": "{count} frames",
        "{count} people": "{count} personnes",
        "{count} person": "{count} personne",
        "{frames}, captured in {time}": "{frames}, capturées en {time}",
        "{joint} cannot reach the pin and stays {distance} away: move the pin closer, or pin the "
        "pelvis too": "{joint} n’atteint pas l’épingle et reste à {distance} : rapprochez "
        "l’épingle, ou épinglez aussi le bassin",
        "{path} is not a file; choose a video or "
        "image": "{path} n’est pas un fichier ; choisissez une vidéo ou une image",
        "{rate:.0f} pose/s, latency {latency:.0f} "
        "ms": "{rate:.0f} pose/s, latence {latency:.0f} ms",
        "{rate:.0f} poses/s, latency {latency:.0f} "
        "ms": "{rate:.0f} poses/s, latence {latency:.0f} ms",
        "{size} of captures in {folder}": "{size} de captures dans {folder}",
    }
)
