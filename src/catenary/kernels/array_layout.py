"""Where the fields of NumPy's array object lie, for machine code that looks at arrays without asking NumPy.

They are part of NumPy's binary interface, as is the function that makes arrays: extension modules have them compiled
in. All the same they are tried on arrays before any code relies on them (`known_layout`); where they lie elsewhere,
arrays are looked at and made in Python, which takes its time.
"""

import ctypes
import sys
from functools import cache
from typing import Any, NamedTuple

import numpy as np

HEAD = object.__basicsize__
# offsets of fields, from numpy/arrayobject.h and numpy/ndarraytypes.h
TYPE = HEAD - 8
DATA, DIMENSIONS, SHAPE, DESCRIPTION, FLAGS = (HEAD + k for k in (0, 8, 16, 40, 48))
BYTE_ORDER, TYPE_NUMBER = HEAD + 10, HEAD + 12
READABLE = 0x0001 | 0x0100  # C contiguous, aligned
WRITABLE = READABLE | 0x0400
EMPTY = 184  # number of PyArray_Empty(int dimensions, npy_intp *shape, PyArray_Descr *type, int fortran) in the table


class ArrayKind(NamedTuple):
    """Arrays of one type and shape, contiguous, and whether they are written to."""

    dtype: str
    shape: tuple[int, ...]
    writable: bool

    def address(self, given: object) -> int:
        """Where an array lies; 0 if it is another."""
        if type(given) is not np.ndarray or given.dtype != self.dtype or given.shape != self.shape:
            return 0
        flags = given.flags
        fits = flags.c_contiguous and flags.aligned and (flags.writeable or not self.writable)
        return int(given.ctypes.data) if fits else 0


@cache
def empty_address() -> int:
    """Where NumPy's function that makes arrays lies: PyArray_Empty, which takes over its caller's count of the type."""
    pointer = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
        ("PyCapsule_GetPointer", ctypes.pythonapi)
    )
    table = pointer(np._core._multiarray_umath._ARRAY_API, None)  # type: ignore[attr-defined]  # as import_array()
    return int(ctypes.c_uint64.from_address(table + 8 * EMPTY).value)


@cache
def known_layout() -> bool:
    """Whether arrays' fields lie where they are looked for."""
    if sys.implementation.name != "cpython" or ctypes.sizeof(ctypes.c_void_p) != 8:
        return False
    array = np.zeros((2, 3))
    fixed = np.zeros((2, 3))
    fixed.flags.writeable = False

    def field(of: np.ndarray[Any, Any], offset: int, kind: Any) -> int:
        return int(kind.from_address(id(of) + offset).value)

    description = field(array, DESCRIPTION, ctypes.c_uint64)
    shape = (ctypes.c_int64 * 2)(5, 7)
    make = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_int, ctypes.c_void_p, ctypes.py_object, ctypes.c_int)(
        empty_address()
    )
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(array.dtype))
    made = make(2, shape, array.dtype, 0)
    return (
        field(array, TYPE, ctypes.c_uint64) == id(np.ndarray)
        and field(array, DATA, ctypes.c_uint64) == array.ctypes.data
        and field(array, DIMENSIONS, ctypes.c_int) == 2
        and description == id(array.dtype)
        and ctypes.c_int.from_address(description + TYPE_NUMBER).value == array.dtype.num
        and ctypes.c_char.from_address(description + BYTE_ORDER).value == b"="
        and field(array, FLAGS, ctypes.c_int) & WRITABLE == WRITABLE
        and field(fixed, FLAGS, ctypes.c_int) & WRITABLE == READABLE
        and field(array.T, FLAGS, ctypes.c_int) & 1 == 0
        and (ctypes.c_int64 * 2).from_address(field(array, SHAPE, ctypes.c_uint64))[:] == [2, 3]
        and type(made) is np.ndarray
        and (made.shape, made.dtype, made.flags.c_contiguous) == ((5, 7), array.dtype, True)
    )
