# SPDX-License-Identifier: GPL-3.0-or-later
"""MPI-INF-3DHP's test set: MATLAB 7.3 files, whose axes are in the opposite order."""

import h5py
import numpy as np
import pytest
from scope.benchmarks.evaluation.files import DatasetError
from scope.benchmarks.evaluation.models import Models
from scope.benchmarks.evaluation.readers.mpi_inf_3dhp import clips

from ..made_data import write_3dhp

JOINTS = np.random.default_rng(0).normal(scale=500, size=(4, 17, 3)) + [0, 0, 4000]
VALID = np.array([1, 0, 1, 1])
FILE = "mpi_inf_3dhp_test_set/TS3/annot_data.mat"


def test_an_array_that_claims_more_than_memory_is_not_read(tmp_path):
    write_3dhp(tmp_path, JOINTS, VALID)
    with h5py.File(tmp_path / FILE, "r+") as file:
        del file["annot3"]
        file.create_dataset("annot3", (1 << 40, 1, 17, 3), "f8", chunks=(1, 1, 17, 3))
    with pytest.raises(DatasetError, match="annot3 claims shape"):
        clips(tmp_path, Models())[2].truth()


def test_values_in_other_files_are_not_read(tmp_path):
    write_3dhp(tmp_path, JOINTS, VALID)
    (tmp_path / "secret").write_bytes(bytes(4 * 17 * 3 * 8))
    with h5py.File(tmp_path / FILE, "r+") as file:
        del file["annot3"]
        outside = [(str(tmp_path / "secret"), 0, h5py.h5f.UNLIMITED)]
        file.create_dataset("annot3", (4, 1, 17, 3), "f8", external=outside)
    with pytest.raises(DatasetError, match="annot3 is no array of the file itself"):
        clips(tmp_path, Models())[2].truth()
