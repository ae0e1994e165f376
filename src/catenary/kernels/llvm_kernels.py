"""A line of operations as a function of Python's, by LLVM alone (llvm_calls.py), kept in the user's cache."""

import logging
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

from catenary.arrays import Floats
from catenary.kernels import array_layout, line_text, llvm_calls, sines
from catenary.kernels.array_layout import ArrayKind, known_layout
from catenary.kernels.kernel_files import forget, keep_with_digest, kept_with_digest, private_folder
from catenary.kernels.line_text import expected_arrays, llvm_operations, widths_of
from catenary.kernels.llvm_calls import Machine, compile_call, processor, refusing
from catenary.kernels.tracing import Line

_log = logging.getLogger(__name__)
_loaded: dict[str, Machine] = {}  # by digest


def llvm_kernel(line: Line, shape: tuple[int, ...], machine: Machine) -> Callable[..., Floats]:
    """Give `into(INPUT..., out)` of a line's machine code, which returns `out`, and makes it where it is lacking.

    It takes contiguous arrays of float64 of one configuration each, and refuses any other.
    """
    return machine.call(refusing(expected_arrays(line, shape)))


def llvm_machine(stem: str, line: Line, shape: tuple[int, ...], folder: Path | None = None) -> Machine:
    """Compile a line of operations, or find it compiled.

    The machine code is loaded only if it holds, to the byte, what LLVM gave: its digest lies beside it.

    Args:
        stem: What the files' names begin with; letters, digits and hyphens.
        line: The operations.
        shape: Of the result.
        folder: Where files are kept; `cache_folder()` when None.
    """
    digest = _digest(line, shape)
    if digest not in _loaded:
        code = _machine_code(f"{stem}-{digest}.o", line, shape, folder)
        _loaded[digest] = Machine(code, _kinds(line, shape), gives=True)
    return _loaded[digest]


def _digest(line: Line, shape: tuple[int, ...]) -> str:
    """Tell machine code apart by what it does, what wrote it and what it is for."""
    writers = [Path(str(module.__file__)) for module in (array_layout, line_text, sines, llvm_calls)]
    # llvm_code.py is imported only where code is written
    writers += [writers[0].with_name("llvm_code.py"), Path(__file__)]
    of = repr((line, shape, processor(), known_layout())).encode()
    return sha256(of + b"".join(path.read_bytes() for path in writers)).hexdigest()[:32]


def _machine_code(name: str, line: Line, shape: tuple[int, ...], folder: Path | None) -> bytes:
    try:
        path = private_folder(folder) / name
    except (OSError, RuntimeError) as error:  # RuntimeError: no home
        _log.info("kernels are compiled for this process alone: %s", error)
        return _compiled(line, shape)
    content = kept_with_digest(path)
    if content is None:
        content = _compiled(line, shape)
        try:
            forget(path)
            keep_with_digest(name, content, path.parent)
        except OSError as error:
            _log.info("a kernel is not kept: %s", error)
    return content


def _kinds(line: Line, shape: tuple[int, ...]) -> list[ArrayKind]:
    inputs = [ArrayKind("float64", (width,), writable=False) for width in widths_of(line).values()]
    return [*inputs, ArrayKind("float64", shape, writable=True)]


def _compiled(line: Line, shape: tuple[int, ...]) -> bytes:
    from catenary.kernels.llvm_code import WORD, Sines, write_line

    def write(builder: Any, data: list[Any], _: object) -> None:
        def place(array: int, element: int) -> Any:
            return builder.gep(data[array], [WORD(element)])

        write_line(builder, *llvm_operations(line), place, Sines(sines.small_sine_cosine, sines.LARGEST))

    return compile_call(_kinds(line, shape), write, gives=True)
