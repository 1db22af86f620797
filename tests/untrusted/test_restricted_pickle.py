# SPDX-License-Identifier: GPL-3.0-or-later
"""Hostile pickles: each must end in a ModelFileError and leave no trace."""

from __future__ import annotations

import pickle
import struct
import tracemalloc

import numpy as np
import pytest
from scope.scope_addon.untrusted import pickles
from scope.scope_addon.untrusted.body_file import load_model
from scope.solver.errors import ModelFileError

RECONSTRUCT = b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85U\x01b\x87R"
F8 = (
    b"cnumpy\ndtype\nU\x02f8K\x00K\x01\x87R(K\x03U\x01<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb"
)


def array(shape: bytes, raw: bytes, dtype: bytes = F8) -> bytes:
    """Opcodes of an array with this shape (opcodes of a tuple) and data (opcodes of a string)."""
    return RECONSTRUCT + b"(K\x01" + shape + dtype + b"\x89" + raw + b"tb"


def text(value: str) -> bytes:
    return b"X" + struct.pack("<I", len(value)) + value.encode()


def under(key: str, value: bytes) -> bytes:
    """A table with one entry."""
    return b"\x80\x02}" + text(key) + value + b"s."


def csc(shape: bytes, data: bytes, indices: bytes, indptr: bytes) -> bytes:
    """A table with a CSC matrix of these parts."""
    entries = (
        text("_shape")
        + shape
        + text("data")
        + data
        + text("indices")
        + indices
        + text("indptr")
        + indptr
    )
    return under("J_regressor", b"cscipy.sparse.csc\ncsc_matrix\n)\x81}(" + entries + b"ub")


class Calls:
    """Pickles as a call."""

    def __init__(self, function, *arguments):
        self.call = function, arguments

    def __reduce__(self):
        return self.call


def global_call(module: str, name: str, *arguments: str) -> bytes:
    return f"c{module}\n{name}\n(".encode() + b"".join(text(a) for a in arguments) + b"tR."


# Code that creates the file SENTINEL when the pickle is really loaded.
WRITE = "open('SENTINEL', 'w').close()"
TOUCH = global_call("os", "system", "touch SENTINEL")
RUNS_CODE = {
    "os.system": (TOUCH, r"os\.system"),
    "eval": (global_call("builtins", "eval", WRITE), r"builtins\.eval"),
    "stack global": (
        b"\x80\x04" + text("os") + text("system") + b"\x93(" + TOUCH.split(b"(")[1],
        r"os\.system",
    ),
    "inst": (b"(" + text("touch SENTINEL") + b"ios\nsystem\n.", r"os\.system"),
    "obj": (b"(cos\nsystem\n" + text("touch SENTINEL") + b"o.", r"os\.system"),
    "numpy's own exec": (
        global_call("numpy.testing._private.utils", "runstring", WRITE),
        "runstring",
    ),
    "new object": (
        b"\x80\x02csubprocess\nPopen\n(" + text("touch SENTINEL") + b"t\x81.",
        r"subprocess\.Popen",
    ),
    "hidden in an array's state": (under("f", array(b")", TOUCH[:-1])), r"os\.system"),
    "after the model": (b"}0" + TOUCH, r"os\.system"),
    "dotted name": (
        b"\x80\x04" + text("numpy") + text("ndarray.__class__") + b"\x93.",
        r"ndarray\.__class__",
    ),
    "class change": (
        b"cnumpy\nndarray\n}" + text("__class__") + b"Nsb.",
        "sets attributes of a function",
    ),
}


@pytest.mark.parametrize("name", RUNS_CODE)
def test_code_in_a_pickle_never_runs(tmp_path, monkeypatch, name):
    data, message = RUNS_CODE[name]
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "body.pkl"
    path.write_bytes(data)
    with pytest.raises(ModelFileError, match=message) as caught:
        load_model(path)
    assert str(path) in str(caught.value)
    assert [p.name for p in tmp_path.iterdir()] == ["body.pkl"]


FORBIDDEN = [
    "numpy.load",
    "numpy.ndarray.tofile",
    "builtins.getattr",
    "builtins.dict",
    "copyreg.__newobj__",
    "scipy.sparse.csc.os",
    "scipy.sparse.dok_matrix",
    "chumpy.ch.ChLambda",
    "_codecs.decode",
    "scope.scope_addon.untrusted.body_file.load_model",
    ".",
    "numpy.",
]


@pytest.mark.parametrize("dotted", FORBIDDEN)
def test_every_other_global_is_refused_by_name(tmp_path, dotted):
    module, name = dotted.rsplit(".", 1)
    (tmp_path / "body.pkl").write_bytes(f"c{module}\n{name}\n)R.".encode())
    with pytest.raises(ModelFileError) as caught:
        load_model(tmp_path / "body.pkl")
    assert dotted in str(caught.value)


