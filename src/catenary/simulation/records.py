"""Records: named numbers and arrays of fixed shapes, which compiled code takes as one argument.

numba looks at every array of a call, so an arm's eighty small arrays one by one would cost more than its physics. A
record is one array for NumPy, with a structured data type, and a struct for numba: `cable.stiffness[j]` reads, and
writes, the same memory in Python and in compiled code.
"""

from typing import Annotated, Any, ClassVar, Self, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats

POSITIONING, TOOLS = 3, 4  # joints of an arm; its axes are these in this order
AXES = POSITIONING + TOOLS

# fields by what they have a number for
PerJoint = Annotated[Floats, "f8", (POSITIONING,)]  # positioning joint, or its cable
PerTool = Annotated[Floats, "f8", (TOOLS,)]
PerAxis = Annotated[Floats, "f8", (AXES,)]
CodePerAxis = Annotated[NDArray[np.int64], "i8", (AXES,)]
# fields of records that come in rows: a number in one of them, an array (N,) in all
Number = Annotated[Any, "f8", ()]
Index = Annotated[Any, "i8", ()]
_SCALARS = {float: "f8", bool: "?"}


class _Field:
    """A field as an attribute: a view where it is an array, a copy where it is a number."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, record: "Record", _: type) -> Any:
        return record.view(np.ndarray)[self._name][()]

    def __set__(self, record: "Record", value: object) -> None:
        record[self._name] = value


class Record(np.ndarray[Any, np.dtype[Any]]):
    """One record, or rows of them; a subclass declares its fields by annotations.

    Compiled functions receive `record[()]`, or `rows[k]`, and read fields as attributes; so does Python.
    """

    fields: ClassVar[tuple[str, ...]]
    layout: ClassVar[np.dtype[Any]]

    def __init_subclass__(cls) -> None:
        hints = get_type_hints(cls, include_extras=True)
        cls.fields = tuple(cls.__annotations__)
        cls.layout = np.dtype([(name, *_storage(hints[name])) for name in cls.fields], align=True)
        hidden = [name for name in cls.fields if hasattr(np.ndarray, name)]
        if hidden:
            raise TypeError(
                f"{cls.__name__}: NumPy's arrays have attributes of their own named {', '.join(hidden)}"
            )
        for name in cls.fields:
            setattr(cls, name, _Field(name))

    def __new__(cls, **fields: object) -> Self:
        """Make one record; fields that are not given are zero."""
        record = cls.rows(())
        for name, value in fields.items():
            record[name] = value
        return record

    @classmethod
    def rows(cls, shape: int | tuple[()]) -> Self:
        """Make so many records, all zero."""
        return np.zeros(shape, cls.layout).view(cls)

    def __getitem__(self, key: Any) -> Any:  # NumPy's type stubs know no fields
        return super().__getitem__(key)

    def replace(self, **fields: object) -> Self:
        """Return a copy with other values in some fields."""
        copy = self.copy()
        for name, value in fields.items():
            copy[name] = value
        return copy


def _storage(hint: Any) -> tuple[str, tuple[int, ...]]:
    """Return NumPy's name of a field's type, and the field's shape."""
    if hint in _SCALARS:
        return _SCALARS[hint], ()
    _, kind, shape = get_args(hint)
    return kind, shape
