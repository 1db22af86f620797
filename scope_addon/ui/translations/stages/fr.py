# SPDX-License-Identifier: GPL-3.0-or-later
"""French."""

STAGES = {
    "Starting": "Démarrage",
    "Finding the person": "Recherche de la personne",
    "Finding the shape": "Recherche de la forme",
    "Solving": "Calcul du mouvement",
    "Solving the clip": "Calcul du mouvement du clip",
    "Solving each frame": "Calcul de chaque image",
    "Writing": "Écriture",
    "Building the scene": "Construction de la scène",
    "Compiling the solver": "Compilation du solveur",
    "{stage} (first capture only)": "{stage} (première capture seulement)",
    "{stage}, {done} of {total}": "{stage}, {done} sur {total}",
    "{rate:.1f} frames/s": "{rate:.1f} images/s",
    "{time} left": "reste {time}",
}
