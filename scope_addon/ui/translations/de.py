# SPDX-License-Identifier: GPL-3.0-or-later
"""German."""

from .operators.de import OPERATORS as OPERATORS
from .options.de import OPTIONS
from .stages.de import STAGES

TEXTS = (
    STAGES
    | OPTIONS
    | {
        "'{action}' is an asset of this file; save the file in an asset "
        "library": "'{action}' ist ein Asset dieser Datei; die Datei in einer Asset-Bibliothek "
        "speichern",
        "'{action}' is now an asset": "'{action}' ist jetzt ein Asset",
        "'{mesh}' is linked from {file}, so its keyframes would not be saved in this file: make it "
        "local": "'{mesh}' ist aus {file} verknüpft, die Schlüsselbilder würden nicht in dieser "
        "Datei gespeichert: lokal machen",
        "'{mesh}' is now animated by the action "
        "'{action}'": "'{mesh}' wird jetzt von der Aktion '{action}' animiert",
        "'{name}' has no action; choose one in the Action "
        "Editor": "'{name}' hat keine Aktion; im Aktionseditor eine wählen",
        "'{name}' is linked from {file}: make it "
        "local": "'{name}' ist aus {file} verknüpft: lokal machen",
        "'{name}' or its motion is linked from {file}, so changes would be lost: make both local "
        "(Object > Relations > Make Local > All) or edit them in that "
        "file": "'{name}' oder die zugehörige Bewegung ist aus {file} verknüpft, Änderungen gingen "
        "verloren: beides lokal machen (Objekt > Beziehungen > Lokal machen > Alle) oder "
        "in jener Datei bearbeiten",
        "'{rig}' is linked from {file}, so its motion would not be saved in this file: make an "
        "override of it (Object > Library Override > "
        "Make)": "'{rig}' ist aus {file} verknüpft, die Bewegung würde nicht in dieser Datei "
        "gespeichert: eine Überschreibung anlegen (Objekt > Bibliothek überschreiben > "
        "Erstellen)",
        "'{rig}' is not in the scene's view layer: add it to the scene, or enable its collection "
        "in the Outliner": "'{rig}' ist nicht in der Ansichtsebene der Szene: zur Szene hinzufügen "
        "oder die Sammlung im Outliner aktivieren",
        "'{rig}' is now animated by the action "
        "'{action}'": "'{rig}' wird jetzt von der Aktion '{action}' animiert",
        "'{rig}' is now animated by the action '{action}', with positions on the floor scaled by "
        "{scale:.3f}": "'{rig}' wird jetzt von der Aktion '{action}' animiert, Positionen auf dem "
        "Boden mit {scale:.3f} skaliert",
        "'{strip}' is now a strip of {armature}'s NLA; to edit its keys, enter Tweak Mode (key "
        "Tab)": "'{strip}' ist jetzt ein NLA-Streifen von {armature}; zum Bearbeiten der "
        "Schlüsselbilder in den Anpassungsmodus gehen (Taste Tab)",
        "0 keeps every frame as captured, 1 is the default of a capture, higher values smooth "
        "more": "0 lässt jedes Bild wie erfasst, 1 ist der Standard einer Erfassung, höhere Werte "
        "glätten stärker",
        "35 mm Equivalent": "Kleinbildäquivalent (35 mm)",
        "35 mm equivalent focal length in millimetres; a phone's main camera has about "
        "26": "Kleinbildäquivalente Brennweite in Millimetern; die Hauptkamera eines Telefons hat "
        "etwa 26",
        "A camera is in use; wait for it or stop "
        "it": "Eine Kamera ist in Gebrauch; abwarten oder anhalten",
        "A camera of this computer": "Eine Kamera dieses Computers",
        "A capture is running; wait for it or cancel "
        "it": "Eine Erfassung läuft; abwarten oder abbrechen",
        "A network camera or another stream": "Eine Netzwerkkamera oder ein anderer Stream",
        "A supported GPU if there is one, otherwise the "
        "CPU": "Eine unterstützte GPU, falls vorhanden, sonst die CPU",
        "A video that is played in real time": "Ein Video, das in Echtzeit abgespielt wird",
        "Active": "Aktiv",
        "Add": "Hinzufügen",
        "Add an entry": "Einen Eintrag hinzufügen",
        "Add an entry to the bone map, or remove the selected "
        "one": "Einen Eintrag zur Knochenzuordnung hinzufügen oder den gewählten entfernen",
        "Add an entry to the expression map, or remove the selected "
        "one": "Einen Eintrag zur Mimikzuordnung hinzufügen oder den gewählten entfernen",
        "Add the capture settings as a preset, or remove a "
        "preset": "Die Einstellungen der Erfassung als Vorgabe hinzufügen, oder eine Vorgabe "
        "entfernen",
        "Add the footage with its sound to the video sequencer, synchronized with the "
        "motion": "Das Filmmaterial mit Ton synchron zur Bewegung in den Video-Sequenzer einfügen",
        "Address": "Adresse",
        "Address of the stream, such as rtsp://192.168.1.20/stream; name and password in it are "
        "kept until Blender ends, and never "
        "saved": "Adresse des Streams, etwa rtsp://192.168.1.20/stream; Name und Passwort darin "
        "bleiben erhalten, bis Blender endet, und werden nie gespeichert",
        "All four limbs": "Alle vier Gliedmaßen",
        "All in the Scene": "Alle in der Szene",
        "An NVIDIA GPU": "Eine NVIDIA-GPU",
        "An NVIDIA GPU with TensorRT, which takes minutes to compile each network on first "
        "use": "Eine NVIDIA-GPU mit TensorRT, das jedes Netz beim ersten Mal minutenlang "
        "kompiliert",
        "An empty carries position and heading, the rig moves relative to "
        "it": "Ein leeres Objekt trägt Position und Richtung, das Rig bewegt sich relativ dazu",
        "An empty on the floor carries the root "
        "motion": "Ein leeres Objekt auf dem Boden trägt die Wurzelbewegung",
        "Angle": "Winkel",
        "Any GPU on Windows": "Jede GPU unter Windows",
        "Apple silicon": "Apple-Prozessoren",
        "Armature to animate with the captured "
        "motion": "Skelett, das mit der erfassten Bewegung animiert wird",
        "Arms": "Arme",
        "Arms Exchanged": "Arme vertauscht",
        "Arms and Legs": "Arme und Beine",
        "Query the camera's formats, without taking an image. macOS may ask for "
        "permission": "Die Kamera nach ihren Formaten fragen, ohne ein Bild aufzunehmen. macOS "
        "fragt eventuell, ob sie benutzt werden darf",
        "Querying the camera": "Die Kamera wird gefragt",
        "Assign the face's shape keys, named as by ARKit, Oculus or VRM, or the controls of a "
        "known rig to "
        "expressions": "Die Formschlüssel des Gesichts, benannt wie bei ARKit, Oculus oder VRM, "
        "oder die Steuerknochen eines bekannten Rigs Ausdrücken zuordnen",
        "Assign the rig's bones to body parts by their names and rest "
        "pose": "Knochen des Rigs nach Namen und Ruhepose den Körperteilen zuordnen",
        "Author": "Autor",
        "Automatic": "Automatisch",
        "Balanced": "Ausgewogen",
        "Best": "Am besten",
        "Blend": "Überblendung",
        "Body": "Körper",
        "Body File": "Körperdatei",
        "Body Part": "Körperteil",
        "Body with Hands": "Körper mit Händen",
        "Bone": "Knochen",
        "Bone of your rig": "Knochen des eigenen Rigs",
        "Choose the file in the file browser": "Die Datei im Dateibrowser wählen",
        "Cache Folder": "Cache-Ordner",
        "Cache Size": "Cache-Größe",
        "Camera": "Kamera",
        "Camera (-Y)": "Kamera (-Y)",
        "Cancel the capture; the scene stays "
        "unchanged": "Die Erfassung abbrechen; die Szene bleibt unverändert",
        "Cancel the live capture; the scene stays unchanged, and nothing is "
        "recorded": "Die Live-Erfassung abbrechen; die Szene bleibt unverändert, und nichts wird "
        "aufgenommen",
        "Capture": "Erfassung",
        "Capture Presets": "Erfassungsvorgaben",
        "Capture cancelled; the scene is "
        "unchanged": "Erfassung abgebrochen; die Szene ist unverändert",
        "Capture finished": "Erfassung beendet",
        "Capture motion from video, and view, edit, retarget and export captured "
        "motion": "Bewegung aus Video erfassen, und erfasste Bewegung ansehen, bearbeiten, "
        "übertragen und exportieren",
        "Leave the fingers at rest": "Finger in Ruhehaltung lassen",
        "Capture hands that are large enough in the image to be "
        "read": "Hände erfassen, die im Bild groß genug dafür sind",
        "Capture hands of all sizes": "Hände jeder Größe erfassen",
        "Off": "Aus",
        "On": "Ein",
        "Capture the person in the footage as an animated body, while Blender stays "
        "usable": "Die Person im Filmmaterial als animierten Körper erfassen, während Blender "
        "benutzbar bleibt",
        "Capture whose result the panel shows": "Erfassung, deren Ergebnis gezeigt wird",
        "Capture with Scope": "Mit Scope erfassen",
        "Captured Body": "Erfasster Körper",
        "Captured Motion (Mocap)": "Erfasste Bewegung (Mocap)",
        "Captured Motion as {format} (.{suffix})": "Erfasste Bewegung als {format} (.{suffix})",
        "Captured expression that this entry "
        "follows": "Erfasster Ausdruck, dem dieser Eintrag folgt",
        "Captured from {source}, {seconds:.1f} s": "Erfasst aus {source}, {seconds:.1f} s",
        "Captures": "Erfassungen",
        "Catalog": "Katalog",
        "Catalog of the Asset Browser, such as Motions/Walks; unassigned if left "
        "empty": "Katalog des Asset-Browsers, etwa Bewegungen/Gehen; wenn leer, nicht zugewiesen",
        "Centimetres": "Zentimeter",
        "Channel": "Kanal",
        "Choose a mesh with shape keys, or a rig with face controls, "
        "first": "Zuerst ein Mesh mit Formschlüsseln oder ein Rig mit Gesichtssteuerung wählen",
        "Choose a video or image first": "Zuerst ein Video oder Bild wählen",
        "Choose a video or image of a person": "Ein Video oder Bild einer Person wählen",
        "Choose where the person's root motion is "
        "stored": "Wählen, wo die Wurzelbewegung der Person gespeichert wird",
        "Choose your rig first": "Zuerst das eigene Rig wählen",
        "Compare with Footage first": "Zuerst mit dem Filmmaterial vergleichen",
        "Compiling the solver in the background, {percent:.0f} "
        "%": "Löser wird im Hintergrund kompiliert, {percent:.0f} %",
        "Confidence": "Sicherheit",
        "Confidence of the guess": "Sicherheit der Vermutung",
        "Corrections": "Korrekturen",
        "Countdown (s)": "Countdown (s)",
        "Counted from 0; -1 removes all": "Ab 0 gezählt; -1 entfernt alle",
        "Custom SMPL, SMPL+H, SMPL-X or STAR model, for scenes without a body file of their "
        "own": "Eigenes SMPL-, SMPL+H-, SMPL-X- oder STAR-Modell für Szenen ohne eigene "
        "Körperdatei",
        "Custom detector (.onnx): YOLOX, YOLOv4, YOLOv8 and similar; built-in if "
        "empty": "Eigener Detektor (.onnx): YOLOX, YOLOv4, YOLOv8 und ähnliche; leer: der "
        "eingebaute",
        "Custom keypoint network (.onnx): RTMPose, HRNet, ViTPose and similar; built-in if "
        "empty": "Eigenes Keypoint-Netz (.onnx): RTMPose, HRNet, ViTPose und ähnliche; leer: das "
        "eingebaute",
        "Cycle of {seconds:.2f} s; before closing, its ends were {distance:.1f} cm "
        "apart": "Zyklus von {seconds:.2f} s; vor dem Schließen lagen die Enden {distance:.1f} cm "
        "auseinander",
        "Description": "Beschreibung",
        "Description of the asset; the footage and its duration if left "
        "empty": "Beschreibung des Assets; wenn leer, Filmmaterial und Dauer",
        "Details": "Details",
        "Direction": "Richtung",
        "Direction of the scene in which the view "
        "looks": "Richtung der Szene, in die die Ansicht blickt",
        "Drag a handle to where the joint is.  Scrub or play to go to other frames.  Esc or Enter: "
        "done": "Einen Griff dorthin ziehen, wo das Gelenk ist.  Scrubben oder abspielen für "
        "andere Bilder.  Esc oder Eingabe: fertig",
        "Drag handles on the body to where the joints are in this frame; the motion around is "
        "solved again": "Griffe am Körper dorthin ziehen, wo die Gelenke in diesem Bild sind; die "
        "Bewegung ringsum wird neu berechnet",
        "Draw a line along something upright: a door or post in the footage, or a standing person "
        "in a side view.  Esc: "
        "cancel": "Eine Linie entlang von etwas Senkrechtem ziehen: im Filmmaterial Tür oder "
        "Pfosten, in einer Ansicht von der Seite jemand, der steht.  Esc: abbrechen",
        "Draw a line along something upright, in the footage or a side view; it rotates the "
        "capture and its "
        "camera": "Im Filmmaterial oder von der Seite eine Linie entlang von etwas Senkrechtem "
        "ziehen; Erfassung und Kamera drehen sich mit",
        "Duration in seconds, at the end of the cycle, over which it is "
        "closed": "Dauer in Sekunden am Ende des Zyklus, über die er geschlossen wird",
        "End": "Ende",
        "Enter the 35 mm equivalent focal length": "Kleinbildäquivalente Brennweite eingeben",
        "Enter the field of view along the longer side of the "
        "image": "Bildwinkel entlang der längeren Bildseite eingeben",
        "Every capture of the scene, with all its "
        "people": "Jede Erfassung der Szene mit allen Personen",
        "Everyone": "Alle",
        "Everyone who is clearly visible": "Alle deutlich sichtbaren Personen",
        "Exchange left and right from the first to the last frame; applying it again undoes "
        "it": "Links und rechts vom ersten bis zum letzten Bild vertauschen; noch einmal dasselbe "
        "macht es rückgängig",
        "Execution provider for the networks; if unavailable, the CPU is used and the result shows "
        "a warning": "Recheneinheit für die Netze; falls nicht verfügbar, wird die CPU benutzt und "
        "das Ergebnis zeigt eine Warnung",
        "Export": "Exportieren",
        "Export the estimated camera": "Die geschätzte Kamera exportieren",
        "Expression": "Ausdruck",
        "Face": "Gesicht",
        "Factor": "Faktor",
        "Fast": "Schnell",
        "Feet on the Floor": "Füße auf dem Boden",
        "File": "Datei",
        "File per Person": "Datei pro Person",
        "Find the best cycle within a span of frames, close it, and repeat "
        "it": "Den besten Zyklus in einem Bildbereich finden, schließen und wiederholen",
        "First frame of the span": "Erstes Bild des Bereichs",
        "Floor": "Boden",
        "Folder for captured motion, so the same footage is not captured twice; if empty, "
        "Blender's user "
        "folder": "Ordner für erfasste Bewegungen, damit nichts zweimal erfasst wird; leer: "
        "Blenders Benutzerordner",
        "Foot": "Fuß",
        "Footage": "Filmmaterial",
        "Footage Opacity": "Deckkraft des Filmmaterials",
        "For Omniverse, Houdini and other studio "
        "tools": "Für Omniverse, Houdini und andere Studiowerkzeuge",
        "For Unreal Engine, Unity, Maya and MotionBuilder: armature, mesh and "
        "animation": "Für Unreal Engine, Unity, Maya und MotionBuilder: Skelett, Mesh und "
        "Animation",
        "For engines that limit morph targets to "
        "0..1": "Für Engines, die Morph-Targets auf 0..1 begrenzen",
        "For research: SMPL-style arrays of the captured motion before any editing, one file per "
        "person": "Für die Forschung: Arrays der erfassten Bewegung vor jeder Bearbeitung, im Stil "
        "von SMPL, eine Datei pro Person",
        "For the web, Godot and other engines: one .glb file with "
        "everything": "Für Web, Godot und andere Engines: eine .glb-Datei mit allem",
        "Formats of captured motion": "Formate für erfasste Bewegung",
        "Forward": "Vorwärts",
        "Found {count} bone; check the list": "{count} Knochen gefunden; bitte die Liste prüfen",
        "Found {count} bones; check the list": "{count} Knochen gefunden; bitte die Liste prüfen",
        "Found {count} controls; check the "
        "list": "{count} Steuerknochen gefunden; die Liste prüfen",
        "Found {count} shape key; check the "
        "list": "{count} Formschlüssel gefunden; die Liste prüfen",
        "Found {count} shape keys; check the "
        "list": "{count} Formschlüssel gefunden; die Liste prüfen",
        "Frame": "Bild",
        "Frame rate of the keys; 0: one key on each frame of the "
        "scene": "Bildrate der Schlüsselbilder; 0: eines auf jedem Bild der Szene",
        "Freed {size}": "{size} freigegeben",
        "From File": "Aus Datei",
        "Gigabytes of captured motion to keep; the least recently used is removed "
        "first": "Gigabyte an erfassten Bewegungen, die behalten werden; die am längsten "
        "unbenutzten werden zuerst entfernt",
        "Go to the frame that the warning is "
        "about": "Zum Bild gehen, um das es in der Warnung geht",
        "Hands": "Hände",
        "Head": "Kopf",
        "Height of the most prominent person in centimetres; sets the scale of the scene. 0: "
        "estimated from the footage, for adults usually within 10 %; enter that of a "
        "child": "Größe der auffälligsten Person in Zentimetern; bestimmt den Maßstab der Szene. "
        "0: aus dem Filmmaterial geschätzt, bei Erwachsenen meist auf 10 % genau; die "
        "eines Kindes eingeben",
        "Height {heights}": "Größe {heights}",
        "Hide": "Verbergen",
        "Hide the captured person, except when comparing with the "
        "footage": "Die erfasste Person verbergen, außer beim Vergleich mit dem Filmmaterial",
        "How a control follows the expression, along the axes of the rig's "
        "face": "Wie ein Steuerknochen dem Ausdruck folgt, entlang der Achsen des Gesichts",
        "How the body's shape is exported": "Wie die Körperform exportiert wird",
        "How the captured person is shown after "
        "retargeting": "Wie die erfasste Person nach der Übertragung gezeigt wird",
        "Import Motion with Scope": "Bewegung mit Scope importieren",
        "Import captured motions of Scope, AMASS or other tools that use SMPL's joints, as "
        "animated "
        "bodies": "Erfasste Bewegungen von Scope, AMASS oder anderen Werkzeugen mit SMPL-Gelenken "
        "als animierte Körper importieren",
        "Imported {files}": "{files} importiert",
        "In Bones": "In Knochen",
        "In Place": "Am Ort",
        "In the Bones": "In den Knochen",
        "In the Image": "Im Bild",
        "In the Mesh": "Im Mesh",
        "In this frame, a foot rests on the floor: move the capture and its camera up or down "
        "until it "
        "does": "In diesem Bild ruht ein Fuß auf dem Boden: Erfassung und Kamera nach oben oder "
        "unten bewegen, bis er es tut",
        "Include the rotation about the vertical axis in the root "
        "motion": "Die Drehung um die Hochachse in die Wurzelbewegung einschließen",
        "Interpolated": "Interpoliert",
        "It has run for {time}. The scene stays "
        "unchanged": "Sie läuft seit {time}. Die Szene bleibt unverändert",
        "It reports no formats": "Sie nennt keine Formate",
        "Joints ± {sigma:.1f} cm (standard deviation, "
        "median)": "Gelenke ± {sigma:.1f} cm (Standardabweichung, Median)",
        "Joint": "Gelenk",
        "Keep": "Behalten",
        "Keep Footage": "Filmmaterial behalten",
        "Keep a foot in place on the floor from the first to the last "
        "frame": "Einen Fuß vom ersten bis zum letzten Bild auf dem Boden festhalten",
        "Keep at Most (GB)": "Höchstens behalten (GB)",
        "Record the motion from now on; Stop writes it as "
        "keyframes": "Die Bewegung von jetzt an aufzeichnen; Stoppen schreibt sie als "
        "Schlüsselbilder",
        "Keys": "Schlüsselbilder",
        "Keys per Second": "Schlüsselbilder pro Sekunde",
        "Largest network, most accurate": "Größtes Netz, am genauesten",
        "Last Frame": "Letztes Bild",
        "Last frame of the span, inclusive": "Letztes Bild des Bereichs, einschließlich",
        "Least Movement": "Mindestbewegung",
        "Leave the scene's frame rate; one key on each of its "
        "frames": "Die Bildrate der Szene lassen; ein Schlüsselbild auf jedem ihrer Bilder",
        "Leave the scene's frame rate; the motion keeps its speed, with keys between "
        "frames": "Die Bildrate der Szene lassen; die Bewegung behält ihr Tempo, mit "
        "Schlüsselbildern zwischen Bildern",
        "Left": "Links",
        "Left Ankle": "Linker Knöchel",
        "Left Elbow": "Linker Ellenbogen",
        "Left Foot": "Linker Fuß",
        "Left Foot Stands": "Linker Fuß steht",
        "Left Hip": "Linke Hüfte",
        "Left Knee": "Linkes Knie",
        "Left Shoulder": "Linke Schulter",
        "Left Wrist": "Linkes Handgelenk",
        "Legs": "Beine",
        "Legs Exchanged": "Beine vertauscht",
        "Lens": "Objektiv",
        "Lens: {lens}": "Objektiv: {lens}",
        "Continue the capture": "Die Erfassung weiterlaufen lassen",
        "Make a captured body follow the person in front of the camera until the capture is "
        "stopped": "Einen erfassten Körper der Person vor der Kamera folgen lassen, bis gestoppt "
        "wird",
        "Make the rig of the Retarget section follow as "
        "well": "Auch das Rig aus dem Abschnitt Übertragen folgen lassen",
        "Level the World": "Welt ausrichten",
        "Lift Sunken Feet": "Eingesunkene Füße anheben",
        "Limbs": "Gliedmaßen",
        "Live": "Live",
        "Live capture cancelled; the scene is "
        "unchanged": "Live-Erfassung abgebrochen; die Szene ist unverändert",
        "Live capture needs Blender's window; in a shell, use "
        "./scripts/live": "Die Live-Erfassung braucht Blenders Fenster; in einer Shell "
        "./scripts/live verwenden",
        "Live capture recorded": "Live-Erfassung aufgenommen",
        "Live capture stopped": "Live-Erfassung gestoppt",
        "Load a bone map from a JSON file": "Eine Knochenzuordnung aus einer JSON-Datei laden",
        "Load an expression map from a JSON file": "Eine Mimikzuordnung aus einer JSON-Datei laden",
        "Loaded {file}": "{file} geladen",
        "Location": "Position",
        "Lock feet that are in contact, scaled to the rig, and keep them above the "
        "floor": "Füße mit Bodenkontakt festhalten, auf das Rig skaliert, und über dem Boden "
        "halten",
        "Lower Foot": "Unterer Fuß",
        "Mark the captured motion as an asset with a preview image of its pose, for other files' "
        "Asset Browser": "Die erfasste Bewegung mit einem Bild ihrer Pose als Asset markieren, um "
        "sie über den Asset-Browser in anderen Dateien zu verwenden",
        "Maximum position error of the pelvis in "
        "millimetres": "Größter Positionsfehler des Beckens in Millimetern",
        "Maximum rotation error of a bone in "
        "degrees": "Größter Rotationsfehler eines Knochens in Grad",
        "Mean distance in metres by which the joints must move within the cycle; 0 also loops a "
        "person who stays "
        "still": "Mittlere Strecke in Metern, um die sich die Gelenke im Zyklus bewegen müssen; 0 "
        "erlaubt auch eine stillstehende Person",
        "Mesh with shape keys, or rig whose bones move its face, to animate with the captured "
        "expressions": "Mesh mit Formschlüsseln oder Rig, dessen Knochen das Gesicht bewegen, das "
        "mit den erfassten Ausdrücken animiert wird",
        "Metres": "Meter",
        "Minimum duration of the cycle in seconds": "Mindestdauer des Zyklus in Sekunden",
        "Morph targets whose values are the shape "
        "coefficients": "Morph-Targets, deren Werte die Formkoeffizienten sind",
        "Motion Capture": "Bewegungserfassung",
        "Motion capture: animate a body with the motion of the person in a video or "
        "image": "Bewegungserfassung: einen Körper mit der Bewegung der Person in einem Video oder "
        "Bild animieren",
        "Move the motion to a new track of the Nonlinear Animation editor, where takes are mixed "
        "and repeated": "Die Bewegung auf eine neue Spur des NLA-Editors legen, wo Takes gemischt "
        "und wiederholt werden",
        "Moves forward, relative to mouth width, eye distance or lid "
        "gap": "Bewegt nach vorn; in Mundbreiten, Augenabständen, Lidspalten",
        "Moves to the person's left, relative to mouth width, eye distance or lid "
        "gap": "Bewegt nach links aus Sicht der Person; in Mundbreiten, Augenabständen, Lidspalten",
        "Moves up, relative to mouth width, eye distance or lid "
        "gap": "Bewegt nach oben; in Mundbreiten, Augenabständen, Lidspalten",
        "My Rig": "Eigenes Rig",
        "Name": "Name",
        "Name of the capture's collection": "Name der Sammlung der Erfassung",
        "Name of the joint's bone": "Name des Knochens dieses Gelenks",
        "Name of the preset, used to make the path "
        "name": "Name der Vorgabe, aus dem der Dateiname gebildet wird",
        "Networks on {processor}": "Netze auf {processor}",
        "New name of the take": "Neuer Name des Takes",
        "No root motion: the character stays in "
        "place": "Keine Wurzelbewegung: die Figur bleibt am Ort",
        "No root motion: the person stays in "
        "place": "Keine Wurzelbewegung: die Person bleibt am Ort",
        "No shape keys: the shape is applied to the mesh, for engines that limit shape keys to "
        "0..1": "Keine Formschlüssel: die Form wird auf das Mesh angewandt, für Engines, die "
        "Formschlüssel auf 0..1 begrenzen",
        "Nobody is seen": "Niemand ist zu sehen",
        "Not seen for a moment": "Für einen Moment nicht zu sehen",
        "No image from the source for {seconds:.0f} "
        "s": "Seit {seconds:.0f} s kommt kein Bild von der Quelle",
        "Number": "Anzahl",
        "Number of the camera, 0 for the first; on Linux also its device, such as "
        "/dev/video2": "Nummer der Kamera, 0 für die erste; unter Linux auch ihr Gerät, etwa "
        "/dev/video2",
        "On Object": "Am Objekt",
        "On an Object": "An einem Objekt",
        "One": "Eine",
        "One unit is a centimetre, as most tools "
        "expect": "Eine Einheit ist ein Zentimeter, wie die meisten Werkzeuge es erwarten",
        "One unit is a metre": "Eine Einheit ist ein Meter",
        "Only the arms": "Nur die Arme",
        "Only the legs": "Nur die Beine",
        "Only the motion of the skeleton, one file per "
        "person": "Nur die Bewegung des Skeletts, eine Datei pro Person",
        "Open the guide, which comes with Scope, in the web browser; the network is not "
        "used": "Die mitgelieferte Anleitung im Webbrowser öffnen; das Netz wird nicht benutzt",
        "Options": "Optionen",
        "Overlap": "Überlappend",
        "Part of the captured body that this bone "
        "follows": "Teil des erfassten Körpers, dem dieser Knochen folgt",
        "Pelvis": "Becken",
        "Preview of Current Frame": "Vorschau des aktuellen Frames",
        "Pin a joint to a place in one frame, and solve the motion around it "
        "again": "Ein Gelenk in einem Bild an eine Stelle heften und die Bewegung ringsum neu "
        "berechnen",
        "Pin the joint only in the camera's image; its distance from the camera is free, except "
        "the pelvis's": "Das Gelenk nur im Kamerabild anheften; der Abstand zur Kamera ist frei, "
        "außer beim Becken",
        "Pitch": "Nicken",
        "Pixel of the footage, from its top left": "Pixel des Filmmaterials, von oben links",
        "Play Scene": "Szene abspielen",
        "Play the scene's animation from the First Frame while "
        "recording": "Während der Aufnahme die Animation der Szene ab „Erstes Bild“ abspielen",
        "Point of the scene": "Punkt der Szene",
        "Position": "Position",
        "Press Compare with Footage or switch to an orthographic side view; the line is drawn "
        "there": "Mit Filmmaterial vergleichen drücken oder eine orthografische Ansicht von einer "
        "Seite zeigen: dort wird die Linie gezogen",
        "Put feet in contact on the floor, which is at the height of the armature's "
        "origin": "Füße mit Kontakt auf den Boden setzen, der auf Höhe des Skelettursprungs liegt",
        "Quality": "Qualität",
        "Raise the frames in which a foot is below the "
        "floor": "Bilder anheben, in denen ein Fuß unter dem Boden ist",
        "Reach": "Reichweite",
        "Read focal lengths, principal point and distortion from a calibration "
        "file": "Brennweiten, Hauptpunkt und Verzeichnung aus einer Kalibrierungsdatei lesen",
        "Read from the file's metadata if present, estimated "
        "otherwise": "Aus den Metadaten der Datei gelesen, falls vorhanden, sonst geschätzt",
        "Recorded: {seconds:.1f} s": "Aufgenommen: {seconds:.1f} s",
        "Reduced {before} key to {after}; maximum error {angle:.2f} degrees for bones, "
        "{distance:.1f} mm for "
        "joints": "{before} Schlüsselbild auf {after} reduziert; größter Fehler {angle:.2f} Grad "
        "bei Knochen, {distance:.1f} mm bei Gelenken",
        "Reduced {before} keys to {after}; maximum error {angle:.2f} degrees for bones, "
        "{distance:.1f} mm for "
        "joints": "{before} Schlüsselbilder auf {after} reduziert; größter Fehler {angle:.2f} Grad "
        "bei Knochen, {distance:.1f} mm bei Gelenken",
        "Refine": "Verfeinern",
        "Remove": "Entfernen",
        "Remove captured motion from the cache. Existing scenes and the compiled solver are not "
        "affected": "Erfasste Bewegungen aus dem Cache entfernen. Vorhandene Szenen und der "
        "kompilierte Löser sind nicht betroffen",
        "Remove keys within a maximum "
        "error": "Schlüsselbilder innerhalb eines Höchstfehlers entfernen",
        "Remove the correction and restore the motion around "
        "it": "Die Korrektur entfernen; die Bewegung ringsum wird wieder wie ohne sie",
        "Remove the selected entry": "Den gewählten Eintrag entfernen",
        "Rename it with Object > Motion Capture > Rename "
        "Take": "Umbenennen mit Objekt > Bewegungserfassung > Take umbenennen",
        "Rename the capture with its objects and actions; exported animation has the same "
        "name": "Die Erfassung mit ihren Objekten und Aktionen umbenennen; exportierte Animation "
        "heißt ebenso",
        "Repeat": "Wiederholen",
        "Repeat the curves; each cycle starts where the previous one "
        "ended": "Die Kurven wiederholen; jeder Zyklus beginnt, wo der vorige endete",
        "Replace frames by an interpolation between the pose before and the pose after "
        "them": "Bilder durch eine Interpolation zwischen der Pose davor und der Pose danach "
        "ersetzen",
        "Replace the keys by keys at a constant frame "
        "rate": "Die Schlüsselbilder durch solche mit konstanter Bildrate ersetzen",
        "Replaced {before} key by {after}": "{before} Schlüsselbild durch {after} ersetzt",
        "Replaced {before} keys by {after}": "{before} Schlüsselbilder durch {after} ersetzt",
        "Reprojection error {pixels:.1f} px": "Rückprojektionsfehler {pixels:.1f} px",
        "Resample to Scene": "An Szene anpassen",
        "Result": "Ergebnis",
        "Retarget": "Übertragen",
        "Rig": "Rig",
        "Rig Follows": "Rig folgt",
        "Right": "Rechts",
        "Right Ankle": "Rechter Knöchel",
        "Right Elbow": "Rechter Ellenbogen",
        "Right Foot": "Rechter Fuß",
        "Right Foot Stands": "Rechter Fuß steht",
        "Right Hip": "Rechte Hüfte",
        "Right Knee": "Rechtes Knie",
        "Right Shoulder": "Rechte Schulter",
        "Right Wrist": "Rechtes Handgelenk",
        "Roll": "Rollen",
        "Root Motion": "Wurzelbewegung",
        "Rotate the motion so that all foot contacts are level, after which the camera no longer "
        "matches": "Die Bewegung so drehen, dass alle Fußkontakte eben liegen; danach passt die "
        "Kamera nicht mehr",
        "Rotation": "Rotation",
        "Scale of positions on the floor. 0: the ratio of leg lengths, so that steps fit the rig. "
        "Several people who touch or meet need the same value for all their "
        "rigs": "Maßstab der Positionen auf dem Boden. 0: das Verhältnis der Beinlängen, damit die "
        "Schritte zum Rig passen. Personen, die sich berühren oder begegnen, brauchen "
        "denselben Wert für alle ihre Rigs",
        "Show this capture": "Diese Erfassung zeigen",
        "Save the bone map as a JSON file for similar "
        "rigs": "Die Knochenzuordnung als JSON-Datei für ähnliche Rigs speichern",
        "Save the expression map as a JSON file for similar "
        "faces": "Die Mimikzuordnung als JSON-Datei für ähnliche Gesichter speichern",
        "Saved {file}": "{file} gespeichert",
        "Scene": "Szene",
        "Scene frame": "Bild der Szene",
        "Scope: {progress}   (Esc over the Scope panel to "
        "cancel)": "Scope: {progress}   (Esc über dem Scope-Panel bricht ab)",
        "Seconds before and after the frame over which the correction fades "
        "out": "Sekunden vor und nach dem Bild, über die die Korrektur ausläuft",
        "Select a Captured Person": "Eine erfasste Person auswählen",
        "Select the armature of a capture first": "Zuerst das Skelett einer Erfassung auswählen",
        "Select the captured person whose face to "
        "retarget": "Die erfasste Person wählen, deren Gesicht übertragen werden soll",
        "Selected": "Ausgewählte",
        "Set Frame Range": "Bildbereich setzen",
        "Set Scene Frame Rate": "Bildrate der Szene setzen",
        "Set from Footage": "Vom Filmmaterial",
        "Set the scene to the motion's frame rate. Captures keep their speed, other animation "
        "keeps its "
        "frames": "Der Szene die Bildrate der Bewegung geben. Erfassungen behalten ihr Tempo, "
        "andere Animationen ihre Bildnummern",
        "Set the scene's frame rate to the "
        "footage's": "Die Bildrate der Szene auf die des Filmmaterials setzen",
        "Set the scene's frame rate to the footage's unless something in the scene is "
        "animated": "Die Bildrate der Szene auf die des Filmmaterials setzen, außer wenn in der "
        "Szene etwas animiert ist",
        "Set the scene's frame rate to the motion's; otherwise keys may be between "
        "frames": "Die Bildrate der Szene auf die der Bewegung setzen; sonst können "
        "Schlüsselbilder zwischen Bildern liegen",
        "Several people are captured: select the armature of the one whose motion to "
        "retarget": "Mehrere Personen sind erfasst: das Skelett auswählen, dessen Bewegung "
        "übertragen werden soll",
        "Shape": "Form",
        "Shape Key": "Formschlüssel",
        "Shape Key or Control": "Formschlüssel oder Steuerknochen",
        "Shape Keys": "Formschlüssel",
        "Shape Keys per Frame": "Formschlüssel pro Bild",
        "Shape key of your mesh, or bone of your rig's "
        "face": "Formschlüssel des Mesh oder Knochen im Gesicht des Rigs",
        "Shape keys, or in the mesh for formats whose readers limit shape "
        "keys": "Formschlüssel, oder im Mesh bei Formaten, deren Leser Formschlüssel begrenzen",
        "Shortest": "Kürzeste Dauer",
        "Show both in the same place": "Beide an derselben Stelle zeigen",
        "Show both, the rig to the left of the captured "
        "person": "Beide zeigen, das Rig links von der erfassten Person",
        "Show the captured body from its side in a second viewport, beside the one with the "
        "footage": "Den erfassten Körper von der Seite zeigen, in einem zweiten Ansichtsfenster "
        "neben dem Filmmaterial",
        "Show the pose of the current frame in the preview image, instead of the first one that "
        "needs no "
        "review": "Im Bild die Pose des aktuellen Frames zeigen statt der ersten, die keine "
        "Prüfung braucht",
        "Side by Side": "Daneben",
        "Sides Exchanged": "Seiten vertauscht",
        "Slightly less accurate than Best, and "
        "faster": "Etwas ungenauer als Am besten, und schneller",
        "Smallest network: for a first look or a slow "
        "computer": "Kleinstes Netz: für einen ersten Eindruck oder einen langsamen Rechner",
        "Smooth the captured motion again, more or less strongly. Keeps corrections, discards "
        "other changes": "Die erfasste Bewegung neu glätten, stärker oder schwächer. Behält "
        "Korrekturen, verwirft andere Änderungen",
        "Source": "Quelle",
        "Start": "Start",
        "Stop the Capture?": "Erfassung stoppen?",
        "Stop the live capture. What was recorded is written as keyframes; otherwise the last pose "
        "stays": "Die Live-Erfassung stoppen. Aufgenommenes wird als Schlüsselbilder geschrieben; "
        "sonst bleibt die letzte Pose",
        "Stream": "Stream",
        "Strength": "Stärke",
        "Swap the left and right limbs within a span of "
        "frames": "Linke und rechte Gliedmaßen in einem Bildbereich vertauschen",
        "Take": "Take",
        "The axis along which the person is "
        "upright": "Achse, entlang der die Person aufrecht steht",
        "The body's shape as shape keys with one keyframe "
        "each": "Die Körperform als Formschlüssel mit je einem Schlüsselbild",
        "The built-in body with SMPL's 24 "
        "joints": "Der eingebaute Körper mit den 24 Gelenken von SMPL",
        "The built-in body with SMPL+H's 52 joints, fingers "
        "included": "Der eingebaute Körper mit den 52 Gelenken von SMPL+H, einschließlich Finger",
        "The capture does not say where its footage "
        "is": "Die Erfassung gibt nicht an, wo ihr Filmmaterial liegt",
        "The capture is linked from {file}: make it "
        "local": "Die Erfassung ist aus {file} verknüpft: lokal machen",
        "The capture that is selected in the panel, with all its "
        "people": "Die im Panel ausgewählte Erfassung mit allen Personen",
        "The capture that the active object belongs "
        "to": "Die Erfassung, zu der das aktive Objekt gehört",
        "The captured person was deleted": "Die erfasste Person wurde gelöscht",
        "The collection '{name}' is hidden; show it in the "
        "Outliner": "Die Sammlung '{name}' ist verborgen; im Outliner einblenden",
        "The corrections put a foot up to {depth:.0f} cm under the floor: move the pin "
        "up": "Die Korrekturen bringen einen Fuß bis zu {depth:.0f} cm unter den Boden: den Pin "
        "höher setzen",
        "The corrections put a foot up to {depth:.0f} cm under the floor in {count} of {total} "
        "frames: move the pin "
        "up": "Die Korrekturen bringen einen Fuß in {count} von {total} Bildern bis zu {depth:.0f} "
        "cm unter den Boden: den Pin höher setzen",
        "The footage is already in the sequencer": "Das Filmmaterial ist bereits im Sequenzer",
        "The left foot": "Der linke Fuß",
        "The lower one of the two in this frame": "Der untere der beiden in diesem Bild",
        "The most prominent people, up to a "
        "number": "Die auffälligsten Personen, bis zu einer Anzahl",
        "The most prominent person": "Die auffälligste Person",
        "The pelvis moves through the scene": "Das Becken bewegt sich durch die Szene",
        "The pelvis moves through the scene, as "
        "captured": "Das Becken bewegt sich durch die Szene, wie erfasst",
        "The processor": "Der Prozessor",
        "The rig chosen under Retarget, with its current animation and its "
        "meshes": "Das unter Übertragen gewählte Rig mit seiner aktuellen Animation und seinen "
        "Meshes",
        "The right foot": "Der rechte Fuß",
        "The same, with a keyframe on every "
        "frame": "Dasselbe, mit einem Schlüsselbild auf jedem Bild",
        "The scene contains no capture yet": "Die Szene enthält noch keine Erfassung",
        "The scene contains no captured video or imported "
        "motion": "Die Szene enthält kein erfasstes Video und keine importierte Bewegung",
        "The scene has no camera of a capture: capture with the option Camera with "
        "Footage": "Die Szene hat keine Kamera einer Erfassung: mit der Option Kamera mit Film "
        "erfassen",
        "The scene has {rate:.5g} frames/s, like the "
        "motion": "Die Szene hat {rate:.5g} Bilder/s wie die Bewegung",
        "The scene has {rate:.5g} frames/s; animation that was not captured plays {factor:.3g} "
        "times as "
        "fast": "Die Szene hat {rate:.5g} Bilder/s; nicht erfasste Animationen laufen "
        "{factor:.3g}-mal so schnell",
        "The scene has {scene:.5g} frames/s and the footage {footage:.5g}: the strip will not stay "
        "synchronized with the "
        "motion": "Die Szene hat {scene:.5g} Bilder/s und das Filmmaterial {footage:.5g}: der "
        "Streifen bleibt nicht synchron zur Bewegung",
        "The scene's frame rate was changed from {was:.5g} to {now:.5g}, which changed the "
        "motion's speed; importing an FBX file does "
        "that": "Die Bildrate der Szene wurde von {was:.5g} auf {now:.5g} geändert, was das Tempo "
        "der Bewegung verändert hat; der Import einer FBX-Datei bewirkt das",
        "This Blender was built without USD; use a build from blender.org, or another "
        "format": "Dieses Blender wurde ohne USD gebaut; eines von blender.org oder ein anderes "
        "Format benutzen",
        "This motion was captured on uneven ground, where feet rest at any height: use Floor "
        "Here": "Diese Bewegung wurde auf unebenem Boden erfasst, wo Füße in jeder Höhe ruhen: "
        "„Hier ist der Boden“ verwenden",
        "Threads": "Threads",
        "Toggle the view of the body over the footage. Sets the scene's camera and "
        "resolution": "Ansicht des Körpers über dem Filmmaterial ein- oder ausschalten. Setzt "
        "Kamera und Auflösung der Szene",
        "Transfer the captured expressions to the mesh's shape keys or the rig's face, as a new "
        "action": "Die erfassten Ausdrücke als neue Aktion auf die Formschlüssel des Mesh oder das "
        "Gesicht des Rigs übertragen",
        "Transfer the captured motion to your rig, as a new action. One of the same capture is "
        "replaced if "
        "unchanged": "Die erfasste Bewegung als neue Aktion auf das eigene Rig übertragen. Eine "
        "unveränderte derselben Erfassung wird ersetzt",
        "Travel Scale": "Wegmaßstab",
        "Turn the capture and its camera so that a line in an orthographic view from a side is "
        "upright": "Erfassung und Kamera so drehen, dass eine Linie in einer orthografischen "
        "Ansicht von einer Seite senkrecht ist",
        "Turn the capture and its camera so that a line in the footage is "
        "upright": "Erfassung und Kamera so drehen, dass eine Linie im Filmmaterial senkrecht ist",
        "Turns down, in degrees": "Dreht nach unten, in Grad",
        "Turns to the person's left, in degrees": "Dreht nach links aus Sicht der Person, in Grad",
        "Turns with the left side up, in degrees": "Dreht mit der linken Seite nach oben, in Grad",
        "Uneven Ground": "Unebener Boden",
        "Upright Line": "Senkrechte Linie",
        "Use the short clip that is included with "
        "Scope": "Den kurzen Clip benutzen, der Scope beiliegt",
        "Use this in the viewport with the "
        "footage": "Im Ansichtsfenster mit dem Filmmaterial benutzen",
        "Value of a shape key": "Wert eines Formschlüssels",
        "Value where the expression is 1: at most 10, or 180 degrees; several expressions add "
        "up": "Wert, wo der Ausdruck 1 ist: höchstens 10 oder 180 Grad; mehrere Ausdrücke addieren "
        "sich",
        "Video": "Video",
        "Video of a person, which is played in real "
        "time": "Video einer Person, das in Echtzeit abgespielt wird",
        "Video or image of a person to "
        "capture": "Video oder Bild einer Person, die erfasst werden soll",
        "Wait until somebody is seen": "Warten, bis jemand zu sehen ist",
        "Waiting for the source": "Wartet auf die Quelle",
        "Warnings": "Warnungen",
        "What to export": "Was exportiert wird",
        "Where the joint is in that frame": "Wo das Gelenk in diesem Bild ist",
        "Source of the images": "Woher die Bilder kommen",
        "Where the root motion is stored": "Wo die Wurzelbewegung gespeichert wird",
        "Where the root motion of the rig is "
        "stored": "Wo die Wurzelbewegung des Rigs gespeichert wird",
        "Which foot rests on the floor": "Welcher Fuß auf dem Boden ruht",
        "Which foot stands": "Welcher Fuß steht",
        "Which limbs are exchanged": "Welche Gliedmaßen vertauscht werden",
        "Who made this asset": "Wer dieses Asset erstellt hat",
        "With Heading": "Mit Richtung",
        "A foot is up to {depth:.0f} cm under this floor in {count} of {total} frames: press Floor "
        "Here in a frame in which it rests on the floor, or use Snap Feet to "
        "Floor": "Mit diesem Boden ist ein Fuß in {count} von {total} Bildern bis zu {depth:.0f} "
        "cm darunter: „Hier ist der Boden“ in einem Bild drücken, in dem er steht, oder "
        "„Füße auf den Boden setzen“ verwenden",
        "Write a separate file for each person": "Für jede Person eine eigene Datei schreiben",
        "Write captures to a file": "Erfassungen in eine Datei schreiben",
        "Write the recorded images of a camera or stream as a video beside the .blend file, from "
        "which a more accurate motion of the same take can be "
        "captured": "Die aufgenommenen Bilder einer Kamera oder eines Streams als Video neben die "
        ".blend-Datei schreiben, aus dem sich eine genauere Bewegung derselben "
        "Aufnahme erfassen lässt",
        "Writing the recording": "Die Aufnahme wird geschrieben",
        "Wrote {files} in {folder}": "{files} nach {folder} geschrieben",
        "Y points down, as in the camera's axes of pose estimation "
        "networks": "Y zeigt nach unten, wie in den Kameraachsen von Netzen zur Posenschätzung",
        "Y points up, as in AIST++ and most "
        "engines": "Y zeigt nach oben, wie in AIST++ und den meisten Engines",
        "Yaw": "Gieren",
        "Your own SMPL, SMPL+H, SMPL-X or STAR "
        "file": "Eigene SMPL-, SMPL+H-, SMPL-X- oder STAR-Datei",
        "Z points up, as in AMASS": "Z zeigt nach oben, wie in AMASS",
        "removed": "entfernt",
        "{count} bone": "{count} Knochen",
        "{count} bones": "{count} Knochen",
        "{count} entries": "{count} Einträge",
        "{count} entry": "{count} Eintrag",
        "{count} frame": "{count} Bild",
        "{count} frames": "{count} Bilder",
        "{count} people": "{count} Personen",
        "{count} person": "{count} Person",
        "{frames}, captured in {time}": "{frames}, erfasst in {time}",
        "{joint} cannot reach the pin and stays {distance} away: move the pin closer, or pin the "
        "pelvis too": "{joint} erreicht den Pin nicht und bleibt {distance} entfernt: den Pin "
        "näher setzen oder auch das Becken anheften",
        "{path} is not a file; choose a video or "
        "image": "{path} ist keine Datei; ein Video oder Bild wählen",
        "{rate:.0f} pose/s, latency {latency:.0f} ms": "{rate:.0f} Pose/s, Latenz {latency:.0f} ms",
        "{rate:.0f} poses/s, latency {latency:.0f} "
        "ms": "{rate:.0f} Posen/s, Latenz {latency:.0f} ms",
        "{size} of captures in {folder}": "{size} an Erfassungen in {folder}",
    }
)
