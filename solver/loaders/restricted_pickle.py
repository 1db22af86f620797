# SPDX-License-Identifier: GPL-3.0-or-later
"""A pickle interpreter for body files, protocols 0 to 5, Python 2 and 3, that cannot run anything.

Python's own unpickler imports what a file names and calls it. This one is a stack machine over plain values: a global
becomes a ``Role`` when it is on the list of ``pickled_values`` and an error otherwise, and every call is carried out
by the few constructions written there. Python 2 strings stay bytes, so that array data is never recoded.

Bounds: the file's size, the number of opcodes, and recoded text, which may not exceed the file's size; every array is
a view of bytes in the file. So memory stays within a small multiple of the file. Nothing here recurses.
"""

from __future__ import annotations

import codecs
import pickle
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import ModelFileError
from .pickled_values import (
    CLASSES,
    Opaque,
    PickledArray,
    PickledDtype,
    PickledObject,
    Role,
    array_from_bytes,
    resolve_global,
)

LARGEST_FILE = 1 << 30  # bytes; the largest official SMPL-X pickle has half of it
MOST_OPCODES = 200_000  # official files need a few thousand
LONGEST_NUMBER = 64  # characters or bytes of one number


def read_pickle(path: Path) -> dict[str, Any]:
    """The dictionary at the top of a body pickle, e.g. of an SMPL .pkl file; values as in ``pickled_values``.

    :raises ModelFileError: unreadable, too large, damaged, or asks for anything but arrays; nothing has run then.
    """
    try:
        with path.open("rb") as file:  # read() sets aside as much as it is asked for
            data = file.read(min(path.stat().st_size, LARGEST_FILE) + 1)
    except OSError as cause:
        raise ModelFileError(f"{path} cannot be read ({cause.strerror}); choose another body file") from cause
    if len(data) > LARGEST_FILE:
        raise ModelFileError(f"{path} is larger than {LARGEST_FILE >> 20} MiB, too large for a body file")
    try:
        result = Interpreter(data).run()
    except ModelFileError as cause:
        raise ModelFileError(f"{path} cannot be used as a body: {cause}; get it from its publisher again") from None
    except (ValueError, IndexError, KeyError, TypeError, OverflowError, struct.error, MemoryError) as cause:
        raise ModelFileError(f"{path} is not a readable pickle ({cause}); download it again") from cause
    if not isinstance(result, dict):
        raise ModelFileError(f"{path} holds a {type(result).__name__} and not a table of arrays; choose a body file")
    return result


