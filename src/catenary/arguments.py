"""Wrong arguments of public functions: what Python says of them deep inside, told by name at the door."""

import functools
import inspect
import types
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Literal, TypeVar, Union, Unpack, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from catenary.errors import CatenaryError, InputError

Public = TypeVar("Public", bound=Callable[..., Any])
_RAW = (TypeError, AttributeError, ValueError, LookupError, ArithmeticError)
_OF_ARRAYS = frozenset(get_args(ArrayLike))
_NUMBERS = (int, float, np.integer, np.floating)
LONGEST = 60  # characters of a value that an error shows


def explained(public: Public) -> Public:
    """Have a function, or a class where it is made, say which argument is wrong.

    A call that succeeds costs nothing more. One that fails with an error of Python's or NumPy's is looked at again: if
    an argument is not what its annotation says, InputError names it; otherwise the error stays as it is.
    """
    function = public.__init__ if isinstance(public, type) else public  # type: ignore[misc]

    @functools.wraps(function)
    def call(*args: Any, **named: Any) -> Any:
        try:
            return function(*args, **named)
        except CatenaryError:
            raise
        except _RAW as error:
            if (told := _wrong_argument(function, args, named)) is None:
                raise
            raise InputError(told) from error

    if isinstance(public, type):
        public.__init__ = call  # type: ignore[misc]
        return public
    return call  # type: ignore[return-value]


def _wrong_argument(function: Callable[..., Any], args: tuple[Any, ...], named: Mapping[str, Any]) -> str | None:
    """Say which argument is not what its annotation says; None where none is, or some are missing."""
    try:
        given = inspect.signature(function).bind(*args, **named).arguments
    except TypeError:
        return None
    hints = _hints(function)
    for name, hint in list(hints.items()):
        if get_origin(hint) is Unpack:  # **options: each is an argument of its own
            given |= given.pop(name, {})
            hints |= get_type_hints(get_args(hint)[0], include_extras=True)
    for name, value in given.items():
        if name in hints and not fits(value, hints[name]):
            shown = repr(value)
            cut = f"{shown[:LONGEST]}..." if len(shown) > LONGEST else shown
            wants_robot = getattr(hints[name], "__name__", "") == "RobotModel" and isinstance(value, str)
            hint = f'; catenary.load_robot("{value}") may make one' if wants_robot else ""
            return f"{name}: expected {expected(hints[name])}, got {type(value).__name__} {cut}{hint}"
    return None


def _hints(function: Callable[..., Any]) -> dict[str, Any]:
    """Return the annotations of a function, but for those of packages that are imported for types alone."""
    try:
        return get_type_hints(function, include_extras=True)
    except NameError:
        return {name: hint for name, hint in function.__annotations__.items() if not isinstance(hint, str)}


def fits(value: Any, hint: Any) -> bool:
    """Return whether a value is what an annotation says, as far as that can be told without using it."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return fits(value, parts[0])
    if origin in (Union, types.UnionType):
        has_array = _OF_ARRAYS <= set(parts)  # whose own parts say little: text and bytes are among them
        rest = [part for part in parts if not (has_array and part in _OF_ARRAYS)]
        return (has_array and _is_array(value)) or any(fits(value, part) for part in rest)
    if origin is Literal:
        return any(type(value) is type(choice) and value == choice for choice in parts)
    if hint is None or hint is types.NoneType:
        return value is None
    if hint is float:
        return isinstance(value, _NUMBERS) and not isinstance(value, bool)
    if hint is int:
        return isinstance(value, int | np.integer) and not isinstance(value, bool)
    if origin is not None and isinstance(origin, type):
        return _fits_container(value, origin, parts)
    if not isinstance(hint, type):
        return True
    if getattr(hint, "_is_protocol", False):
        return all(hasattr(value, name) for name in _members(hint))
    return isinstance(value, hint)


def expected(hint: Any) -> str:
    """Return an annotation in words."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return expected(parts[0])
    if origin in (Union, types.UnionType):
        has_array = _OF_ARRAYS <= set(parts)
        rest = [part for part in parts if not (has_array and part in _OF_ARRAYS)]
        said = dict.fromkeys([*(["numbers"] if has_array else []), *map(expected, rest)])
        return " or ".join(said)
    if origin is Literal:
        return "one of " + ", ".join(map(repr, parts))
    if hint in (None, types.NoneType):
        return "None"
    if hint is float:
        return "a number"
    if hint is int:
        return "a whole number"
    if origin is np.ndarray:
        return "a NumPy array"
    return getattr(origin or hint, "__name__", str(hint))


def _fits_container(value: Any, origin: type, parts: tuple[Any, ...]) -> bool:
    if not isinstance(value, origin) or (origin is Sequence and isinstance(value, str)):
        return False
    if issubclass(origin, Mapping):
        return all(fits(key, parts[0]) and fits(each, parts[1]) for key, each in value.items())  # type: ignore[attr-defined]
    if origin is tuple and Ellipsis not in parts:
        return len(value) == len(parts) and all(fits(each, part) for each, part in zip(value, parts, strict=True))  # type: ignore[arg-type, call-overload]
    if origin in (tuple, list, Sequence):
        return all(fits(each, parts[0]) for each in value)  # type: ignore[attr-defined]
    return True


def _is_array(value: Any) -> bool:
    try:
        return np.asarray(value).dtype.kind in "iufb"
    except (TypeError, ValueError):
        return False


def _members(protocol: type) -> list[str]:
    return [
        name for one in protocol.__mro__ if getattr(one, "_is_protocol", False) for name in vars(one) if name[0] != "_"
    ]
