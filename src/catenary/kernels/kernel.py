"""Kernel: one quantity of one robot as machine code, for control loops and for many configurations."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.kernels.bind import bind
from catenary.kernels.tracing import Line, widths_of

_NDARRAY, _FLOAT64 = np.ndarray, np.dtype(np.float64)
_CONTIGUOUS_STRIDES = (_FLOAT64.itemsize,)  # strides of a contiguous row


class Kernel:
    """One quantity of one robot as machine code, with inputs such as `q` and `gravity`.

    `kernel(q, gravity)` returns a new array. `kernel.bind(q, gravity, out)` returns a function without arguments that
    runs on these very arrays, for loops: it takes a tenth of the time. `kernel.rows(q, gravity)` takes many
    configurations, without Python's lock. Single calls and rows take what `as_array` takes. None looks at values, so
    that a control loop counts its NaN: one reaches every number that depends on it. Any number of threads may call.

    Its machine code is made when it is first called or bound, and found in the user's cache afterwards (compiled.py);
    it is pickled without.
    """

    def __init__(self, name: str, line: Line, shape: tuple[int, ...]) -> None:
        """Take a name of letters, digits and hyphens, and a line, with the shape of one configuration's result."""
        self.name, self.line, self.shape = name, line, shape
        self.inputs = widths_of(line)  # names and sizes of one configuration's arrays

    def __reduce__(self) -> tuple[type["Kernel"], tuple[str, Line, tuple[int, ...]]]:
        # machine code is made, or found, where it is unpickled
        return Kernel, (self.name, self.line, self.shape)

    def __deepcopy__(self, memo: dict[int, Any]) -> "Kernel":
        return self  # nothing of it ever changes

    def __repr__(self) -> str:
        return f"Kernel({self.name!r}, {', '.join([*self.inputs, 'out'])})"

    @property
    def into(self) -> Callable[..., None]:
        """`into(INPUT..., out)`, for compiled functions to call; it checks nothing."""
        return self._functions.into

    def ready(self) -> "Kernel":
        """Return the kernel itself, compiled for single calls."""
        self(*map(np.zeros, self.inputs.values()))
        return self

    def __call__(self, *inputs: ArrayLike) -> Floats:
        """Return the quantity at one configuration, a new array."""
        out = self.of_finite(inputs)
        if out is None:
            widths = zip(self.inputs.items(), self._counted(inputs), strict=True)
            out = np.empty(self.shape)
            self._single(*(as_array(name, array, (n,), finite=False) for (name, n), array in widths), out)
        return out

    def of_finite(self, inputs: tuple[ArrayLike, ...]) -> Floats | None:
        """Return the quantity at one configuration; None where inputs are not finite float64 arrays of its size."""
        for array in inputs:
            # numba would refuse other arrays too, but in 300 us
            if type(array) is not _NDARRAY or array.dtype is not _FLOAT64 or array.strides != _CONTIGUOUS_STRIDES:
                return None
        out = np.empty(self.shape)
        try:
            return out if self._single(*inputs, out) else None
        except (InputError, TypeError):  # another size or number of arrays
            return None

    def bind(self, *arrays: Floats) -> Callable[[], None]:
        """Return a function without arguments that reads the inputs and writes `out`; see `catenary.kernels.bind`."""
        *inputs, out = self._counted(arrays, "out")
        shapes = {**{name: (width,) for name, width in self.inputs.items()}, "out": self.shape}
        for (name, shape), array in zip(shapes.items(), arrays, strict=True):
            if getattr(array, "dtype", None) != np.float64 or array.shape != shape:
                got = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else type(array).__name__
                raise InputError(f"{name}: expected a float64 array of shape {shape}, got {got}")
        return bind(self.into, inputs, [out])

    def rows(self, *inputs: ArrayLike, out: Floats | None = None) -> Floats:
        """Return the quantity at N configurations, (N, ...); an input has N rows, or one for all.

        Memory that is used again, `out` (N, ...), contiguous, saves up to half the time.
        """
        arrays = [
            as_array(name, value, (None, width), finite=False)
            for (name, width), value in zip(self.inputs.items(), self._counted(inputs), strict=True)
        ]
        count = next((len(array) for array in arrays if len(array) != 1), 1)
        for name, array in zip(self.inputs, arrays, strict=True):
            if len(array) not in (1, count):
                raise InputError(f"{name}: expected 1 or {count} rows, got {len(array)}")
        shape = (count, *self.shape)
        if out is None:
            out = np.empty(shape)
        elif not isinstance(out, _NDARRAY) or out.shape != shape or out.dtype != _FLOAT64 or not out.flags.carray:
            got = f"{out.dtype} {out.shape}" if isinstance(out, _NDARRAY) else type(out).__name__
            raise InputError(f"out: expected a contiguous float64 array of shape {shape}, got {got}")
        self._functions.rows(*arrays, out.reshape(count, len(self.line.results)))
        return out

    @cached_property
    def _functions(self) -> Any:
        # numba takes a second to import and to make ready: not before there is something to compile
        from catenary.kernels.machine_code import numba_functions

        return numba_functions(self.name, self.line, self.shape)

    @cached_property
    def _single(self) -> Callable[..., bool]:
        single = self._functions.single
        return getattr(single, "code", single)  # numba's own

    def _counted(self, arrays: tuple[Any, ...], *further: str) -> tuple[Any, ...]:
        names = [*self.inputs, *further]
        if len(arrays) != len(names):
            raise InputError(f"{self.name}: expected {len(names)} arrays ({', '.join(names)}), got {len(arrays)}")
        return arrays
