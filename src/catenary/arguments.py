"""Argument validation of the public API: wrong types are reported by name, not by an error from deep inside."""

import contextlib
import functools
import inspect
import types
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Annotated, Any, ForwardRef, Literal, TypeVar, Union, Unpack, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from catenary.errors import CatenaryError, InputError

Public = TypeVar("Public", bound=Callable[..., Any])
_RAW = (TypeError, AttributeError, ValueError, LookupError, ArithmeticError)
_OF_ARRAYS = frozenset(get_args(ArrayLike))
_NUMBERS = (int, float, np.integer, np.floating)
_MAX_SHOWN_LETTERS = 60  # characters of a value that an error shows


def explained(public: Public) -> Public:
    """Have a function and what it returns, or a class, say which argument is wrong; help shows types by their names.

    A call that succeeds costs half a microsecond more. One that fails with an error of Python's or NumPy's is looked at
    again: if an argument is not what its annotation says, InputError names it; otherwise the error stays as it is.
    """
    if not isinstance(public, type):
        returned = _hints(public).get("return")
        if isinstance(returned, type):
            explained(returned)
        return _explained(public)  # type: ignore[return-value]
    for one in [base for base in public.__mro__ if base.__module__.startswith("catenary.")]:
        for name, method in list(vars(one).items()):
            if name == "__new__":  # of a named tuple, which takes anything
                method.__func__.__signature__ = _named(inspect.signature(method))
            elif inspect.isfunction(method) and (name in ("__init__", "__call__") or name[0] != "_"):
                setattr(one, name, method if hasattr(method, "__wrapped__") else _explained(method))
    return public