class Interpreter:
    """The stack machine: ``stack`` since the last mark, ``marks`` the stacks below it, ``memo`` the shared values."""

    def __init__(self, data: bytes):
        self.data = data
        self.position = 0
        self.stack: list[Any] = []
        self.marks: list[list[Any]] = []
        self.memo: dict[int, Any] = {}
        self.recoded = 0

    def run(self) -> Any:
        """The value on top of the stack at STOP."""
        for _ in range(MOST_OPCODES):
            opcode = self.take(1)
            if opcode == pickle.STOP:
                return self.stack.pop()
            handler = HANDLERS.get(opcode)
            if handler is None:
                raise ModelFileError(f"it uses the pickle instruction {opcode!r}, which a body file has no use for")
            handler(self)
        raise ModelFileError(f"it has more than {MOST_OPCODES} pickle instructions, too many for a body file")

    # reading

    def take(self, count: int) -> bytes:
        """The next ``count`` bytes."""
        end = self.position + count
        if count < 0 or end > len(self.data):
            raise ModelFileError("it ends too early")
        chunk = self.data[self.position : end]
        self.position = end
        return chunk

    def line(self) -> bytes:
        """The rest of the line, without its end."""
        chunk = self.take(self.data.find(b"\n", self.position) - self.position)
        self.position += 1
        return chunk

    def unpack(self, form: str) -> Any:
        """One number in ``struct`` notation."""
        return struct.unpack(form, self.take(struct.calcsize(form)))[0]

    def number(self) -> bytes:
        """A line that holds one number."""
        text = self.line()
        if len(text) > LONGEST_NUMBER:
            raise ModelFileError("it holds a number with too many digits")
        return text

    # the stack

    def push(self, value: Any) -> None:
        """Put a value on the stack."""
        self.stack.append(value)

    def pop_mark(self) -> list[Any]:
        """Everything above the last mark."""
        above = self.stack
        self.stack = self.marks.pop()
        return above

    def mark(self) -> None:
        """MARK."""
        self.marks.append(self.stack)
        self.stack = []

    def pop(self) -> None:
        """POP, which also takes away a mark that lies on top."""
        if self.stack:
            self.stack.pop()
        else:
            self.pop_mark()

    def integer(self) -> None:
        """INT, which also spells the truth values."""
        text = self.number()
        self.push({b"00": False, b"01": True}.get(text) if text in (b"00", b"01") else int(text))

    def long_binary(self, form: str) -> None:
        """LONG1 and LONG4."""
        size = self.unpack(form)
        if size > LONGEST_NUMBER:
            raise ModelFileError("it holds a number with too many digits")
        self.push(int.from_bytes(self.take(size), "little", signed=True))

    def string(self) -> None:
        """STRING: a quoted Python 2 string."""
        text = self.line()
        if len(text) < 2 or text[:1] not in (b"'", b'"') or text[-1:] != text[:1]:
            raise ModelFileError("it holds a string without quotes")
        self.push(codecs.escape_decode(text[1:-1])[0])  # type: ignore[attr-defined]

    def append(self, items: list[Any]) -> None:
        """APPEND and APPENDS."""
        target = self.stack[-1]
        if type(target) is not list:
            raise ModelFileError("it adds items to something that is not a list")
        target.extend(items)

    def set_items(self, items: list[Any]) -> None:
        """SETITEM and SETITEMS."""
        target = self.stack[-1]
        if type(target) is not dict:
            raise ModelFileError("it adds keys to something that is not a table")
        target.update(_table(items))

    def add_items(self) -> None:
        """ADDITEMS: sets are never looked into."""
        self.pop_mark()
        if not isinstance(self.stack[-1], Opaque):
            raise ModelFileError("it adds items to something that is not a set")

    def drop_set(self) -> None:
        """FROZENSET."""
        self.pop_mark()
        self.push(Opaque())

    def put(self, index: int) -> None:
        """PUT and its binary forms; a dictionary, so that a large index costs nothing."""
        self.memo[index] = self.stack[-1]

    def get(self, index: int) -> None:
        """GET and its binary forms."""
        if index not in self.memo:
            raise ModelFileError("it refers to a value that it has not defined")
        self.push(self.memo[index])

    # globals and calls

    def global_by_line(self) -> None:
        """GLOBAL and INST: both name a module and an attribute."""
        module, name = self.line(), self.line()
        self.push(resolve_global(module.decode("latin1"), name.decode("latin1")))

    def global_by_stack(self) -> None:
        """STACK_GLOBAL."""
        name, module = self.stack.pop(), self.stack.pop()
        self.push(resolve_global(module, name))

    def inst(self) -> None:
        """INST is never needed; naming the global makes the better message."""
        self.global_by_line()
        raise ModelFileError("it makes an object of an old kind that body files do not hold")

    def reduce(self) -> None:
        """REDUCE: carry out the call that a role stands for."""
        arguments, role = self.stack.pop(), self.stack.pop()
        if not isinstance(role, Role) or type(arguments) is not tuple:
            raise ModelFileError("it calls something that is not a function")
        self.push(self.call(role, arguments))

    def new_object(self) -> None:
        """NEWOBJ, for sparse matrices and chumpy arrays."""
        arguments, role = self.stack.pop(), self.stack.pop()
        if not isinstance(role, Role) or role not in CLASSES or type(arguments) is not tuple:
            raise ModelFileError("it makes an object of a kind that body files do not hold")
        self.push(PickledObject(role))

    def build(self) -> None:
        """BUILD: hand the state to the value, which knows its own form."""
        state = self.stack.pop()
        target = self.stack[-1]
        if not isinstance(target, PickledArray | PickledDtype | PickledObject):
            raise ModelFileError(f"it sets attributes of a {type(target).__name__}")
        target.build(state)

    def call(self, role: Role, arguments: tuple[Any, ...]) -> Any:
        """The value of one allowed call."""
        match role, arguments:
            case Role.RECONSTRUCT, (Role.NDARRAY, _, _):
                return PickledArray()
            case Role.DTYPE, (text, *_):
                return PickledDtype(text)
            case Role.SCALAR, (dtype, raw):
                return array_from_bytes(raw, dtype, (), "C")[()]
            case Role.FROM_BUFFER, (raw, dtype, shape, order):
                return array_from_bytes(raw, dtype, shape, order)
            case Role.ENCODE, (str() as text, "latin1" | "latin-1" | b"latin1"):
                return self.encode(text)
            case Role.BYTES, ():
                return b""
            case Role.BYTES, (bytes() as raw,):
                return raw
            case Role.BYTES, (str() as text, "latin1" | "latin-1"):
                return self.encode(text)
            case Role.SET, _:
                return Opaque()
            case Role.RECONSTRUCTOR, (Role() as kind, Role.OBJECT, None) if kind in CLASSES:
                return PickledObject(kind)
        raise ModelFileError(f"it calls {role.name.lower()} in a way that body files do not")

    def encode(self, text: str) -> bytes:
        """Bytes that Python 3 wrote as text for old protocols; each at most once, or the sum could grow without end."""
        self.recoded += len(text)
        if self.recoded > len(self.data):
            raise ModelFileError("it repeats its data more often than a body file does")
        return text.encode("latin1")


def _table(items: list[Any]) -> dict[Any, Any]:
    """Alternating keys and values; Python 2 string keys become text."""
    if len(items) % 2:
        raise ModelFileError("it holds a table with a key but no value")
    keys = [key.decode("latin1") if isinstance(key, bytes) else key for key in items[::2]]
    if any(type(key) not in (str, int, float, bool, type(None)) for key in keys):
        raise ModelFileError("it holds a table whose keys are not plain values")
    return dict(zip(keys, items[1::2], strict=True))


