# SPDX-License-Identifier: GPL-3.0-or-later
"""Spanish."""

STAGES = {
    "Starting": "Iniciando",
    "Finding the person": "Buscando a la persona",
    "Finding the shape": "Buscando la forma",
    "Solving": "Calculando",
    "Solving the clip": "Calculando el clip",
    "Solving each frame": "Calculando cada fotograma",
    "Writing": "Escribiendo",
    "Building the scene": "Creando la escena",
    "Compiling the solver": "Compilando el algoritmo",
    "{stage} (first capture only)": "{stage} (solo en la primera captura)",
    "{stage}, {done} of {total}": "{stage}, {done} de {total}",
    "{rate:.1f} frames/s": "{rate:.1f} fotogramas/s",
    "{time} left": "quedan {time}",
}
