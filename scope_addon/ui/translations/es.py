# SPDX-License-Identifier: GPL-3.0-or-later
"""Spanish."""

from .operators.es import OPERATORS as OPERATORS
from .options.es import OPTIONS
from .stages.es import STAGES

TEXTS = (
    STAGES
    | OPTIONS
    | {
        "'{action}' is an asset of this file; save the file in an asset "
        "library": "'{action}' es un recurso de este archivo; guarde el archivo en una biblioteca "
        "de recursos",
        "'{action}' is now an asset": "'{action}' ya es un recurso",
        "'{mesh}' is linked from {file}, so its keyframes would not be saved in this file: make it "
        "local": "'{mesh}' está vinculado desde {file}, así que sus claves no se guardarían en "
        "este archivo: hágalo local",
        "'{mesh}' is now animated by the action "
        "'{action}'": "'{mesh}' ahora está animado por la acción '{action}'",
        "'{name}' has no action; choose one in the Action "
        "Editor": "'{name}' no tiene acción; elija una en el editor de acciones",
        "'{name}' is linked from {file}: make it "
        "local": "'{name}' está vinculado desde {file}: conviértalo en local",
        "'{name}' or its motion is linked from {file}, so changes would be lost: make both local "
        "(Object > Relations > Make Local > All) or edit them in that "
        "file": "'{name}' o su movimiento está vinculado desde {file}; los cambios se perderían: "
        "conviértalos en locales (Objeto > Relaciones > Convertir en local > Todo) o "
        "edítelos en ese archivo",
        "'{rig}' is linked from {file}, so its motion would not be saved in this file: make an "
        "override of it (Object > Library Override > "
        "Make)": "'{rig}' está vinculado desde {file}; su movimiento no se guardaría en este "
        "archivo: cree una redefinición (Objeto > Redefinición de biblioteca > Crear)",
        "'{rig}' is not in the scene's view layer: add it to the scene, or enable its collection "
        "in the Outliner": "'{rig}' no está en la capa de visualización de la escena: agréguelo a "
        "la escena o active su colección en el listado",
        "'{rig}' is now animated by the action "
        "'{action}'": "'{rig}' ahora está animado por la acción '{action}'",
        "'{rig}' is now animated by the action '{action}', with positions on the floor scaled by "
        "{scale:.3f}": "'{rig}' ahora está animado por la acción '{action}', con posiciones en el "
        "suelo a escala {scale:.3f}",
        "'{strip}' is now a strip of {armature}'s NLA; to edit its keys, enter Tweak Mode (key "
        "Tab)": "'{strip}' es ahora un clip ANL de {armature}; para editar sus claves, entre en el "
        "modo de ajuste (tecla Tab)",
        "0 keeps every frame as captured, 1 is the default of a capture, higher values smooth "
        "more": "0 deja cada fotograma como se capturó, 1 es el valor habitual de una captura, "
        "valores mayores suavizan más",
        "35 mm Equivalent": "Equivalente a 35 mm",
        "35 mm equivalent focal length in millimetres; a phone's main camera has about "
        "26": "Distancia focal equivalente a 35 mm en milímetros; la cámara principal de un "
        "teléfono tiene unos 26",
        "A camera is in use; wait for it or stop it": "Hay una cámara en uso; esperar o detenerla",
        "A camera of this computer": "Una cámara de este equipo",
        "A capture is running; wait for it or cancel "
        "it": "Hay una captura en curso; espere o cancélela",
        "A network camera or another stream": "Una cámara de red u otra transmisión",
        "A supported GPU if there is one, otherwise the "
        "CPU": "Una GPU compatible si la hay; si no, la CPU",
        "A video that is played in real time": "Un vídeo que se reproduce en tiempo real",
        "Active": "Activa",
        "Add": "Agregar",
        "Add an entry": "Agregar una entrada",
        "Add an entry to the bone map, or remove the selected "
        "one": "Agregar una entrada al mapa de huesos o eliminar la seleccionada",
        "Add an entry to the expression map, or remove the selected "
        "one": "Añadir una entrada al mapa de expresiones o quitar la seleccionada",
        "Add the capture settings as a preset, or remove a "
        "preset": "Agregar los ajustes de captura como preselección o eliminar una preselección",
        "Add the footage with its sound to the video sequencer, synchronized with the "
        "motion": "Agregar la filmación con su sonido al editor de video, sincronizada con el "
        "movimiento",
        "Address": "Dirección",
        "Address of the stream, such as rtsp://192.168.1.20/stream; name and password in it are "
        "kept until Blender ends, and never "
        "saved": "Dirección de la transmisión, como rtsp://192.168.1.20/stream; el nombre y la "
        "contraseña que contenga se conservan hasta cerrar Blender y nunca se guardan",
        "All four limbs": "Las cuatro extremidades",
        "All in the Scene": "Todas las de la escena",
        "An NVIDIA GPU": "Una GPU NVIDIA",
        "An NVIDIA GPU with TensorRT, which takes minutes to compile each network on first "
        "use": "Una GPU NVIDIA con TensorRT, que tarda minutos en compilar cada red la primera vez",
        "An empty carries position and heading, the rig moves relative to "
        "it": "Un vacío lleva la posición y la orientación; el rig se mueve respecto a él",
        "An empty on the floor carries the root "
        "motion": "Un vacío en el suelo lleva el movimiento raíz",
        "Angle": "Ángulo",
        "Any GPU on Windows": "Cualquier GPU en Windows",
        "Apple silicon": "Procesadores de Apple",
        "Armature to animate with the captured "
        "motion": "Esqueleto que se animará con el movimiento capturado",
        "Arms": "Brazos",
        "Arms Exchanged": "Brazos permutados",
        "Arms and Legs": "Brazos y piernas",
        "Query the camera's formats, without taking an image. macOS may ask for "
        "permission": "Preguntar a la cámara por sus formatos, sin tomar ninguna imagen. macOS "
        "puede preguntar si se permite usarla",
        "Querying the camera": "Consultando la cámara",
        "Assign the face's shape keys, named as by ARKit, Oculus or VRM, or the controls of a "
        "known rig to "
        "expressions": "Asignar a expresiones las formas clave de la cara, con nombres como los de "
        "ARKit, Oculus o VRM, o los controles de un rig conocido",
        "Assign the rig's bones to body parts by their names and rest "
        "pose": "Asignar los huesos del rig a partes del cuerpo según sus nombres y la pose de "
        "reposo",
        "Author": "Autor",
        "Automatic": "Automático",
        "Balanced": "Equilibrada",
        "Best": "Óptima",
        "Blend": "Fundido",
        "Body": "Cuerpo",
        "Body File": "Archivo del cuerpo",
        "Body Part": "Parte del cuerpo",
        "Body with Hands": "Cuerpo con manos",
        "Bone": "Hueso",
        "Bone of your rig": "Hueso de su rig",
        "Choose the file in the file browser": "Elegir el archivo en el explorador de archivos",
        "Cache Folder": "Carpeta de caché",
        "Cache Size": "Tamaño de caché",
        "Camera": "Cámara",
        "Camera (-Y)": "Cámara (-Y)",
        "Cancel the capture; the scene stays unchanged": "Cancelar la captura; la escena no cambia",
        "Cancel the live capture; the scene stays unchanged, and nothing is "
        "recorded": "Cancelar la captura en vivo; la escena no cambia y no se graba nada",
        "Capture": "Captura",
        "Capture Presets": "Preselecciones de captura",
        "Capture cancelled; the scene is unchanged": "Captura cancelada; la escena no ha cambiado",
        "Capture finished": "Captura terminada",
        "Capture motion from video, and view, edit, retarget and export captured "
        "motion": "Capturar movimiento desde video, y ver, editar, transferir y exportar "
        "movimiento capturado",
        "Leave the fingers at rest": "Dejar los dedos en reposo",
        "Capture hands that are large enough in the image to be "
        "read": "Capturar las manos que se ven lo bastante grandes en la imagen",
        "Capture hands of all sizes": "Capturar manos de cualquier tamaño",
        "Off": "Desactivado",
        "On": "Activado",
        "Capture the person in the footage as an animated body, while Blender stays "
        "usable": "Capturar a la persona de la filmación como cuerpo animado, mientras Blender "
        "sigue disponible",
        "Capture whose result the panel shows": "Captura cuyo resultado muestra el panel",
        "Capture with Scope": "Capturar con Scope",
        "Captured Body": "Cuerpo capturado",
        "Captured Motion (Mocap)": "Movimiento capturado (Mocap)",
        "Captured Motion as {format} (.{suffix})": "Movimiento capturado como {format} (.{suffix})",
        "Captured expression that this entry follows": "Expresión capturada que sigue esta entrada",
        "Captured from {source}, {seconds:.1f} s": "Capturado de {source}, {seconds:.1f} s",
        "Captures": "Capturas",
        "Catalog": "Catálogo",
        "Catalog of the Asset Browser, such as Motions/Walks; unassigned if left "
        "empty": "Catálogo del explorador de recursos, como Movimientos/Caminar; sin asignar si se "
        "deja vacío",
        "Centimetres": "Centímetros",
        "Channel": "Canal",
        "Choose a mesh with shape keys, or a rig with face controls, "
        "first": "Elija antes una malla con formas clave o un rig con controles de la cara",
        "Choose a video or image first": "Elija antes un video o una imagen",
        "Choose a video or image of a person": "Elegir un video o una imagen de una persona",
        "Choose where the person's root motion is "
        "stored": "Elegir dónde se guarda el movimiento raíz de la persona",
        "Choose your rig first": "Elija antes su rig",
        "Compare with Footage first": "Compare antes con la filmación",
        "Compiling the solver in the background, {percent:.0f} "
        "%": "Compilando el algoritmo en segundo plano, {percent:.0f} %",
        "Confidence": "Confianza",
        "Confidence of the guess": "Confianza de la suposición",
        "Corrections": "Correcciones",
        "Countdown (s)": "Cuenta atrás (s)",
        "Counted from 0; -1 removes all": "Contado desde 0; -1 elimina todas",
        "Custom SMPL, SMPL+H, SMPL-X or STAR model, for scenes without a body file of their "
        "own": "Modelo SMPL, SMPL+H, SMPL-X o STAR propio, para escenas sin archivo de cuerpo",
        "Custom detector (.onnx): YOLOX, YOLOv4, YOLOv8 and similar; built-in if "
        "empty": "Detector propio (.onnx): YOLOX, YOLOv4, YOLOv8 y similares; vacío: el incluido",
        "Custom keypoint network (.onnx): RTMPose, HRNet, ViTPose and similar; built-in if "
        "empty": "Red de puntos clave propia (.onnx): RTMPose, HRNet, ViTPose y similares; vacío: "
        "la incluida",
        "Cycle of {seconds:.2f} s; before closing, its ends were {distance:.1f} cm "
        "apart": "Ciclo de {seconds:.2f} s; antes de cerrarlo, sus extremos distaban "
        "{distance:.1f} cm",
        "Description": "Descripción",
        "Description of the asset; the footage and its duration if left "
        "empty": "Descripción del recurso; si se deja vacía, la filmación y su duración",
        "Details": "Detalles",
        "Direction": "Dirección",
        "Direction of the scene in which the view "
        "looks": "Dirección de la escena hacia la que mira la vista",
        "Drag a handle to where the joint is.  Scrub or play to go to other frames.  Esc or Enter: "
        "done": "Arrastre un control hasta donde está la articulación.  Desplácese o reproduzca "
        "para ir a otros fotogramas.  Esc o Intro: terminar",
        "Drag handles on the body to where the joints are in this frame; the motion around is "
        "solved again": "Arrastrar controles del cuerpo hasta donde están las articulaciones en "
        "este fotograma; el movimiento cercano se recalcula",
        "Draw a line along something upright: a door or post in the footage, or a standing person "
        "in a side view.  Esc: "
        "cancel": "Trace una línea a lo largo de algo vertical: en la filmación una puerta o un "
        "poste, en una vista lateral alguien de pie.  Esc: cancelar",
        "Draw a line along something upright, in the footage or a side view; it rotates the "
        "capture and its "
        "camera": "Trazar en la filmación o de lado una línea a lo largo de algo vertical; la "
        "captura y su cámara giran con ella",
        "Duration in seconds, at the end of the cycle, over which it is "
        "closed": "Duración en segundos, al final del ciclo, durante la que este se cierra",
        "End": "Fin",
        "Enter the 35 mm equivalent focal "
        "length": "Introducir la distancia focal equivalente a 35 mm",
        "Enter the field of view along the longer side of the "
        "image": "Introducir el campo de visión a lo largo del lado mayor de la imagen",
        "Every capture of the scene, with all its "
        "people": "Cada captura de la escena, con todas sus personas",
        "Everyone": "Todas",
        "Everyone who is clearly visible": "Todas las personas claramente visibles",
        "Exchange left and right from the first to the last frame; applying it again undoes "
        "it": "Intercambiar izquierda y derecha del primer al último fotograma; repetirlo lo "
        "deshace",
        "Execution provider for the networks; if unavailable, the CPU is used and the result shows "
        "a warning": "Motor de ejecución de las redes; si no está disponible, se usa la CPU y el "
        "resultado muestra una advertencia",
        "Export": "Exportar",
        "Export the estimated camera": "Exportar la cámara estimada",
        "Expression": "Expresión",
        "Face": "Cara",
        "Factor": "Factor",
        "Fast": "Rápida",
        "Feet on the Floor": "Pies en el suelo",
        "File": "Archivo",
        "File per Person": "Archivo por persona",
        "Find the best cycle within a span of frames, close it, and repeat "
        "it": "Encontrar el mejor ciclo en un rango de fotogramas, cerrarlo y repetirlo",
        "First frame of the span": "Primer fotograma del rango",
        "Floor": "Suelo",
        "Folder for captured motion, so the same footage is not captured twice; if empty, "
        "Blender's user "
        "folder": "Carpeta de movimientos capturados, para no capturar nada dos veces; vacío: la "
        "carpeta de usuario de Blender",
        "Foot": "Pie",
        "Footage": "Filmación",
        "Footage Opacity": "Opacidad de la filmación",
        "For Omniverse, Houdini and other studio "
        "tools": "Para Omniverse, Houdini y otras herramientas de estudio",
        "For Unreal Engine, Unity, Maya and MotionBuilder: armature, mesh and "
        "animation": "Para Unreal Engine, Unity, Maya y MotionBuilder: esqueleto, malla y "
        "animación",
        "For engines that limit morph targets to "
        "0..1": "Para motores que limitan los objetivos de transformación a 0..1",
        "For research: SMPL-style arrays of the captured motion before any editing, one file per "
        "person": "Para investigación: matrices al estilo de SMPL del movimiento capturado antes "
        "de editarlo, un archivo por persona",
        "For the web, Godot and other engines: one .glb file with "
        "everything": "Para la web, Godot y otros motores: un solo archivo .glb con todo",
        "Formats of captured motion": "Formatos de movimiento capturado",
        "Forward": "Adelante",
        "Found {count} bone; check the list": "Encontrado {count} hueso; revise la lista",
        "Found {count} bones; check the list": "Encontrados {count} huesos; revise la lista",
        "Found {count} controls; check the list": "Encontrados {count} controles; revise la lista",
        "Found {count} shape key; check the "
        "list": "Encontrada {count} forma clave; revise la lista",
        "Found {count} shape keys; check the "
        "list": "Encontradas {count} formas clave; revise la lista",
        "Frame": "Fotograma",
        "Frame rate of the keys; 0: one key on each frame of the "
        "scene": "Velocidad de las claves; 0: una clave en cada fotograma de la escena",
        "Freed {size}": "Liberados {size}",
        "From File": "Desde archivo",
        "Gigabytes of captured motion to keep; the least recently used is removed "
        "first": "Gigabytes de movimientos capturados que conservar; los usados hace más tiempo se "
        "eliminan primero",
        "Go to the frame that the warning is "
        "about": "Ir al fotograma al que se refiere la advertencia",
        "Hands": "Manos",
        "Head": "Cabeza",
        "Height of the most prominent person in centimetres; sets the scale of the scene. 0: "
        "estimated from the footage, for adults usually within 10 %; enter that of a "
        "child": "Estatura de la persona principal en centímetros; define la escala de la escena. "
        "0: estimada de la filmación, en adultos en general con un 10 % de margen; "
        "indique la de un niño",
        "Height {heights}": "Estatura {heights}",
        "Hide": "Ocultar",
        "Hide the captured person, except when comparing with the "
        "footage": "Ocultar a la persona capturada, salvo al comparar con la filmación",
        "How a control follows the expression, along the axes of the rig's "
        "face": "Cómo sigue un control la expresión, según los ejes de la cara del rig",
        "How the body's shape is exported": "Cómo se exporta la forma del cuerpo",
        "How the captured person is shown after "
        "retargeting": "Cómo se muestra la persona capturada tras transferir el movimiento",
        "Import Motion with Scope": "Importar movimiento con Scope",
        "Import captured motions of Scope, AMASS or other tools that use SMPL's joints, as "
        "animated "
        "bodies": "Importar como cuerpos animados movimientos de Scope, AMASS u otras herramientas "
        "con las articulaciones de SMPL",
        "Imported {files}": "Importado {files}",
        "In Bones": "En huesos",
        "In Place": "En el sitio",
        "In the Bones": "En los huesos",
        "In the Image": "En la imagen",
        "In the Mesh": "En la malla",
        "In this frame, a foot rests on the floor: move the capture and its camera up or down "
        "until it "
        "does": "En este fotograma un pie descansa en el suelo: subir o bajar la captura y su "
        "cámara hasta que así sea",
        "Include the rotation about the vertical axis in the root "
        "motion": "Incluir la rotación alrededor del eje vertical en el movimiento raíz",
        "Interpolated": "Interpolados",
        "It has run for {time}. The scene stays "
        "unchanged": "Lleva en curso {time}. La escena no cambia",
        "It reports no formats": "No indica ningún formato",
        "Joints ± {sigma:.1f} cm (standard deviation, "
        "median)": "Articulaciones ± {sigma:.1f} cm (desviación típica, mediana)",
        "Joint": "Articulación",
        "Keep": "Mantener",
        "Keep Footage": "Conservar metraje",
        "Keep a foot in place on the floor from the first to the last "
        "frame": "Mantener un pie fijo en el suelo del primer al último fotograma",
        "Keep at Most (GB)": "Conservar como máximo (GB)",
        "Record the motion from now on; Stop writes it as "
        "keyframes": "Grabar el movimiento desde ahora; Detener lo escribe como fotogramas clave",
        "Keys": "Claves",
        "Keys per Second": "Claves por segundo",
        "Largest network, most accurate": "La red más grande, la más precisa",
        "Last Frame": "Último fotograma",
        "Last frame of the span, inclusive": "Último fotograma del rango, incluido",
        "Least Movement": "Movimiento mínimo",
        "Leave the scene's frame rate; one key on each of its "
        "frames": "Mantener la velocidad de la escena; una clave en cada uno de sus fotogramas",
        "Leave the scene's frame rate; the motion keeps its speed, with keys between "
        "frames": "Mantener la velocidad de la escena; el movimiento conserva su ritmo, con claves "
        "entre fotogramas",
        "Left": "Izquierdo",
        "Left Ankle": "Tobillo izquierdo",
        "Left Elbow": "Codo izquierdo",
        "Left Foot": "Pie izquierdo",
        "Left Foot Stands": "Pie izq. apoyado",
        "Left Hip": "Cadera izquierda",
        "Left Knee": "Rodilla izquierda",
        "Left Shoulder": "Hombro izquierdo",
        "Left Wrist": "Muñeca izquierda",
        "Legs": "Piernas",
        "Legs Exchanged": "Piernas permutadas",
        "Lens": "Lente",
        "Lens: {lens}": "Lente: {lens}",
        "Continue the capture": "Dejar que la captura continúe",
        "Make a captured body follow the person in front of the camera until the capture is "
        "stopped": "Hacer que un cuerpo capturado siga a la persona ante la cámara hasta que se "
        "detenga",
        "Make the rig of the Retarget section follow as "
        "well": "Hacer que siga también el rig de la sección Transferir movimiento",
        "Level the World": "Nivelar el mundo",
        "Lift Sunken Feet": "Elevar pies hundidos",
        "Limbs": "Extremidades",
        "Live": "En vivo",
        "Live capture cancelled; the scene is "
        "unchanged": "Captura en vivo cancelada; la escena no ha cambiado",
        "Live capture needs Blender's window; in a shell, use "
        "./scripts/live": "La captura en vivo necesita la ventana de Blender; en una terminal, use "
        "./scripts/live",
        "Live capture recorded": "Captura en vivo grabada",
        "Live capture stopped": "Captura en vivo detenida",
        "Load a bone map from a JSON file": "Cargar un mapa de huesos desde un archivo JSON",
        "Load an expression map from a JSON "
        "file": "Cargar un mapa de expresiones desde un archivo JSON",
        "Loaded {file}": "Cargado {file}",
        "Location": "Posición",
        "Lock feet that are in contact, scaled to the rig, and keep them above the "
        "floor": "Fijar los pies en contacto, a la escala del rig, y mantenerlos sobre el suelo",
        "Lower Foot": "Pie más bajo",
        "Mark the captured motion as an asset with a preview image of its pose, for other files' "
        "Asset Browser": "Marcar el movimiento capturado como recurso, con una imagen de su pose, "
        "para usarlo en otros archivos desde el explorador de recursos",
        "Maximum position error of the pelvis in "
        "millimetres": "Error máximo de posición de la pelvis en milímetros",
        "Maximum rotation error of a bone in "
        "degrees": "Error máximo de rotación de un hueso en grados",
        "Mean distance in metres by which the joints must move within the cycle; 0 also loops a "
        "person who stays "
        "still": "Distancia media en metros que deben moverse las articulaciones en el ciclo; 0 "
        "admite también a una persona quieta",
        "Mesh with shape keys, or rig whose bones move its face, to animate with the captured "
        "expressions": "Malla con formas clave, o rig cuyos huesos mueven la cara, que se animará "
        "con las expresiones capturadas",
        "Metres": "Metros",
        "Minimum duration of the cycle in seconds": "Duración mínima del ciclo en segundos",
        "Morph targets whose values are the shape "
        "coefficients": "Objetivos de transformación cuyos valores son los coeficientes de forma",
        "Motion Capture": "Captura de movimiento",
        "Motion capture: animate a body with the motion of the person in a video or "
        "image": "Captura de movimiento: animar un cuerpo con el movimiento de la persona de un "
        "video o una imagen",
        "Move the motion to a new track of the Nonlinear Animation editor, where takes are mixed "
        "and repeated": "Mover el movimiento a una pista nueva del editor de animación no lineal, "
        "donde se mezclan y repiten tomas",
        "Moves forward, relative to mouth width, eye distance or lid "
        "gap": "Mueve hacia delante; en anchos de la boca, distancias de los ojos, aberturas de "
        "los párpados",
        "Moves to the person's left, relative to mouth width, eye distance or lid "
        "gap": "Mueve hacia la izquierda de la persona; en anchos de la boca, distancias de los "
        "ojos, aberturas de los párpados",
        "Moves up, relative to mouth width, eye distance or lid "
        "gap": "Mueve hacia arriba; en anchos de la boca, distancias de los ojos, aberturas de los "
        "párpados",
        "My Rig": "Mi rig",
        "Name": "Nombre",
        "Name of the capture's collection": "Nombre de la colección de la captura",
        "Name of the joint's bone": "Nombre del hueso de la articulación",
        "Name of the preset, used to make the path "
        "name": "Nombre de la preselección, usado para formar la ruta",
        "Networks on {processor}": "Redes en {processor}",
        "New name of the take": "Nuevo nombre de la toma",
        "No root motion: the character stays in "
        "place": "Sin movimiento raíz: el personaje queda en el sitio",
        "No root motion: the person stays in "
        "place": "Sin movimiento raíz: la persona queda en el sitio",
        "No shape keys: the shape is applied to the mesh, for engines that limit shape keys to "
        "0..1": "Sin formas clave: la forma se aplica a la malla, para motores que limitan las "
        "formas clave a 0..1",
        "Nobody is seen": "No se ve a nadie",
        "Not seen for a moment": "Fuera de vista por un momento",
        "No image from the source for {seconds:.0f} "
        "s": "No llega ninguna imagen de la fuente desde hace {seconds:.0f} s",
        "Number": "Número",
        "Number of the camera, 0 for the first; on Linux also its device, such as "
        "/dev/video2": "Número de la cámara, 0 para la primera; en Linux también su dispositivo, "
        "como /dev/video2",
        "On Object": "En el objeto",
        "On an Object": "En un objeto",
        "One": "Una",
        "One unit is a centimetre, as most tools "
        "expect": "Una unidad es un centímetro, como esperan casi todas las herramientas",
        "One unit is a metre": "Una unidad es un metro",
        "Only the arms": "Solo los brazos",
        "Only the legs": "Solo las piernas",
        "Only the motion of the skeleton, one file per "
        "person": "Solo el movimiento del esqueleto, un archivo por persona",
        "Open the guide, which comes with Scope, in the web browser; the network is not "
        "used": "Abrir en el navegador web la guía incluida en Scope; no se usa la red",
        "Options": "Opciones",
        "Overlap": "Superpuesto",
        "Part of the captured body that this bone "
        "follows": "Parte del cuerpo capturado a la que sigue este hueso",
        "Pelvis": "Pelvis",
        "Preview of Current Frame": "Vista previa del fotograma actual",
        "Pin a joint to a place in one frame, and solve the motion around it "
        "again": "Anclar una articulación a un lugar en un fotograma y recalcular el movimiento "
        "cercano",
        "Pin the joint only in the camera's image; its distance from the camera is free, except "
        "the pelvis's": "Anclar la articulación solo en la imagen de la cámara; su distancia a la "
        "cámara queda libre, salvo la de la pelvis",
        "Pitch": "Cabeceo",
        "Pixel of the footage, from its top "
        "left": "Píxel de la filmación, desde la esquina superior izquierda",
        "Play Scene": "Reproducir escena",
        "Play the scene's animation from the First Frame while "
        "recording": "Reproducir la animación de la escena desde «Primer fotograma» durante la "
        "grabación",
        "Point of the scene": "Punto de la escena",
        "Position": "Posición",
        "Press Compare with Footage or switch to an orthographic side view; the line is drawn "
        "there": "Pulse Comparar con la filmación o muestre una vista ortográfica lateral: la "
        "línea se traza allí",
        "Put feet in contact on the floor, which is at the height of the armature's "
        "origin": "Poner los pies en contacto sobre el suelo, que está a la altura del origen del "
        "esqueleto",
        "Quality": "Calidad",
        "Raise the frames in which a foot is below the "
        "floor": "Elevar los fotogramas en los que un pie está bajo el suelo",
        "Reach": "Alcance",
        "Read focal lengths, principal point and distortion from a calibration "
        "file": "Leer distancias focales, punto principal y distorsión de un archivo de "
        "calibración",
        "Read from the file's metadata if present, estimated "
        "otherwise": "Leída de los metadatos del archivo si existen; si no, estimada",
        "Recorded: {seconds:.1f} s": "Grabado: {seconds:.1f} s",
        "Reduced {before} key to {after}; maximum error {angle:.2f} degrees for bones, "
        "{distance:.1f} mm for "
        "joints": "De {before} clave a {after}; error máximo de {angle:.2f} grados en huesos y "
        "{distance:.1f} mm en articulaciones",
        "Reduced {before} keys to {after}; maximum error {angle:.2f} degrees for bones, "
        "{distance:.1f} mm for "
        "joints": "De {before} claves a {after}; error máximo de {angle:.2f} grados en huesos y "
        "{distance:.1f} mm en articulaciones",
        "Refine": "Refinar",
        "Remove": "Eliminar",
        "Remove captured motion from the cache. Existing scenes and the compiled solver are not "
        "affected": "Eliminar de la caché los movimientos capturados. Las escenas existentes y el "
        "algoritmo compilado no se ven afectados",
        "Remove keys within a maximum error": "Eliminar claves dentro de un error máximo",
        "Remove the correction and restore the motion around "
        "it": "Eliminar la corrección; el movimiento cercano vuelve a ser el que era sin ella",
        "Remove the selected entry": "Eliminar la entrada seleccionada",
        "Rename it with Object > Motion Capture > Rename "
        "Take": "Para renombrarla: Objeto > Captura de movimiento > Renombrar toma",
        "Rename the capture with its objects and actions; exported animation has the same "
        "name": "Renombrar la captura con sus objetos y acciones; la animación exportada lleva el "
        "mismo nombre",
        "Repeat": "Repetir",
        "Repeat the curves; each cycle starts where the previous one "
        "ended": "Repetir las curvas; cada ciclo empieza donde terminó el anterior",
        "Replace frames by an interpolation between the pose before and the pose after "
        "them": "Reemplazar fotogramas por una interpolación entre la pose anterior y la posterior",
        "Replace the keys by keys at a constant frame "
        "rate": "Reemplazar las claves por claves a velocidad constante",
        "Replaced {before} key by {after}": "Reemplazada {before} clave por {after}",
        "Replaced {before} keys by {after}": "Reemplazadas {before} claves por {after}",
        "Reprojection error {pixels:.1f} px": "Error de reproyección {pixels:.1f} px",
        "Resample to Scene": "Remuestrear a la escena",
        "Result": "Resultado",
        "Retarget": "Transferir movimiento",
        "Rig": "Rig",
        "Rig Follows": "El rig sigue",
        "Right": "Derecho",
        "Right Ankle": "Tobillo derecho",
        "Right Elbow": "Codo derecho",
        "Right Foot": "Pie derecho",
        "Right Foot Stands": "Pie der. apoyado",
        "Right Hip": "Cadera derecha",
        "Right Knee": "Rodilla derecha",
        "Right Shoulder": "Hombro derecho",
        "Right Wrist": "Muñeca derecha",
        "Roll": "Alabeo",
        "Root Motion": "Movimiento raíz",
        "Rotate the motion so that all foot contacts are level, after which the camera no longer "
        "matches": "Rotar el movimiento para que todos los contactos de los pies queden a nivel; "
        "después la cámara ya no coincide",
        "Rotation": "Rotación",
        "Scale of positions on the floor. 0: the ratio of leg lengths, so that steps fit the rig. "
        "Several people who touch or meet need the same value for all their "
        "rigs": "Escala de las posiciones en el suelo. 0: la proporción de las longitudes de "
        "pierna, para que los pasos se ajusten al rig. Las personas que se tocan o se "
        "encuentran necesitan el mismo valor para todos sus rigs",
        "Show this capture": "Mostrar esta captura",
        "Save the bone map as a JSON file for similar "
        "rigs": "Guardar el mapa de huesos como archivo JSON para rigs similares",
        "Save the expression map as a JSON file for similar "
        "faces": "Guardar el mapa de expresiones como archivo JSON para caras similares",
        "Saved {file}": "Guardado {file}",
        "Scene": "Escena",
        "Scene frame": "Fotograma de la escena",
        "Scope: {progress}   (Esc over the Scope panel to "
        "cancel)": "Scope: {progress}   (Esc sobre el panel de Scope para cancelar)",
        "Seconds before and after the frame over which the correction fades "
        "out": "Segundos antes y después del fotograma en los que la corrección se atenúa",
        "Select a Captured Person": "Seleccione una persona capturada",
        "Select the armature of a capture first": "Seleccione antes el esqueleto de una captura",
        "Select the captured person whose face to "
        "retarget": "Seleccione la persona capturada cuya cara quiera transferir",
        "Selected": "Seleccionada",
        "Set Frame Range": "Rango de fotogramas",
        "Set Scene Frame Rate": "Definir velocidad de la escena",
        "Set from Footage": "La de la filmación",
        "Set the scene to the motion's frame rate. Captures keep their speed, other animation "
        "keeps its "
        "frames": "Dar a la escena la velocidad de fotogramas del movimiento. Las capturas "
        "conservan su ritmo; las demás animaciones, sus fotogramas",
        "Set the scene's frame rate to the "
        "footage's": "Dar a la escena la velocidad de la filmación",
        "Set the scene's frame rate to the footage's unless something in the scene is "
        "animated": "Dar a la escena la velocidad de la filmación, salvo que haya algo animado en "
        "la escena",
        "Set the scene's frame rate to the motion's; otherwise keys may be between "
        "frames": "Dar a la escena la velocidad del movimiento; si no, puede haber claves entre "
        "fotogramas",
        "Several people are captured: select the armature of the one whose motion to "
        "retarget": "Hay varias personas capturadas: seleccione el esqueleto de aquella cuyo "
        "movimiento quiera transferir",
        "Shape": "Forma",
        "Shape Key": "Forma clave",
        "Shape Key or Control": "Forma clave o control",
        "Shape Keys": "Formas clave",
        "Shape Keys per Frame": "Formas clave por fotograma",
        "Shape key of your mesh, or bone of your rig's "
        "face": "Forma clave de su malla, o hueso de la cara de su rig",
        "Shape keys, or in the mesh for formats whose readers limit shape "
        "keys": "Formas clave, o en la malla en formatos cuyos lectores limitan las formas clave",
        "Shortest": "Duración mínima",
        "Show both in the same place": "Mostrar ambos en el mismo lugar",
        "Show both, the rig to the left of the captured "
        "person": "Mostrar ambos, el rig a la izquierda de la persona capturada",
        "Show the captured body from its side in a second viewport, beside the one with the "
        "footage": "Mostrar el cuerpo capturado de lado en una segunda vista, junto a la de la "
        "filmación",
        "Show the pose of the current frame in the preview image, instead of the first one that "
        "needs no "
        "review": "Mostrar en la imagen la pose del fotograma actual, en lugar de la primera que "
        "no requiere revisión",
        "Side by Side": "Lado a lado",
        "Sides Exchanged": "Lados permutados",
        "Slightly less accurate than Best, and "
        "faster": "Algo menos precisa que Óptima, y más rápida",
        "Smallest network: for a first look or a slow "
        "computer": "La red más pequeña: para un primer vistazo o un equipo lento",
        "Smooth the captured motion again, more or less strongly. Keeps corrections, discards "
        "other changes": "Suavizar de nuevo el movimiento capturado, con más o menos fuerza. "
        "Conserva correcciones, descarta otros cambios",
        "Source": "Fuente",
        "Start": "Inicio",
        "Stop the Capture?": "¿Detener la captura?",
        "Stop the live capture. What was recorded is written as keyframes; otherwise the last pose "
        "stays": "Detener la captura en vivo. Lo grabado se escribe como fotogramas clave; si no, "
        "queda la última pose",
        "Stream": "Transmisión",
        "Strength": "Intensidad",
        "Swap the left and right limbs within a span of "
        "frames": "Permutar las extremidades izquierdas y derechas en un rango de fotogramas",
        "Take": "Toma",
        "The axis along which the person is "
        "upright": "Eje a lo largo del cual la persona está de pie",
        "The body's shape as shape keys with one keyframe "
        "each": "La forma del cuerpo como formas clave con un fotograma clave cada una",
        "The built-in body with SMPL's 24 "
        "joints": "El cuerpo incluido, con las 24 articulaciones de SMPL",
        "The built-in body with SMPL+H's 52 joints, fingers "
        "included": "El cuerpo incluido, con las 52 articulaciones de SMPL+H, dedos incluidos",
        "The capture does not say where its footage "
        "is": "La captura no indica dónde está su filmación",
        "The capture is linked from {file}: make it "
        "local": "La captura está vinculada desde {file}: conviértala en local",
        "The capture that is selected in the panel, with all its "
        "people": "La captura seleccionada en el panel, con todas sus personas",
        "The capture that the active object belongs "
        "to": "La captura a la que pertenece el objeto activo",
        "The captured person was deleted": "Se borró la persona capturada",
        "The collection '{name}' is hidden; show it in the "
        "Outliner": "La colección '{name}' está oculta; muéstrela en el listado",
        "The corrections put a foot up to {depth:.0f} cm under the floor: move the pin "
        "up": "Las correcciones ponen un pie hasta {depth:.0f} cm bajo el suelo: suba el anclaje",
        "The corrections put a foot up to {depth:.0f} cm under the floor in {count} of {total} "
        "frames: move the pin "
        "up": "Las correcciones ponen un pie hasta {depth:.0f} cm bajo el suelo en {count} de "
        "{total} fotogramas: suba el anclaje",
        "The footage is already in the sequencer": "La filmación ya está en el editor de video",
        "The left foot": "El pie izquierdo",
        "The lower one of the two in this frame": "El más bajo de los dos en este fotograma",
        "The most prominent people, up to a "
        "number": "Las personas principales, hasta cierto número",
        "The most prominent person": "La persona principal",
        "The pelvis moves through the scene": "La pelvis se mueve por la escena",
        "The pelvis moves through the scene, as "
        "captured": "La pelvis se mueve por la escena, como se capturó",
        "The processor": "El procesador",
        "The rig chosen under Retarget, with its current animation and its "
        "meshes": "El rig elegido en Transferir movimiento, con su animación actual y sus mallas",
        "The right foot": "El pie derecho",
        "The same, with a keyframe on every "
        "frame": "Lo mismo, con un fotograma clave en cada fotograma",
        "The scene contains no capture yet": "La escena aún no contiene ninguna captura",
        "The scene contains no captured video or imported "
        "motion": "La escena no contiene ningún video capturado ni movimiento importado",
        "The scene has no camera of a capture: capture with the option Camera with "
        "Footage": "La escena no tiene cámara de una captura: capture con la opción Cámara con "
        "filmación",
        "The scene has {rate:.5g} frames/s, like the "
        "motion": "La escena tiene {rate:.5g} fotogramas/s, como el movimiento",
        "The scene has {rate:.5g} frames/s; animation that was not captured plays {factor:.3g} "
        "times as "
        "fast": "La escena tiene {rate:.5g} fotogramas/s; la animación no capturada va "
        "{factor:.3g} veces más rápido",
        "The scene has {scene:.5g} frames/s and the footage {footage:.5g}: the strip will not stay "
        "synchronized with the "
        "motion": "La escena tiene {scene:.5g} fotogramas/s y la filmación {footage:.5g}: el clip "
        "no seguirá sincronizado con el movimiento",
        "The scene's frame rate was changed from {was:.5g} to {now:.5g}, which changed the "
        "motion's speed; importing an FBX file does "
        "that": "La velocidad de fotogramas de la escena cambió de {was:.5g} a {now:.5g}, lo que "
        "cambió el ritmo del movimiento; importar un archivo FBX tiene ese efecto",
        "This Blender was built without USD; use a build from blender.org, or another "
        "format": "Este Blender se compiló sin USD; use uno de blender.org u otro formato",
        "This motion was captured on uneven ground, where feet rest at any height: use Floor "
        "Here": "Este movimiento se capturó en un suelo irregular, donde los pies se apoyan a "
        "cualquier altura: use «El suelo está aquí»",
        "Threads": "Hilos",
        "Toggle the view of the body over the footage. Sets the scene's camera and "
        "resolution": "Alternar la vista del cuerpo sobre la filmación. Define la cámara y la "
        "resolución de la escena",
        "Transfer the captured expressions to the mesh's shape keys or the rig's face, as a new "
        "action": "Transferir las expresiones capturadas a las formas clave de la malla o a la "
        "cara del rig, como una acción nueva",
        "Transfer the captured motion to your rig, as a new action. One of the same capture is "
        "replaced if "
        "unchanged": "Transferir el movimiento capturado a su rig, como acción nueva. La de la "
        "misma captura se reemplaza si no cambió",
        "Travel Scale": "Escala de recorrido",
        "Turn the capture and its camera so that a line in an orthographic view from a side is "
        "upright": "Girar la captura y su cámara para que una línea en una vista ortográfica "
        "lateral sea vertical",
        "Turn the capture and its camera so that a line in the footage is "
        "upright": "Girar la captura y su cámara para que una línea de la filmación sea vertical",
        "Turns down, in degrees": "Gira hacia abajo, en grados",
        "Turns to the person's left, in "
        "degrees": "Gira hacia la izquierda de la persona, en grados",
        "Turns with the left side up, in "
        "degrees": "Gira con el lado izquierdo hacia arriba, en grados",
        "Uneven Ground": "Suelo irregular",
        "Upright Line": "Línea vertical",
        "Use the short clip that is included with Scope": "Usar el clip corto incluido en Scope",
        "Use this in the viewport with the footage": "Úselo en la vista con la filmación",
        "Value of a shape key": "Valor de una forma clave",
        "Value where the expression is 1: at most 10, or 180 degrees; several expressions add "
        "up": "Valor donde la expresión es 1: como máximo 10, o 180 grados; varias expresiones se "
        "suman",
        "Video": "Vídeo",
        "Video of a person, which is played in real "
        "time": "Vídeo de una persona, que se reproduce en tiempo real",
        "Video or image of a person to capture": "Video o imagen de una persona para capturar",
        "Wait until somebody is seen": "Espere hasta que se vea a alguien",
        "Waiting for the source": "Esperando la fuente",
        "Warnings": "Advertencias",
        "What to export": "Qué exportar",
        "Where the joint is in that frame": "Dónde está la articulación en ese fotograma",
        "Source of the images": "De dónde vienen las imágenes",
        "Where the root motion is stored": "Dónde se guarda el movimiento raíz",
        "Where the root motion of the rig is stored": "Dónde se guarda el movimiento raíz del rig",
        "Which foot rests on the floor": "Qué pie descansa en el suelo",
        "Which foot stands": "Qué pie está apoyado",
        "Which limbs are exchanged": "Qué extremidades se intercambian",
        "Who made this asset": "Quién creó este recurso",
        "With Heading": "Con orientación",
        "A foot is up to {depth:.0f} cm under this floor in {count} of {total} frames: press Floor "
        "Here in a frame in which it rests on the floor, or use Snap Feet to "
        "Floor": "Con este suelo, un pie queda hasta {depth:.0f} cm por debajo en {count} de "
        "{total} fotogramas: pulse «El suelo está aquí» en un fotograma en el que esté "
        "apoyado o use «Ajustar pies al suelo»",
        "Write a separate file for each person": "Escribir un archivo aparte por persona",
        "Write captures to a file": "Escribir capturas en un archivo",
        "Write the recorded images of a camera or stream as a video beside the .blend file, from "
        "which a more accurate motion of the same take can be "
        "captured": "Escribir las imágenes grabadas de una cámara o transmisión como vídeo junto "
        "al archivo .blend, a partir del cual se puede capturar un movimiento más "
        "preciso de la misma toma",
        "Writing the recording": "Escribiendo la grabación",
        "Wrote {files} in {folder}": "Escrito {files} en {folder}",
        "Y points down, as in the camera's axes of pose estimation "
        "networks": "Y apunta hacia abajo, como en los ejes de cámara de las redes de estimación "
        "de pose",
        "Y points up, as in AIST++ and most "
        "engines": "Y apunta hacia arriba, como en AIST++ y la mayoría de motores",
        "Yaw": "Guiñada",
        "Your own SMPL, SMPL+H, SMPL-X or STAR "
        "file": "Su propio archivo SMPL, SMPL+H, SMPL-X o STAR",
        "Z points up, as in AMASS": "Z apunta hacia arriba, como en AMASS",
        "removed": "eliminada",
        "{count} bone": "{count} hueso",
        "{count} bones": "{count} huesos",
        "{count} entries": "{count} entradas",
        "{count} entry": "{count} entrada",
        "{count} frame": "{count} fotograma",
        "{count} frames": "{count} fotogramas",
        "{count} people": "{count} personas",
        "{count} person": "{count} persona",
        "{frames}, captured in {time}": "{frames}, capturados en {time}",
        "{joint} cannot reach the pin and stays {distance} away: move the pin closer, or pin the "
        "pelvis too": "{joint} no alcanza el anclaje y queda a {distance}: acerque el anclaje o "
        "ancle también la pelvis",
        "{path} is not a file; choose a video or "
        "image": "{path} no es un archivo; elija un video o una imagen",
        "{rate:.0f} pose/s, latency {latency:.0f} "
        "ms": "{rate:.0f} pose/s, latencia {latency:.0f} ms",
        "{rate:.0f} poses/s, latency {latency:.0f} "
        "ms": "{rate:.0f} poses/s, latencia {latency:.0f} ms",
        "{size} of captures in {folder}": "{size} de capturas en {folder}",
    }
)