def _top(machine: Interpreter, count: int) -> list[Any]:
    """Take the top ``count`` values off the stack."""
    if len(machine.stack) < count:
        raise ModelFileError("it takes more values off the stack than there are")
    values = machine.stack[len(machine.stack) - count :]
    del machine.stack[len(machine.stack) - count :]
    return values


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "surrogatepass")


Handler = Callable[[Interpreter], object]

# Persistent ids, the extension registry, out-of-band buffers, OBJ and NEWOBJ_EX are left out on purpose.
HANDLERS: dict[bytes, Handler] = {
    pickle.PROTO: lambda m: m.take(1),
    pickle.FRAME: lambda m: m.take(8),
    pickle.MARK: Interpreter.mark,
    pickle.POP: Interpreter.pop,
    pickle.POP_MARK: Interpreter.pop_mark,
    pickle.DUP: lambda m: m.push(m.stack[-1]),
    pickle.NONE: lambda m: m.push(None),
    pickle.NEWTRUE: lambda m: m.push(True),
    pickle.NEWFALSE: lambda m: m.push(False),
    pickle.INT: Interpreter.integer,
    pickle.BININT: lambda m: m.push(m.unpack("<i")),
    pickle.BININT1: lambda m: m.push(m.unpack("<B")),
    pickle.BININT2: lambda m: m.push(m.unpack("<H")),
    pickle.LONG: lambda m: m.push(int(m.number().removesuffix(b"L"))),
    pickle.LONG1: lambda m: m.long_binary("<B"),
    pickle.LONG4: lambda m: m.long_binary("<I"),
    pickle.FLOAT: lambda m: m.push(float(m.number())),
    pickle.BINFLOAT: lambda m: m.push(m.unpack(">d")),
    pickle.STRING: Interpreter.string,
    pickle.BINSTRING: lambda m: m.push(m.take(m.unpack("<i"))),
    pickle.SHORT_BINSTRING: lambda m: m.push(m.take(m.unpack("<B"))),
    pickle.BINBYTES: lambda m: m.push(m.take(m.unpack("<I"))),
    pickle.SHORT_BINBYTES: lambda m: m.push(m.take(m.unpack("<B"))),
    pickle.BINBYTES8: lambda m: m.push(m.take(m.unpack("<Q"))),
    pickle.BYTEARRAY8: lambda m: m.push(m.take(m.unpack("<Q"))),
    pickle.UNICODE: lambda m: m.push(m.line().decode("raw-unicode-escape")),
    pickle.BINUNICODE: lambda m: m.push(_text(m.take(m.unpack("<I")))),
    pickle.SHORT_BINUNICODE: lambda m: m.push(_text(m.take(m.unpack("<B")))),
    pickle.BINUNICODE8: lambda m: m.push(_text(m.take(m.unpack("<Q")))),
    pickle.EMPTY_LIST: lambda m: m.push([]),
    pickle.LIST: lambda m: m.push(m.pop_mark()),
    pickle.APPEND: lambda m: m.append(_top(m, 1)),
    pickle.APPENDS: lambda m: m.append(m.pop_mark()),
    pickle.EMPTY_TUPLE: lambda m: m.push(()),
    pickle.TUPLE: lambda m: m.push(tuple(m.pop_mark())),
    pickle.TUPLE1: lambda m: m.push(tuple(_top(m, 1))),
    pickle.TUPLE2: lambda m: m.push(tuple(_top(m, 2))),
    pickle.TUPLE3: lambda m: m.push(tuple(_top(m, 3))),
    pickle.EMPTY_DICT: lambda m: m.push({}),
    pickle.DICT: lambda m: m.push(_table(m.pop_mark())),
    pickle.SETITEM: lambda m: m.set_items(_top(m, 2)),
    pickle.SETITEMS: lambda m: m.set_items(m.pop_mark()),
    pickle.EMPTY_SET: lambda m: m.push(Opaque()),
    pickle.ADDITEMS: Interpreter.add_items,
    pickle.FROZENSET: Interpreter.drop_set,
    pickle.PUT: lambda m: m.put(int(m.number())),
    pickle.BINPUT: lambda m: m.put(m.unpack("<B")),
    pickle.LONG_BINPUT: lambda m: m.put(m.unpack("<I")),
    pickle.MEMOIZE: lambda m: m.put(len(m.memo)),
    pickle.GET: lambda m: m.get(int(m.number())),
    pickle.BINGET: lambda m: m.get(m.unpack("<B")),
    pickle.LONG_BINGET: lambda m: m.get(m.unpack("<I")),
    pickle.GLOBAL: Interpreter.global_by_line,
    pickle.STACK_GLOBAL: Interpreter.global_by_stack,
    pickle.INST: Interpreter.inst,
    pickle.REDUCE: Interpreter.reduce,
    pickle.NEWOBJ: Interpreter.new_object,
    pickle.BUILD: Interpreter.build,
}
