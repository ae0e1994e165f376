"""Writes lines of operations as JAX functions: derivatives, batches (`jax.vmap`) and GPUs.

XLA compiles a straight line in a time that grows faster than its length: 0.1 s for the gravity of 3 joints, some 10 s
for thousands of operations. A longer line becomes a loop over rows of operations that do not need each other, which
compiles in half a second whatever its length, and takes some ten times as long on batches.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from catenary.errors import InputError, MissingPackageError, NotReadyError
from catenary.kernels.jax_loop import looped
from catenary.kernels.line_text import widths_of
from catenary.kernels.tracing import Line, evaluate

LONGEST = 2_500  # operations and results: XLA compiles them in some 10 s
JaxFunction = Callable[..., Any]


def jax_function(line: Line, shape: tuple[int, ...]) -> JaxFunction:
    """Return a jitted function of float64 arrays in the order of the line's inputs, which are its names too.

    Args:
        line: The operations.
        shape: Of the result.

    Raises:
        MissingPackageError: JAX is not installed.
        NotReadyError: JAX computes in float32.
    """
    try:
        import jax
        import jax.numpy as jnp
    except ImportError as error:
        raise MissingPackageError('JAX functions need jax: pip install "catenary[jax]"') from error
    if not jax.config.jax_enable_x64:
        raise NotReadyError(
            "JAX computes in float32, in which torques are wrong in the sixth digit: switch float64 on before "
            'any array is made, jax.config.update("jax_enable_x64", True)'
        )
    widths = widths_of(line)
    straight = line.operations + len(line.results) <= LONGEST
    compute = _straight(line) if straight else looped(line)
    steps = sorted({r[1] for r in line.results if not isinstance(r, float)})
    place = {step: k for k, step in enumerate(steps)}
    constant = np.array([r if isinstance(r, float) else 0.0 for r in line.results])
    sign = np.array([0.0 if isinstance(r, float) else float(r[0]) for r in line.results])
    source = np.array([0 if isinstance(r, float) else place[r[1]] for r in line.results], dtype=int)

    def function(*given: Any, **named: Any) -> Any:
        named.update(zip(widths, given, strict=False))
        if len(given) > len(widths) or set(named) != set(widths):
            raise InputError(f"expected {', '.join(widths)}, got {len(given)} arrays and {', '.join(named)}")
        arrays = {name: jnp.asarray(named[name], dtype=jnp.float64) for name in widths}
        for name, array in arrays.items():
            if array.shape != (widths[name],):
                raise InputError(
                    f"{name}: expected shape ({widths[name]},), got {array.shape}; jax.vmap takes batches"
                )
        return (
            (constant + sign * compute(arrays, steps)[source]).reshape(shape)
            if steps
            else constant.reshape(shape)
        )

    return jax.jit(function)  # type: ignore[no-any-return]


def _straight(line: Line) -> Callable[[dict[str, Any], list[int]], Any]:
    """Return what computes the wanted steps one operation after the other."""
    import jax.numpy as jnp

    def compute(arrays: dict[str, Any], steps: list[int]) -> Any:
        wanted = line._replace(results=tuple((1, step) for step in steps))
        return jnp.stack(evaluate(wanted, sine=jnp.sin, cosine=jnp.cos, **arrays))

    return compute
