"""Lines of operations as functions of JAX (derivatives, batches, GPUs) and CasADi (MPC), and SymPy's expressions.

XLA compiles a straight line in a time that grows faster than its length: 0.1 s for the gravity of 3 joints, some 10 s
for thousands of operations.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from catenary.errors import InputError, NotReadyError, imported
from catenary.kernels.tracing import FUNCTIONS, Line, evaluate_line, widths_of
from catenary.tables import OnScreen, Screen

JaxFunction = Callable[..., Any]
_READABLE_OPERATIONS = 60  # operations up to which expressions are multiplied out: a RAVEN's three joints
_ROUNDING_RATIO = 1e-12  # of a coefficient, beside the largest one
_VECTOR_INPUTS = ("gravity", "omega", "alpha")  # whose parts are x, y, z


def casadi_function(name: str, line: Line, shape: tuple[int, ...], result: str) -> Any:
    """Return a line as a `casadi.Function` (SX).

    Args:
        line: Straight-line program, whose inputs are the function's.
        shape: Shape of the output, (m,) or (m, k).
        result: Name of the output.
    """
    casadi = imported("casadi", "CasADi functions need casadi", "casadi")
    inputs = {array: casadi.SX.sym(array, width) for array, width in widths_of(line).items()}
    values = evaluate_line(
        line,
        sine=casadi.sin,
        cosine=casadi.cos,
        functions=_functions(casadi, abs="fabs"),
        **{array: casadi.vertsplit(column) for array, column in inputs.items()},
    )
    column = casadi.vertcat(*values)
    if len(shape) == 2:  # CasADi counts down the columns, a line along the rows
        column = casadi.reshape(column, shape[1], shape[0]).T
    return casadi.Function(name, list(inputs.values()), [column], list(inputs), [result])


def jax_function(line: Line, shape: tuple[int, ...]) -> JaxFunction:
    """Return a line as a jitted JAX function of its inputs, float64 arrays; NotReadyError if JAX uses float32.

    Args:
        line, shape: Straight-line program, and shape of the result.
    """
    jax = imported("jax", "JAX functions need jax", "jax")
    jnp = jax.numpy
    if not jax.config.jax_enable_x64:
        raise NotReadyError(
            "JAX computes in float32, in which torques are wrong in the sixth digit: switch float64 on before "
            'any array is made, jax.config.update("jax_enable_x64", True)'
        )
    widths = widths_of(line)
    steps = sorted({r[1] for r in line.results if not isinstance(r, float)})
    place = {step: k for k, step in enumerate(steps)}
    needed = line._replace(results=tuple((1, step) for step in steps))
    constant = np.array([r if isinstance(r, float) else 0.0 for r in line.results])
    sign = np.array([0.0 if isinstance(r, float) else float(r[0]) for r in line.results])
    source = np.array([0 if isinstance(r, float) else place[r[1]] for r in line.results], dtype=int)

    def function(*positional: Any, **named: Any) -> Any:
        named.update(zip(widths, positional, strict=False))
        if len(positional) > len(widths) or set(named) != set(widths):
            raise InputError(f"expected {', '.join(widths)}, got {len(positional)} arrays and {', '.join(named)}")
        arrays = {name: jnp.asarray(named[name], dtype=jnp.float64) for name in widths}
        for name, array in arrays.items():
            if array.shape != (widths[name],):
                raise InputError(f"{name}: expected shape ({widths[name]},), got {array.shape}; jax.vmap takes batches")
        if not steps:
            return constant.reshape(shape)
        values = jnp.stack(evaluate_line(needed, sine=jnp.sin, cosine=jnp.cos, functions=_functions(jnp), **arrays))
        return (constant + sign * values[source]).reshape(shape)

    return jax.jit(function)


def _functions(package: Any, **names: str) -> dict[str, Callable[[Any], Any]]:
    own = {name: getattr(package, names.get(name, name)) for name in FUNCTIONS if name != "inverse"}
    return own | {"inverse": lambda x: 1.0 / x}


@dataclass(frozen=True, repr=False)
class SymbolicFunction(OnScreen):
    """Expressions in symbols: q1, q2, ... are the coordinates, gravity_x, omega_y, ... parts of vectors."""

    inputs: dict[str, tuple[Any, ...]]  # SymPy symbols of each input array
    result: Any  # sympy.Matrix; a vector is a column

    @property
    def screen(self) -> Screen:
        """The expressions."""
        from sympy import latex

        return Screen(f"of {', '.join(self.inputs)}: {self.result.shape}", formula=lambda: str(latex(self.result)))

    def __str__(self) -> str:
        from sympy import Float

        digits = {number: Float(f"{float(number):.6g}") for number in self.result.atoms(Float)}
        rows = self.result.xreplace(digits).tolist()
        return "\n".join(str(row[0]) if len(row) == 1 else f"[{', '.join(map(str, row))}]" for row in rows)


def sympy_function(line: Line, shape: tuple[int, ...]) -> SymbolicFunction:
    """Return a line's results as SymPy expressions.

    Lines of up to 60 operations are multiplied out, with sines and cosines of sums of angles; longer ones stay nested,
    for `sympy.cse`, `sympy.lambdify` and derivatives.

    Args:
        line, shape: Straight-line program, and shape of the result.
    """
    sympy = imported("sympy", "SymPy expressions need sympy", "symbolic")
    inputs = {
        array: tuple(
            sympy.Symbol(f"{array}_{'xyz'[i]}" if array in _VECTOR_INPUTS else f"{array}{i + 1}", real=True)
            for i in range(width)
        )
        for array, width in widths_of(line).items()
    }
    entries = evaluate_line(line, sine=sympy.sin, cosine=sympy.cos, functions=_functions(sympy, abs="Abs"), **inputs)
    if line.operations <= _READABLE_OPERATIONS and not any(step.kind in FUNCTIONS for step in line.steps):
        entries = [_multiplied_out(sympy.sympify(entry)) for entry in entries]
    return SymbolicFunction(inputs, sympy.Matrix(shape[0], shape[1] if len(shape) == 2 else 1, entries))


def _multiplied_out(entry: Any) -> Any:
    """Return a sum of products in which each term has at most one sine or cosine, without what rounding left."""
    import sympy
    from sympy.simplify.fu import TR8

    terms = sympy.expand(TR8(sympy.expand(entry))).as_coefficients_dict()
    largest = max((abs(float(value)) for value in terms.values()), default=0.0)
    return sympy.Add(*(v * term for term, v in terms.items() if abs(float(v)) > _ROUNDING_RATIO * largest))