def _explained(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def call(*args: Any, **named: Any) -> Any:
        try:
            return function(*args, **named)
        except CatenaryError:
            raise
        except Exception as error:
            if not (isinstance(error, _RAW) or type(error).__module__.startswith("numba.")):
                raise
            if (message := _wrong_argument(function, args, named)) is None:
                raise
            raise InputError(message) from error

    call.__signature__ = _named(inspect.signature(function))  # type: ignore[attr-defined]
    return call


class _Named(str):
    """The name of a type, which help shows without quotes."""

    __repr__ = str.__str__


def _named(signature: inspect.Signature) -> inspect.Signature:
    parameters = []
    for one in signature.parameters.values():
        hint = one.empty if one.annotation is one.empty else _Named(_name(one.annotation))
        default = _Named(one.default.__name__) if inspect.isfunction(one.default) else one.default
        parameters.append(one.replace(annotation=hint, default=default))
    return signature.replace(parameters=parameters, return_annotation=_Named(_name(signature.return_annotation)))


def _name(hint: Any) -> str:
    """Return an annotation as its author wrote it, if known."""
    origin, parts = get_origin(hint), get_args(hint)
    if isinstance(hint, str | ForwardRef):
        return hint if isinstance(hint, str) else hint.__forward_arg__
    if origin is Annotated:
        return _name(parts[0])
    if origin in (Union, types.UnionType):
        has_array, others = _members_of_union(parts)
        return " | ".join(dict.fromkeys(["ArrayLike"] * has_array + [*map(_name, others)]))
    if origin is np.ndarray:
        return "NDArray"
    if hint in (None, types.NoneType, inspect.Signature.empty):
        return "None"
    if origin is Literal or not isinstance(origin or hint, type):
        return str(hint).replace("typing.", "")
    name = (origin or hint).__name__
    return f"{name}[{', '.join('...' if part is Ellipsis else _name(part) for part in parts)}]" if parts else name


def _members_of_union(parts: tuple[Any, ...]) -> tuple[bool, list[Any]]:
    """Split a union's members into those that take arrays (text and bytes among them), and the rest."""
    has_array = _OF_ARRAYS <= set(parts)
    return has_array, [part for part in parts if not (has_array and part in _OF_ARRAYS)]


def _wrong_argument(function: Callable[..., Any], args: tuple[Any, ...], named: Mapping[str, Any]) -> str | None:
    signature, hints = inspect.signature(function), _hints(function)
    try:
        arguments = signature.bind(*args, **named).arguments
    except TypeError:
        return None
    for name, one in signature.parameters.items():  # of *arrays and **options each is an argument of its own
        if one.kind in (one.VAR_POSITIONAL, one.VAR_KEYWORD) and name in arguments:
            several, hint = arguments.pop(name), hints.pop(name, Any)
            several = several if isinstance(several, dict) else {f"{name}[{k}]": v for k, v in enumerate(several)}
            of_a_table = get_type_hints(get_args(hint)[0], include_extras=True) if get_origin(hint) is Unpack else None
            arguments, hints = arguments | several, hints | (of_a_table or dict.fromkeys(several, hint))
    for name, value in arguments.items():
        is_negative_seed = name == "seed" and isinstance(value, int | np.integer) and value < 0
        if name in hints and (is_negative_seed or not fits(value, hints[name])):
            shown = repr(value)
            cut = f"{shown[:_MAX_SHOWN_LETTERS]}..." if len(shown) > _MAX_SHOWN_LETTERS else shown
            wants_robot = getattr(hints[name], "__name__", "") == "RobotModel" and isinstance(value, str)
            hint = f'; catenary.load_robot("{value}") may make one' if wants_robot else ""
            expected = expected_text(hints[name]) + (", not negative" if is_negative_seed else "")
            return f"{name}: expected {expected}, got {type(value).__name__} {cut}{hint}"
    return None


def _hints(function: Callable[..., Any]) -> dict[str, Any]:
    """Return the annotations of a function, but for those of packages that are imported for types alone."""
    hints: dict[str, Any] = {}
    for name, hint in function.__annotations__.items():
        with contextlib.suppress(NameError):
            one = types.SimpleNamespace(__annotations__={name: hint}, __globals__=function.__globals__)
            hints |= get_type_hints(one, one.__globals__, include_extras=True)
    return hints


def fits(value: Any, hint: Any) -> bool:
    """Return True if a value agrees with an annotation, by what can be checked without using the value."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return fits(value, parts[0])
    if origin in (Union, types.UnionType):
        has_array, others = _members_of_union(parts)
        return (has_array and _is_array(value)) or any(fits(value, part) for part in others)
    if origin is Literal:
        return any(type(value) is type(choice) and value == choice for choice in parts)
    if hint is None or hint is types.NoneType:
        return value is None
    if hint is float:
        return isinstance(value, _NUMBERS) and not isinstance(value, bool)
    if hint is int:
        return isinstance(value, int | np.integer) and not isinstance(value, bool)
    if origin is np.ndarray and np.float64 in get_args(parts[-1]):
        return isinstance(value, np.ndarray) and _is_array(value)
    if origin is not None and isinstance(origin, type):
        return _fits_container(value, origin, parts)
    if not isinstance(hint, type):
        return True
    if getattr(hint, "_is_protocol", False):
        # a property that fails is there
        return all(hasattr(type(value), name) or hasattr(value, name) for name in _members(hint))
    return isinstance(value, hint)


def expected_text(hint: Any) -> str:
    """Return an annotation in words."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return expected_text(parts[0])
    if origin in (Union, types.UnionType):
        has_array, others = _members_of_union(parts)
        return " or ".join(dict.fromkeys(["numbers"] * has_array + [*map(expected_text, others)]))
    if origin is Literal:
        return "one of " + ", ".join(map(repr, parts))
    plain = {types.NoneType: "None", float: "a number", int: "a whole number", np.ndarray: "a NumPy array"}
    return plain.get(origin or hint, getattr(origin or hint, "__name__", str(hint)))


def _fits_container(value: Any, origin: type, parts: tuple[Any, ...]) -> bool:
    if not isinstance(value, origin) or (origin in (Sequence, Iterable) and isinstance(value, str | bytes)):
        return False
    if issubclass(origin, Mapping):
        return all(fits(key, parts[0]) and fits(each, parts[1]) for key, each in value.items())  # type: ignore[attr-defined]
    if origin is tuple and Ellipsis not in parts:
        return len(value) == len(parts) and all(fits(each, part) for each, part in zip(value, parts, strict=True))  # type: ignore[arg-type, call-overload]
    if isinstance(value, Collection) and origin in (tuple, list, Sequence, Iterable):  # not what is read once
        return all(fits(item, parts[0]) for item in value)
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
