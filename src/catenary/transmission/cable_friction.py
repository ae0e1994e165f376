"""Cable friction: Coulomb friction by impulses with exact stiction, and coupled springs with dry friction (play).

Springs K connect motors at x (n,) with the joints at z; the model is rate-independent. At every step z minimises

    1/2 (x - z)' K (x - z) + sum_k mu_k |a_k . (z - z_before)|

The friction elements k have directions a_k in the joints' coordinates and thresholds mu_k. Their forces s_k stay within
-mu_k and mu_k, and z = x - C A' s with the compliance C = K^-1: a joint lags by the stretch of its springs. With a
single element on one joint, z is a play operator of half-width mu C [Brokate and Sprekels 1996]; elements on several
joints, or coupled springs, let one joint drag another. Slip is computed by projected Gauss-Seidel on the elements,
whose mutual compliance is G = A C A' [the maximum dissipation principle; Moreau 1988].
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.dynamics.recursion import Numbers
from catenary.errors import InputError
from catenary.kernels.compiled import compiled, inlined


@inlined
def coulomb(velocity: float, reduction: float) -> float:
    """Return the velocity after friction, which reduces its magnitude; zero if friction stops it.

    Args:
        velocity, reduction: Velocity before, and its largest reduction.
    """
    if velocity > reduction:
        return velocity - reduction
    if velocity < -reduction:
        return velocity + reduction
    return 0.0


@inlined
def dragged(force: float, moved: float, stiffness: float, slip_force: float) -> float:
    """Return the force of a Jenkins element, a spring in series with dry friction, after a motion of its free end.

    Equals `coupled_friction` with one element on one joint.

    Args:
        moved: Motion [rad or m].
        stiffness: [Nm/rad or N/m].
        force, slip_force: Force before the motion, and force at which it slips [Nm or N].
    """
    return min(max(force + stiffness * moved, -slip_force), slip_force)


@inlined
def coulomb_coupled(inverse_inertia: Numbers, impulse: Numbers, velocity: Numbers, p: Numbers, sweeps: int) -> None:
    """Apply Coulomb friction to coupled joints, by projected Gauss-Seidel.

    Computes impulses p, |p_j| <= impulse_j, such that each entry of v - A p is zero, or has the sign of p_j at its
    bound [the maximum dissipation principle; Moreau 1988].

    Args:
        inverse_inertia: A (n, n).
        impulse: (n,) friction times the step.
        velocity: v (n,), overwritten with v - A p.
        p: (n,) initial guess, overwritten with the solution.
        sweeps: Largest number of iterations.
    """
    n = len(velocity)
    for j in range(n):
        start = min(max(p[j], -impulse[j]), impulse[j])
        p[j] = start
        for i in range(n):
            velocity[i] = velocity[i] - inverse_inertia[i, j] * start
    for _ in range(sweeps):
        settled = True
        for j in range(n):
            unclamped = p[j] + velocity[j] / inverse_inertia[j, j]
            allowed = min(max(unclamped, -impulse[j]), impulse[j])
            change = allowed - p[j]
            if change != 0.0:
                settled = False
                p[j] = allowed
                for i in range(n):
                    velocity[i] = velocity[i] - inverse_inertia[i, j] * change
        if settled:
            break


_MAX_SWEEPS = 100  # over the elements; one is enough if all stick or all slip


@inlined
def drag(
    moved: Numbers,  # (n,) motion of the motors
    parts: int,  # number of steps
    directions: Numbers,  # A (m, n)
    mutual: Numbers,  # G (m, m)
    hold: Numbers,  # (m, n) forces per motion of the motors in stiction, G^-1 A
    thresholds: Numbers,  # (m,) largest forces
    forces: Numbers,  # (m,) s, overwritten
    slip: Numbers,  # (m,) working memory
) -> None:
    """Update friction forces (m,) for a motion of the motors along a straight line."""
    m = len(forces)
    for _ in range(parts):
        for k in range(m):
            slip[k] = 0.0
            for j in range(len(moved)):
                slip[k] = slip[k] + directions[k, j] * moved[j] / parts
            for i in range(m):
                slip[k] = slip[k] + mutual[k, i] * forces[i]
        for k in range(m):  # initial guess: no slip
            for j in range(len(moved)):
                forces[k] = forces[k] + hold[k, j] * moved[j] / parts
        coulomb_coupled(mutual, thresholds, slip, forces, _MAX_SWEEPS)


@inlined
def parts_of(moved: Numbers, longest: Numbers) -> int:
    """Return the number of equal steps of a motion (n,) that are at most `longest` (n,); 0 without motion."""
    share = 0.0
    for j in range(len(moved)):
        share = max(share, abs(moved[j]) / longest[j])
    return int(min(max(share, 1.0), 1e6) + 0.999999) if share > 0.0 else 0


@compiled
def lag_of(joint: int, lever: Floats, forces: Floats) -> float:
    """Return z - x of a joint under the friction elements' forces.

    Args:
        joint, lever, forces: Index of the joint; C A' (n, m); (m,) of the elements.
    """
    lag = 0.0
    for k in range(len(forces)):
        lag -= lever[joint, k] * forces[k]
    return lag


@inlined
def drag_state(
    position: Floats,  # (n,) motors' positions
    longest: Floats,  # (n,); this and the following are those of CoupledFriction
    directions: Floats,  # (m, n)
    mutual: Floats,  # (m, m)
    hold: Floats,  # (m, n)
    thresholds: Floats,  # (S, m)
    state: Floats,  # (n + S m,) positions before, and forces of every system
    moved: Floats,  # (n,) working memory; also the following
    slip: Floats,  # (m,)
) -> None:
    """Advance a state to new motor positions (n,); a state of NaN starts there without forces.

    Args: with shapes at the signature.
    """
    n, m = len(moved), len(slip)
    if np.isnan(state[0]):
        for i in range(len(state)):
            state[i] = position[i] if i < n else 0.0
    for j in range(n):
        moved[j] = position[j] - state[j]
        state[j] = position[j]
    parts = parts_of(moved, longest)
    for c in range(len(thresholds)):
        drag(moved, parts, directions, mutual, hold, thresholds[c], state[n + c * m : n + c * m + m], slip)


@compiled
def drag_along(
    x: Floats,
    longest: Floats,
    directions: Floats,
    mutual: Floats,
    hold: Floats,
    lever: Floats,
    thresholds: Floats,
    state: Floats,
    lag: Floats,
) -> None:
    """Write z - x (N, S n), system by system, along a path x (N, n) of motors; see `drag_state`."""
    n, m = lever.shape
    moved, slip = np.zeros(n), np.zeros(m)
    for row in range(len(x)):
        drag_state(x[row], longest, directions, mutual, hold, thresholds, state, moved, slip)
        for c in range(len(thresholds)):
            for j in range(n):
                lag[row, c * n + j] = lag_of(j, lever, state[n + c * m : n + c * m + m])


class CoupledFriction(NamedTuple):
    """Springs and friction elements of n joints, in consistent units; see `coupled_friction`."""

    longest: Floats  # (n,) longest step; longer ones are split
    directions: Floats  # A (m, n)
    mutual: Floats  # G = A C A' (m, m)
    hold: Floats  # (m, n) forces per motion of the motors in stiction: G^+ A
    lever: Floats  # C A' (n, m) stretch of the springs per force
    thresholds: Floats  # (S, m) of S systems that are equal otherwise

    def lag(self, x: Floats) -> Floats:
        """Return z - x (N, S, n) along a path x (N, n) of the motors, from zero forces."""
        x = as_array("positions", x, (None, len(self.longest)))
        lag = np.empty((len(x), len(self.thresholds), x.shape[1]))
        drag_along(x, *self, np.full(x.shape[1] + self.thresholds.size, np.nan), lag.reshape(len(x), -1))
        return lag


def coupled_friction(
    compliance: ArrayLike, directions: ArrayLike, thresholds: ArrayLike, longest: ArrayLike
) -> CoupledFriction:
    """Create coupled springs and friction elements.

    Args:
        compliance: C = K^-1 (n, n), symmetric and positive definite.
        directions: A (m, n), one row per element, none zero.
        thresholds: (S, m) largest forces, 0 or more, of S systems that differ only in these.
        longest: (n,) longest step of each motor, positive; longer ones are split.
    """
    longest = as_array("longest", longest, (None,))
    n = len(longest)
    C, A = as_array("compliance", compliance, (n, n)), as_array("directions", directions, (None, n))
    thresholds = as_array("thresholds", thresholds, (None, len(A)))
    if not np.allclose(C, C.T, rtol=1e-9, atol=0.0) or np.linalg.eigvalsh(C).min() <= 0.0:
        raise InputError(f"compliance: expected a symmetric, positive definite matrix, got {C.tolist()}")
    if not A.any(axis=1).all() or not (thresholds >= 0.0).all() or not (longest > 0.0).all():
        raise InputError(
            "friction: expected directions other than zero, thresholds of zero or more and longest steps above zero, "
            f"got {A.tolist()}, {thresholds.tolist()} and {longest.tolist()}"
        )
    mutual, lever = A @ C @ A.T, np.ascontiguousarray(C @ A.T)
    return CoupledFriction(longest, A, mutual, np.ascontiguousarray(np.linalg.pinv(mutual) @ A), lever, thresholds)