HUGE = struct.pack("<I", 2**31 - 1)
DEEP = 90_000
NEW_F8 = F8.split(b"(")[0]  # before its state
RECODE = b"c_codecs\nencode\n(h\x00" + text("latin1") + b"tR"
EMPTY_ARRAY = array(b"K\x00\x85", b"U\x00")
TWO_ZEROS = array(b"K\x02\x85", b"U\x10" + bytes(16))
NO_ARRAYS = (EMPTY_ARRAY,) * 3
REFUSED = {
    "empty": b"",
    "not a table": b"]N.",
    "an empty table": b"}.",
    "missing mark": b"t.",
    "binary persistent id": b"NQ.",
    "extension code 2": b"\x83\x01\x00.",
    "out-of-band buffer": b"\x80\x05\x97.",
    "call of a string": under("f", text("os.system") + b")R"),
    "attributes of a table": b"}}" + text("__class__") + b"Nsb.",
    "key without value": b"}(Nu.",
    "items of a list as a set": b"\x80\x04](N\x90.",
    "array as a key": b"}" + EMPTY_ARRAY + b"Ns.",
    "tuple as a key": b"})Ns.",
    "tuple of doubling tuples as a key": b"})" + b"2\x86" * 80 + b"Ns.",
    "doubling tuples in a frozen set": b"\x80\x04}()" + b"2\x86" * 80 + b"\x91Ns.",
    "deep tuple in a set": b"\x80\x04}\x8f()" + b"\x85" * DEEP + b"\x90Ns.",
    "attributes of a class": b"cchumpy.ch\nCh\nN}" + text("part") + b"Ns\x86b.",
    "the array class as an instance": b"cnumpy\nndarray\n)\x81.",
    "a subclass to "
    "reconstruct": b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\ndtype\nK\x00\x85U\x01b\x87R.",
    "reconstructor with another "
    "base": b"ccopy_reg\n_reconstructor\n(cchumpy.ch\nCh\ncnumpy\nndarray\nNtR.",
    "reconstructor with a "
    "value": b"ccopy_reg\n_reconstructor\n(cchumpy.ch\nCh\nc__builtin__\nobject\nK\x01tR.",
    "reconstructor of an "
    "array": b"ccopy_reg\n_reconstructor\n(cnumpy\nndarray\nc__builtin__\nobject\nNtR.",
    "recoding by another codec": b"c_codecs\nencode\n(" + text("abc") + text("zlib_codec") + b"tR.",
    "bytes of a size": b"cbuiltins\nbytes\n(J\xff\xff\xff\x7ftR.",
    "state of an array: none": under("f", RECONSTRUCT + b"Nb"),
    "array without state": under("f", RECONSTRUCT),
    "array without type": under("f", array(b"K\x00\x85", b"U\x00", b"N")),
    "array of objects": under(
        "f", array(b"K\x01\x85", b"](K\x01e", b"cnumpy\ndtype\nU\x02O8K\x00K\x01\x87R")
    ),
    "type with fields": under("f", array(b")", b"U\x00", b"cnumpy\ndtype\nU\x02V8K\x00K\x01\x87R")),
    "type with fields in the state": under(
        "f", array(b")", b"U\x00", NEW_F8 + b"(K\x03U\x01<N)}K\x08K\x01K\x00tb")
    ),
    "type by expression": under(
        "f", array(b")", b"U\x00", b"cnumpy\ndtype\n" + text("f8,O") + b"K\x00K\x01\x87R")
    ),
    "type of deep nesting": under(
        "f", array(b")", b"U\x00", b"cnumpy\ndtype\n" + b"]" + b"\x85" * DEEP + b"\x85R")
    ),
    "enormous shape": under("f", array(b"\x8a\x0a" + b"\xff" * 9 + b"\x7f\x85", b"U\x00")),
    "enormous shape, no elements": under(
        "f", array(b"(K\x00\x8a\x09" + b"\xff" * 8 + b"\x7ft", b"U\x00")
    ),
    "negative shape": under("f", array(b"J\xff\xff\xff\xff\x85", b"U\x00")),
    "too many axes": under("f", array(b"(" + b"K\x01" * 70 + b"t", b"U\x08AAAAAAAA")),
    "less data than the shape": under("f", array(b"K\x02\x85", b"U\x08AAAAAAAA")),
    "bytes that are not there": under("f", b"T" + HUGE),
    "byte array that is not there": b"\x80\x05\x96" + struct.pack("<Q", 1 << 40),
    "frame that is not there": b"\x80\x04\x95" + b"\xff" * 8 + b"}",
    "enormous memo index": b"}r\xff\xff\xff\xff0.",
    "memo number of many digits": b"Np" + b"9" * 100_000 + b"\n.",
    "deep lists": under("f", b"]" * DEEP + b"a" * (DEEP - 1)),
    "deep chumpy": under("f", b"cchumpy.ch\nCh\n)\x81" * 40 + b"N" + b"b" * 40),
    "list in itself": under("f", b"]q\x00h\x00a"),
    "chumpy in itself": under("f", b"cchumpy.ch\nCh\n)\x81q\x00}" + text("x") + b"h\x00sb"),
    "chumpy without data": under("f", b"cchumpy.ch\nCh\n)\x81}b"),
    "too many instructions": b"N0" * 200_000 + b"}.",
    "repeated recoding": b"X"
    + struct.pack("<I", 1000)
    + b"a" * 1000
    + b"q\x000"
    + RECODE * 50
    + b".",
    "sparse without state": under("J_regressor", b"cscipy.sparse.csc\ncsc_matrix\n)\x81"),
    "enormous sparse": csc(b"J\xff\xff\xff\x7fJ\xff\xff\xff\x7f\x86", *NO_ARRAYS),
    "sparse shape of a list": csc(b"]", *NO_ARRAYS),
    "sparse with real indices": csc(b"K\x01K\x01\x86", EMPTY_ARRAY, EMPTY_ARRAY, TWO_ZEROS),
    "sparse in itself": under(
        "J_regressor",
        b"cscipy.sparse.csc\ncsc_matrix\n)\x81q\x00}("
        + text("_shape")
        + b"K\x01K\x01\x86"
        + text("data")
        + b"h\x00ub",
    ),
    "sparse of texts": csc(b"K\x01K\x01\x86", text("a"), EMPTY_ARRAY, EMPTY_ARRAY),
}


