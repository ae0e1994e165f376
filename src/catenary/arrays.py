"""Checks at the public door: what comes in is a finite float64 array of the shape asked for. Rows drawn from many."""

from math import isfinite
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.errors import InputError

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]
_FLOAT64 = np.dtype(np.float64)
_FEW = 64  # numbers that Python adds up sooner than NumPy is called
# by which loggers say that there was no number: spreadsheets' nines, the ends of 16 and 32 bits
_NO_NUMBER = np.array([-999.0, -9999.0, 9999.0, -99999.0, 99999.0, -(2.0**15), 2.0**15 - 1.0, 2.0**16 - 1.0,
                       -(2.0**31), 2.0**31 - 1.0, 2.0**32 - 1.0])  # fmt: skip
_OF_NO_UNIT = 1e10  # beyond it no count and no unit measures a joint: NDI writes -3.697314e28, others 1e30
_FARTHEST = 1e4  # [rad, m] that no joint goes
_APART = 0.5  # of the range of all other numbers, by which -999 lies outside it where it is none


def spread(count: int, max_count: int) -> Integers:
    """Return rising indices, (min(count, most),), of a random subset of rows: one of each of equal parts, seeded.

    Every k-th row would sample a periodic motion at a few of its phases, and hide its delay.

    Args:
        count, max_count: Number of rows, and largest number of indices.
    """
    edges = np.arange(min(count, max_count) + 1) * count // max(1, min(count, max_count))
    drawn = np.random.default_rng(0).random(len(edges) - 1)
    return np.asarray(edges[:-1] + (drawn * np.diff(edges)).astype(np.int64))


_KINDS = {float: ("iuf", "valid numbers"), int: ("iu", "whole numbers"), bool: ("b", "true or false")}


class Listed(NamedTuple):
    """How an array stands in a file: `Annotated[Floats, Listed((None, 3))]` is a field of lists of three numbers.

    pydantic reads and writes it so, to the last bit; what is read is finite, of its kind and its shape.
    """

    shape: tuple[int | None, ...] = (None,)  # None stands for any length
    kind: type[float] = float  # or int, or bool
    null: float | None = None  # what null in a list stands for, such as infinity where there is no limit

    def read(self, values: Any) -> NDArray[Any]:
        """Return the array that lists of numbers make; ValueError where they make none."""
        if self.null is not None and isinstance(values, list):
            values = [self.null if value is None else value for value in values]
        shape, (letters, words) = _shape_text(self.shape), _KINDS[self.kind]
        try:
            array = np.array(values)
        except ValueError as error:
            raise ValueError(f"expected shape {shape}, got rows of different lengths") from error
        if array.size and array.dtype.kind not in letters:
            raise ValueError(f"expected {words}, shape {shape}")
        if not _has_shape(array, self.shape):
            raise ValueError(f"expected shape {shape}, got {array.shape}")
        array = array.astype(self.kind)
        if self.null is None and not np.isfinite(array).all():
            raise ValueError("expected finite numbers")
        return array

    def write(self, array: NDArray[Any]) -> list[Any]:
        """Return an array as lists of numbers."""
        if self.null is None:
            return list(array.tolist())
        return [value if isfinite(value) else None for value in array.tolist()]

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        from pydantic import PlainSerializer, PlainValidator

        return handler.generate_schema(Annotated[Any, PlainValidator(self.read), PlainSerializer(self.write)])


def as_array(name: str, values: ArrayLike, shape: tuple[int | None, ...], *, finite: bool = True) -> Floats:
    """Return numbers as a C-contiguous float64 array of a given shape.

    Args:
        name: The quantity, which opens every message.
        values: Numbers, of any type that converts to float64 without loss of kind.
        shape: Expected shape; None stands for any length.
        finite: Whether NaN and infinity are refused.

    Raises:
        InputError: The values are no numbers, of another shape or, if `finite`, not finite.
    """
    array = _as_floats(name, values, shape)
    if array.shape != shape and not _has_shape(array, shape):
        what = "" if array.ndim else f", {values!r}"
        raise InputError(f"{name}: expected shape {_shape_text(shape)}, got {array.shape}{what}")
    if finite:
        refuse_non_finite(name, array)
    return array


def as_positive(name: str, values: ArrayLike, shape: tuple[int | None, ...] = ()) -> Floats:
    """Return numbers as an array (`as_array`), all above zero.

    Args:
        name, values: Quantity, which opens every message, and its numbers.
        shape: Expected shape; None stands for any length.
    """
    array = as_array(name, values, shape)
    if not (array > 0.0).all():
        raise InputError(f"{name}: expected more than 0, got {array.tolist()}")
    return array


def as_not_negative(name: str, values: ArrayLike, shape: tuple[int | None, ...] = (), *, finite: bool = True) -> Floats:
    """Return numbers as an array (`as_array`), all zero or more.

    Args:
        name, values: Quantity, which opens every message, and its numbers.
        shape: Expected shape; None stands for any length.
        finite: Whether infinity is refused; NaN always is.
    """
    array = as_array(name, values, shape, finite=finite)
    if not (array >= 0.0).all():
        raise InputError(f"{name}: expected zero or more, got {array.tolist()}")
    return array


