"""A line of operations as compiled functions: one configuration a call, and many."""

from hashlib import sha256
from pathlib import Path
from types import ModuleType

from catenary.kernels import llvm_line, sines
from catenary.kernels.cache import load_module
from catenary.kernels.line_text import widths_of
from catenary.kernels.llvm_line import LANES, line_code
from catenary.kernels.tracing import Line

TEXT = '''"""{title}: {operations} sums and products, {angles} angles."""
# line {line}, written by {writers}

from catenary.errors import InputError


@compiled
def into({inputs}, out):
    one(({inputs}, out), {zeros}, {zeros})


@compiled_for("boolean({arrays}, {out})")
def single({inputs}, out):
    if {wrong}:
        raise InputError("expected {expected}")
    one(({inputs}, out), {zeros}, {zeros})
    total = 0.0  # NaN where a number is not finite
    for array in ({inputs},):
        for number in array:
            total += 0.0 * number
    return total == 0.0


@compiled
def rows({inputs}, out):
    step = ({steps}, {size})
    whole = len(out) - len(out) % {lanes}
    for k in range(0, whole, {lanes}):
        several(({inputs}, out), ({starts}, {size} * k), step)
    for k in range(whole, len(out)):
        one(({inputs}, out), ({starts}, {size} * k), step)
'''


def numba_functions(title: str, line: Line, shape: tuple[int, ...]) -> ModuleType:
    """Make a module of compiled functions that run a line of operations.

    `into(INPUT..., out)`, of arrays of one configuration each, is for compiled callers and for `bind`; it checks
    nothing. `single(INPUT..., out)` is for Python: it refuses other arrays (TypeError) and other sizes (InputError),
    and returns whether all inputs are finite. `rows(INPUT..., out)` takes `out` (N, size) and inputs of N rows or one
    row each.

    Args:
        title: What it computes; letters, digits and hyphens.
        line: The operations.
        shape: Of one configuration's result.
    """
    widths = widths_of(line)
    writers = [Path(file) for file in (str(sines.__file__), str(llvm_line.__file__), __file__)]
    text = TEXT.format(
        title=title,
        operations=line.operations,
        angles=line.angles,
        line=sha256(repr(line).encode()).hexdigest(),
        # numba looks for changes in the calling file alone
        writers=sha256(b"".join(path.read_bytes() for path in writers)).hexdigest()[:32],
        inputs=", ".join(widths),
        zeros=f"({', '.join(['0'] * (len(widths) + 1))})",
        wrong=" or ".join(f"len({name}) != {width}" for name, width in widths.items()),
        expected=", ".join(f"{name} ({width},)" for name, width in widths.items()),
        arrays=", ".join(["Array(float64, 1, 'C', readonly=True)"] * len(widths)),
        out=f"float64[{':, ' * (len(shape) - 1)}::1]",
        steps=", ".join(f"{width} * (len({name}) > 1)" for name, width in widths.items()),
        starts=", ".join(f"step[{i}] * k" for i in range(len(widths))),
        size=len(line.results),
        lanes=LANES,
    )
    return load_module(title, text, {"one": line_code(line), "several": line_code(line, LANES)})
