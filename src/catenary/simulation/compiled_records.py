"""Records of named numbers and arrays of fixed shapes, which compiled code takes as one argument.

numba unpacks every array of a call, so passing an arm's eighty small arrays one by one would cost more than its
physics. A record is one structured array: `cable.stiffness[j]` is the same memory in Python and in compiled code.
Shapes are given by name, "joint" or "link"; sizes are a RAVEN-II's unless a subclass has other `sizes`.
"""

from collections.abc import Mapping
from inspect import get_annotations
from typing import Annotated, Any, ClassVar, Self, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats

POSITIONING, TOOLS = 3, 4  # numbers of positioning and tool joints of an arm; its axes are these in this order
AXES = POSITIONING + TOOLS
OFF, POSITION, TORQUE = 0, 1, 2  # modes of an axis: no output, position control, commanded joint torque

# array sizes of a RAVEN-II's arm; "node" is a link or the base
SIZES: Mapping[str, int] = {
    "joint": POSITIONING,
    "tool": TOOLS,
    "axis": AXES,
    "link": POSITIONING,
    "node": POSITIONING + 1,
}

# types of fields
PerJoint = Annotated[Floats, "f8", ("joint",)]  # joint behind a cable, or its cable
PerTool = Annotated[Floats, "f8", ("tool",)]
PerAxis = Annotated[Floats, "f8", ("axis",)]
CodePerAxis = Annotated[NDArray[np.int64], "i8", ("axis",)]
_SCALARS = {float: "f8", bool: "?"}


class _Field:
    """Descriptor of a field: a view of an array, a copy of a number."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, record: "Record", _: type) -> Any:
        return record.view(np.ndarray)[self._name][()]

    def __set__(self, record: "Record", value: object) -> None:
        record[self._name] = value


class Record(np.ndarray[Any, np.dtype[Any]]):
    """One record, or rows of records; compiled functions read the same attributes of `record[()]` or `rows[k]`."""

    fields: ClassVar[tuple[str, ...]]
    layout: ClassVar[np.dtype[Any]]
    sizes: ClassVar[Mapping[str, int]] = SIZES

    def __init_subclass__(cls) -> None:
        hints = get_type_hints(cls, include_extras=True)
        above = (base for base in reversed(cls.__mro__) if issubclass(base, Record) and base is not Record)
        cls.fields = tuple(name for base in above for name in get_annotations(base))
        cls.layout = np.dtype([(name, *_storage(hints[name], cls.sizes)) for name in cls.fields], align=True)
        hidden = [name for name in cls.fields if hasattr(np.ndarray, name)]
        if hidden:
            raise TypeError(f"{cls.__name__}: NumPy's arrays have attributes of their own named {', '.join(hidden)}")
        for name in cls.fields:
            setattr(cls, name, _Field(name))

    def __new__(cls, **fields: object) -> Self:
        """Create one record; missing fields are zero."""
        record = cls.rows(())  # not a copy, which would leave padding bytes uninitialised
        for name, value in fields.items():
            record[name] = value
        return record

    @classmethod
    def rows(cls, shape: int | tuple[()]) -> Self:
        """Create an array of records, all zero."""
        return np.zeros(shape, cls.layout).view(cls)

    def __getitem__(self, key: Any) -> Any:  # NumPy's type stubs know no fields
        return super().__getitem__(key)

    def replace(self, **fields: object) -> Self:
        """Return a copy with new values in the given fields."""
        copy = self.copy()
        for name, value in fields.items():
            copy[name] = value
        return copy


def _storage(hint: Any, sizes: Mapping[str, int]) -> tuple[str, tuple[int, ...]]:
    if hint in _SCALARS:
        return _SCALARS[hint], ()
    _, kind, shape = get_args(hint)
    return kind, tuple(sizes.get(length, length) for length in shape)
