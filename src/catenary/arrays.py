"""Checks at the public door: what comes in is a finite float64 array of the shape that was asked for."""

from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.errors import InputError

Floats = NDArray[np.float64]
_FLOAT64 = np.dtype(np.float64)
_FEW = 64  # numbers that Python adds up sooner than NumPy is called


def as_array(name: str, values: ArrayLike, shape: tuple[int | None, ...], *, finite: bool = True) -> Floats:
    """Return `values` as a C-contiguous float64 array of the expected shape.

    Args:
        name: What the values are; opens every error message.
        values: Anything NumPy can read as numbers.
        shape: Expected shape; None stands for any length.
        finite: Refuse NaN and infinity.

    Raises:
        InputError: Not numbers, another shape, NaN or infinity.
    """
    array = _as_floats(name, values, shape)
    if array.shape != shape and (
        array.ndim != len(shape)
        or any(n is not None and n != m for n, m in zip(shape, array.shape, strict=True))
    ):
        raise InputError(f"{name}: expected shape {_shape_text(shape)}, got {array.shape}")
    if finite:
        refuse_non_finite(name, array)
    return array


def as_positive(name: str, values: ArrayLike, shape: tuple[int | None, ...] = ()) -> Floats:
    """Return `as_array` of numbers that are all above zero.

    Raises:
        InputError: As for `as_array`, or zero or less.
    """
    array = as_array(name, values, shape)
    if not (array > 0.0).all():
        raise InputError(f"{name}: expected more than 0, got {array.tolist()}")
    return array


def as_batch(name: str, values: ArrayLike, width: int) -> tuple[Floats, bool]:
    """Return `values` of shape (width,) or (N, width) as (N, width), and whether it was a single row.

    Raises:
        InputError: Another shape, NaN or infinity.
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
        f"{name}{where} is {array[first]}: expected finite numbers "
        f"({len(bad)} of {array.size} values are not)"
    )


def frozen(array: NDArray[Any]) -> NDArray[Any]:
    """Return a read-only copy."""
    copy = np.array(array)
    copy.setflags(write=False)
    return copy


def _as_floats(name: str, values: ArrayLike, shape: tuple[int | None, ...]) -> Floats:
    """Return a C-contiguous float64 array; text and complex numbers, which NumPy would convert, are refused."""
    if type(values) is np.ndarray and values.dtype is _FLOAT64 and values.flags.carray:
        return values
    try:
        raw = np.asarray(values)
        if raw.dtype.kind in "SUc":
            raise TypeError(f"NumPy type {raw.dtype}")
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


def _shape_text(shape: tuple[int | None, ...]) -> str:
    inner = ", ".join("N" if n is None else str(n) for n in shape)
    return f"({inner},)" if len(shape) == 1 else f"({inner})"