@pytest.mark.parametrize("name", REFUSED)
def test_damaged_and_hostile_pickles_are_refused(tmp_path, name):
    (tmp_path / "body.pkl").write_bytes(REFUSED[name])
    with pytest.raises(ModelFileError):
        load_model(tmp_path / "body.pkl")


def test_a_sparse_index_that_multiplies_its_data_is_refused(tmp_path):
    i4 = F8.replace(b"f8", b"i8")
    indptr = array(b"K\x02\x85", b"U\x10" + struct.pack("<qq", 0, 2**40), i4)
    data = csc(b"K\x01K\x01\x86", EMPTY_ARRAY, array(b"K\x00\x85", b"U\x00", i4), indptr)
    (tmp_path / "body.pkl").write_bytes(data)
    with pytest.raises(ModelFileError, match="broken index"):
        load_model(tmp_path / "body.pkl")


def test_memory_stays_within_a_small_multiple_of_the_file(tmp_path):
    block = b"T" + struct.pack("<i", 8_000_000) + bytes(8_000_000) + b"q\x000"
    # 2.4 GB if each were a copy
    arrays = array(b"J" + struct.pack("<i", 1_000_000) + b"\x85", b"h\x00") * 300
    path = tmp_path / "body.pkl"
    path.write_bytes(b"\x80\x02" + block + b"(" + arrays + b"l.")
    tracemalloc.start()
    try:
        with pytest.raises(ModelFileError, match="contains a list"):
            load_model(path)
        assert tracemalloc.get_traced_memory()[1] < 5 * path.stat().st_size
    finally:
        tracemalloc.stop()


def test_sizes_that_a_file_states_are_not_allocated(tmp_path):
    path = tmp_path / "body.pkl"
    for data in (
        REFUSED[name]
        for name in REFUSED
        if "not there" in name or "memo" in name or "count" in name
    ):
        path.write_bytes(data)
        tracemalloc.start()
        try:
            with pytest.raises(ModelFileError):
                load_model(path)
            assert tracemalloc.get_traced_memory()[1] < 5_000_000
        finally:
            tracemalloc.stop()


def test_an_oversized_file_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(pickles, "LARGEST_FILE", 1000)
    (tmp_path / "body.pkl").write_bytes(bytes(1001))
    with pytest.raises(ModelFileError, match="too large"):
        load_model(tmp_path / "body.pkl")


def test_calls_made_by_python_itself_are_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for protocol in range(6):
        data = pickle.dumps(
            {"v_template": np.zeros(3), "trap": Calls(open, "SENTINEL", "w")}, protocol
        )
        (tmp_path / "body.pkl").write_bytes(data)
        with pytest.raises(ModelFileError, match="open"):
            load_model(tmp_path / "body.pkl")
    assert not (tmp_path / "SENTINEL").exists()