def one_for_all(values: ArrayLike, n: int) -> ArrayLike:
    """Return a scalar repeated for every joint (n,); anything else unchanged, which the caller checks.

    Args:
        values, n: A scalar or an array of one value per joint, and the number of joints.
    """
    return np.full(n, values) if np.ndim(values) == 0 else values


def as_batch(name: str, values: ArrayLike, width: int) -> tuple[Floats, bool]:
    """Return one row or many as a batch of rows (N, width), and whether a single row was given.

    Args:
        name: The quantity, which opens every message.
        values, width: One row (width,), or N of them (N, width); numbers in a row.
    """
    array = _as_floats(name, values, (width,))
    if array.ndim not in (1, 2) or array.shape[-1] != width:
        raise InputError(f"{name}: expected shape ({width},) or (N, {width}), got {array.shape}")
    refuse_non_finite(name, array)
    single = array.ndim == 1
    return array[None] if single else array, single


def refuse_non_finite(name: str, array: NDArray[Any]) -> None:
    """Refuse NaN and infinity, and say where the first one is."""
    # one pass; a finite sum has only finite terms, and may itself overflow, or meet inf - inf
    if array.size <= _FEW:
        if isfinite(sum(array.ravel().tolist())):
            return
    else:
        with np.errstate(all="ignore"):
            if np.isfinite(np.sum(array)):
                return
    bad = np.argwhere(~np.isfinite(array))
    if len(bad) == 0:  # a scalar has one place, of no indices
        return  # the sum itself overflowed
    first = tuple(int(i) for i in bad[0])
    where = f"[{', '.join(map(str, first))}]" if first else ""
    raise InputError(
        f"{name}{where} is {array[first]}: expected finite numbers ({len(bad)} of {array.size} values are not)"
    )


def without_missing(values: NDArray[Any], to_si: float = 0.0) -> NDArray[Any]:
    """Return a joint's samples (N,) with NaN in place of loggers' sentinels; the same array if none is missing.

    Args:
        values: Samples of one joint, (N,).
        to_si: Factor to rad or m, for positions: isolated samples beyond any joint's reach are then missing, too.
    """
    with np.errstate(invalid="ignore"):
        size = np.abs(np.asarray(values, dtype=np.float64))
        if not (size >= -_NO_NUMBER[0]).any() and not (size * abs(to_si) > _FARTHEST).any():
            return values
        far = size * abs(to_si) > _FARTHEST
        missing = (size >= _OF_NO_UNIT) | (far & (2 * far.sum() < len(far)))
    sentinel = np.isin(values, _NO_NUMBER) & ~missing
    others = values[np.isfinite(values) & ~missing & ~sentinel]
    low, high = (others.min(), others.max()) if len(others) else (np.nan, np.nan)
    missing |= sentinel & ~(np.maximum(low - values, values - high) < _APART * (high - low))
    return np.where(missing, np.nan, values) if missing.any() else values


def frozen(array: NDArray[Any]) -> NDArray[Any]:
    """Return a read-only copy; an array that is mapped from disk for reading is one already."""
    if isinstance(array, np.memmap) and not array.flags.writeable:
        return array
    copy = np.array(array)
    copy.setflags(write=False)
    return copy


def _as_floats(name: str, values: ArrayLike, shape: tuple[int | None, ...]) -> Floats:
    """Return a C-contiguous float64 array; what NumPy would convert unasked is refused."""
    if type(values) is np.ndarray and values.dtype is _FLOAT64 and values.flags.carray:
        return values
    try:
        raw = np.asarray(values)
        if raw.dtype.kind in "SUcMm" or (raw.dtype.kind == "O" and any(isinstance(x, str | bytes) for x in raw.flat)):
            raise TypeError(f"NumPy type {raw.dtype}")
        if np.ma.is_masked(values):  # masked values are no measurements
            raise TypeError("masked values")
        array = np.asarray(raw, dtype=np.float64, order="C")  # ascontiguousarray would make a scalar (1,)
        # compiled code would be compiled once more for read-only arrays, such as a model's own limits
        return array if array.flags.writeable else array.copy()
    except RuntimeError as error:  # a tensor of torch whose operations are recorded
        if not getattr(values, "requires_grad", False):
            raise
        raise InputError(
            f"{name}: got a tensor that records gradients, expected numbers: pass {name.split()[0]}.detach(); "
            "functions that have gradients come from catenary.export_function"
        ) from error
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected numbers of shape {_shape_text(shape)}, got {values!r}") from error


def _has_shape(array: NDArray[Any], shape: tuple[int | None, ...]) -> bool:
    return array.ndim == len(shape) and all(n is None or n == m for n, m in zip(shape, array.shape, strict=True))


def _shape_text(shape: tuple[int | None, ...]) -> str:
    inner = ", ".join("N" if n is None else str(n) for n in shape)
    return f"({inner},)" if len(shape) == 1 else f"({inner})"
