# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the motion files of two folders byte for byte: ``same_results.py BEFORE AFTER``.

Capture the clips with both versions first, twice with each: the run that compiles the solver may differ in the last
bits from one that finds the machine code on disk.
"""

import sys
from pathlib import Path

import numpy as np


def differing(before: Path, after: Path) -> list[str]:
    """Return the keys whose arrays differ in type, shape or any bit."""
    a, b = np.load(before), np.load(after)
    return sorted(
        key
        for key in {*a.files, *b.files}
        if key not in a.files
        or key not in b.files
        or a[key].dtype != b[key].dtype
        or a[key].shape != b[key].shape
        or a[key].tobytes() != b[key].tobytes()
    )


if __name__ == "__main__":
    folder_before, folder_after = map(Path, sys.argv[1:3])
    names = sorted(path.name for path in folder_before.glob("*.npz"))
    results = {name: differing(folder_before / name, folder_after / name) for name in names}
    for name, keys in results.items():
        print(name, "differs in " + ", ".join(keys) if keys else "identical")
    sys.exit(any(results.values()) or not names)
