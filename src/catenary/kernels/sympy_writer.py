"""Writes lines of operations as SymPy expressions, to read, to print as LaTeX and to derive further."""

from typing import Any, NamedTuple

from catenary.errors import MissingPackageError
from catenary.kernels.line_text import widths_of
from catenary.kernels.tracing import Line, evaluate

READABLE = 60  # operations up to which expressions are multiplied out: a RAVEN's three joints
ROUNDING = 1e-12  # of a coefficient, beside the largest one
DOTS = {"qd": r"\dot{q}", "qdd": r"\ddot{q}"}


class SymbolicFunction(NamedTuple):
    """Expressions in symbols: q1, q2, ... are the coordinates, gravity_x, gravity_y, gravity_z the gravity vector."""

    inputs: dict[str, tuple[Any, ...]]  # SymPy symbols of each input array
    result: Any  # sympy.Matrix; a vector is a column

    def latex(self) -> str:
        """Return the result for LaTeX, numbers to six digits."""
        from sympy import latex

        names = {}
        for array, symbols in self.inputs.items():
            for symbol in symbols:
                index = symbol.name.removeprefix(array).lstrip("_")
                names[symbol] = f"{DOTS.get(array, 'g' if array == 'gravity' else array)}_{{{index}}}"
        return str(latex(_to_six_digits(self.result), symbol_names=names))

    def __str__(self) -> str:
        rows = _to_six_digits(self.result).tolist()
        return "\n".join(str(row[0]) if len(row) == 1 else f"[{', '.join(map(str, row))}]" for row in rows)


def sympy_function(line: Line, shape: tuple[int, ...]) -> SymbolicFunction:
    """Return a line's results as SymPy expressions.

    Short lines (60 operations) are multiplied out, with sines and cosines of sums of angles; longer ones stay as nested
    as they were computed, for `sympy.cse`, `sympy.lambdify` and derivatives.

    Args:
        line: The operations.
        shape: Of the result, (m,) or (m, k).
    """
    try:
        import sympy
    except ImportError as error:
        raise MissingPackageError('SymPy expressions need sympy: pip install "catenary[symbolic]"') from error
    inputs = {
        array: tuple(
            sympy.Symbol(f"gravity_{'xyz'[i]}" if array == "gravity" else f"{array}{i + 1}", real=True)
            for i in range(width)
        )
        for array, width in widths_of(line).items()
    }
    entries = evaluate(line, sine=sympy.sin, cosine=sympy.cos, **inputs)
    if line.operations <= READABLE:
        entries = [_multiplied_out(sympy.sympify(entry)) for entry in entries]
    return SymbolicFunction(inputs, sympy.Matrix(shape[0], shape[1] if len(shape) == 2 else 1, entries))


def _multiplied_out(entry: Any) -> Any:
    """Return a sum of products in which each term has at most one sine or cosine, without what rounding left."""
    import sympy
    from sympy.simplify.fu import TR8

    terms = sympy.expand(TR8(sympy.expand(entry))).as_coefficients_dict()
    largest = max((abs(float(value)) for value in terms.values()), default=0.0)
    return sympy.Add(*(v * term for term, v in terms.items() if abs(float(v)) > ROUNDING * largest))


def _to_six_digits(result: Any) -> Any:
    from sympy import Float

    return result.xreplace({number: Float(f"{float(number):.6g}") for number in result.atoms(Float)})
