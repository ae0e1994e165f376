"""Writes lines of operations as CasADi functions, for optimisation and model predictive control."""

from typing import Any

from catenary.errors import MissingPackageError
from catenary.kernels.line_text import widths_of
from catenary.kernels.tracing import Line, evaluate


def casadi_function(name: str, line: Line, shape: tuple[int, ...], result: str) -> Any:
    """Return a `casadi.Function` of scalar operations (SX), differentiable and ready for its code generator.

    Args:
        name: Of the function: letters, digits and underscores.
        line: The operations.
        shape: Of the result, (m,) or (m, k).
        result: Name of the output; inputs have the names of the line's arrays.
    """
    try:
        import casadi
    except ImportError as error:
        raise MissingPackageError('CasADi functions need casadi: pip install "catenary[casadi]"') from error
    inputs = {array: casadi.SX.sym(array, width) for array, width in widths_of(line).items()}
    values = evaluate(
        line,
        sine=casadi.sin,
        cosine=casadi.cos,
        **{array: casadi.vertsplit(column) for array, column in inputs.items()},
    )
    column = casadi.vertcat(*values)
    if len(shape) == 2:  # CasADi counts down the columns, a line along the rows
        column = casadi.reshape(column, shape[1], shape[0]).T
    return casadi.Function(name, list(inputs.values()), [column], list(inputs), [result])
