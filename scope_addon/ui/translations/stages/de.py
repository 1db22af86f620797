# SPDX-License-Identifier: GPL-3.0-or-later
"""German."""

STAGES = {
    "Starting": "Wird gestartet",
    "Finding the person": "Person wird gesucht",
    "Finding the shape": "Form wird bestimmt",
    "Solving": "Bewegung wird berechnet",
    "Solving the clip": "Bewegung des Clips wird berechnet",
    "Solving each frame": "Jedes Bild wird berechnet",
    "Writing": "Wird geschrieben",
    "Building the scene": "Szene wird aufgebaut",
    "Compiling the solver": "Löser wird kompiliert",
    "{stage} (first capture only)": "{stage} (nur bei der ersten Erfassung)",
    "{stage}, {done} of {total}": "{stage}, {done} von {total}",
    "{rate:.1f} frames/s": "{rate:.1f} Bilder/s",
    "{time} left": "noch {time}",
}
