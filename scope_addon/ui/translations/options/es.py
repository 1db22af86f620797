# SPDX-License-Identifier: GPL-3.0-or-later
"""Spanish."""

OPTIONS = {
    "Add the estimated camera, with the footage in its "
    "background": "Agregar la cámara estimada, con la filmación como fondo",
    "Add timeline markers where the motion should be "
    "reviewed": "Agregar marcadores en la línea de tiempo donde convenga revisar el movimiento",
    "At Most": "Como máximo",
    "Calibration": "Calibración",
    "Camera with Footage": "Cámara con filmación",
    "Capture only a part of the video": "Capturar solo una parte del video",
    "Capture the expressions of the face and the gaze as well; takes "
    "longer": "Capturar también las expresiones de la cara y la mirada; tarda más",
    "Capture the fingers as well, on the body with hands; takes "
    "longer": "Capturar también los dedos, en el cuerpo con manos; tarda más",
    "CPU threads for the networks; 0: all "
    "cores": "Hilos de CPU para las redes; 0: todos los núcleos",
    "End of the captured part, in seconds": "Fin de la parte capturada, en segundos",
    "Execution Provider": "Motor de ejecución",
    "Field of View": "Campo de visión",
    "Field of view along the longer side of the "
    "image": "Campo de visión a lo largo del lado mayor de la imagen",
    "First Frame": "Primer fotograma",
    "Focal Length": "Distancia focal",
    "Frame Rate": "Velocidad",
    "Frames per second, if the file does not state them; 0: "
    "30": "Fotogramas por segundo, si el archivo no los indica; 0: 30",
    "From": "Desde",
    "Height (cm)": "Estatura (cm)",
    "How the person's body shape is stored": "Cómo se guarda la forma del cuerpo de la persona",
    "How the scene's frame rate is set": "Cómo se define la velocidad de la escena",
    "JSON file with OpenCV intrinsics (3x3), optionally dist (five values) and size (width, "
    "height)": "Archivo JSON con parámetros intrínsecos de OpenCV (3x3), opcionalmente dist (cinco "
    "valores) y size (ancho, alto)",
    "Keypoint Network": "Red de puntos clave",
    "Markers": "Marcadores",
    "Maximum number of people": "Número máximo de personas",
    "Maximum number of people to follow; each one takes "
    "time": "Número máximo de personas a seguir; cada una requiere tiempo",
    "Name of the next capture, its actions and the exported animation; if empty, the footage's "
    "name": "Nombre de la próxima captura, de sus acciones y de la animación exportada; vacío: el "
    "nombre de la filmación",
    "Part of the Video": "Parte del video",
    "People": "Personas",
    "People to capture": "Personas que capturar",
    "People walk on stairs, steps or slopes: feet rest at any height instead of on one horizontal "
    "floor": "Las personas caminan por escaleras, escalones o pendientes: los pies se apoyan a "
    "cualquier altura y no en un único suelo horizontal",
    "Person Detector": "Detector de personas",
    "Remove jitter and lock feet in contact with the floor; off keeps the per-frame "
    "solution": "Eliminar temblores y fijar los pies en contacto con el suelo; desactivado "
    "conserva la solución por fotograma",
    "Scene frame at which the footage starts": "Fotograma de la escena en que empieza la filmación",
    "Set the scene's frame range to the captured "
    "frames": "Ajustar el rango de fotogramas de la escena a los capturados",
    "Smooth": "Suavizar",
    "SMPL, SMPL+H, SMPL-X or STAR model (.npz or .pkl); if empty, the one in the "
    "preferences": "Modelo SMPL, SMPL+H, SMPL-X o STAR (.npz o .pkl); vacío: el de las "
    "preferencias",
    "Speed versus accuracy": "Rapidez frente a precisión",
    "Start of the captured part, in seconds": "Inicio de la parte capturada, en segundos",
    "The body that is fitted to the person": "El cuerpo que se ajusta a la persona",
    "To": "Hasta",
    "Unit": "Unidad",
    "Unit of length in .bvh files": "Unidad de longitud en archivos .bvh",
    "Up": "Arriba",
    "Where the camera's focal length comes from": "De dónde viene la distancia focal de la cámara",
    "Which way is up in the file; files written by Scope have z "
    "up": "Hacia dónde es arriba en el archivo; en los de Scope, z apunta hacia arriba",
}
