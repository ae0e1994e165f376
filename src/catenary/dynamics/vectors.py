"""Three-vectors as plain tuples: what the recursions are written in.

Nothing here but + - * and indexing, so that it runs on floats, in compiled code and on symbols alike.
"""

from typing import Any

from numpy.typing import NDArray

from catenary.kernels.compiled import inlined

Vector = tuple[Any, Any, Any]  # three numbers: floats, or symbols when a recursion is traced
Numbers = NDArray[Any]  # an array of such numbers


@inlined
def row(array: Numbers, i: int) -> Vector:
    """Return row i of an (n, 3) array."""
    return array[i, 0], array[i, 1], array[i, 2]


@inlined
def put(array: Numbers, i: int, v: Vector) -> None:
    """Write a vector into row i of an (n, 3) array."""
    array[i, 0] = v[0]
    array[i, 1] = v[1]
    array[i, 2] = v[2]


@inlined
def column(matrices: Numbers, i: int, k: int) -> Vector:
    """Return column k of matrix i of an (n, 3, 3) array."""
    return matrices[i, 0, k], matrices[i, 1, k], matrices[i, 2, k]


@inlined
def put_column(matrices: Numbers, i: int, k: int, v: Vector) -> None:
    """Write a vector into column k of matrix i of an (n, 3, 3) array."""
    matrices[i, 0, k] = v[0]
    matrices[i, 1, k] = v[1]
    matrices[i, 2, k] = v[2]


@inlined
def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def scale(factor: Any, a: Vector) -> Vector:
    """Return factor * a."""
    return factor * a[0], factor * a[1], factor * a[2]


@inlined
def dot(a: Vector, b: Vector) -> Any:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def times(matrices: Numbers, i: int, v: Vector) -> Vector:
    """Return matrices[i] @ v; with R_parent_i it takes a vector from frame i to its parent."""
    return (
        matrices[i, 0, 0] * v[0] + matrices[i, 0, 1] * v[1] + matrices[i, 0, 2] * v[2],
        matrices[i, 1, 0] * v[0] + matrices[i, 1, 1] * v[1] + matrices[i, 1, 2] * v[2],
        matrices[i, 2, 0] * v[0] + matrices[i, 2, 1] * v[1] + matrices[i, 2, 2] * v[2],
    )


@inlined
def transpose_times(matrices: Numbers, i: int, v: Vector) -> Vector:
    """Return matrices[i].T @ v; with R_parent_i it takes a vector from the parent to frame i."""
    return (
        matrices[i, 0, 0] * v[0] + matrices[i, 1, 0] * v[1] + matrices[i, 2, 0] * v[2],
        matrices[i, 0, 1] * v[0] + matrices[i, 1, 1] * v[1] + matrices[i, 2, 1] * v[2],
        matrices[i, 0, 2] * v[0] + matrices[i, 1, 2] * v[1] + matrices[i, 2, 2] * v[2],
    )
