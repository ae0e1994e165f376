"""The cable's friction: Coulomb friction by impulses; what would move less than it allows stands still, exactly."""

from catenary.dynamics.vectors import Numbers
from catenary.kernels.compiled import inlined


@inlined
def coulomb(velocity: float, most: float) -> float:
    """Return the velocity after friction that can change it by at most `most` has acted; zero if it can stop it."""
    if velocity > most:
        return velocity - most
    if velocity < -most:
        return velocity + most
    return 0.0


@inlined
def dragged(force: float, moved: float, stiffness: float, most: float) -> float:
    """Return the force [Nm or N] on a spring that ends in dry friction, after its other end has moved [rad or m].

    A Jenkins element: it sticks and winds up, and slips at `most`. That is one element of `coupled_friction` on one
    joint, whose play operator it drives.
    """
    return min(max(force + stiffness * moved, -most), most)


@inlined
def coulomb_coupled(inverse_inertia: Numbers, impulse: Numbers, velocity: Numbers, given: Numbers, sweeps: int) -> None:
    """Let friction act on coupled joints, by projected Gauss-Seidel on the inverse inertia.

    Finds impulses p_j, |p_j| <= impulse_j, so that velocity - A p is zero where |p_j| is below its bound and opposed to
    p_j where it is at it. [the maximum dissipation principle; Moreau 1988] inverse_inertia is A (n, n), impulse (n,)
    the largest impulses, friction times the step; velocity (n,) is overwritten with that after, given (n,) with p: what
    stands there is where the search starts.
    """
    n = len(velocity)
    for j in range(n):
        start = min(max(given[j], -impulse[j]), impulse[j])
        given[j] = start
        for i in range(n):
            velocity[i] = velocity[i] - inverse_inertia[i, j] * start
    for _ in range(sweeps):
        settled = True
        for j in range(n):
            wanted = given[j] + velocity[j] / inverse_inertia[j, j]
            allowed = min(max(wanted, -impulse[j]), impulse[j])
            change = allowed - given[j]
            if change != 0.0:
                settled = False
                given[j] = allowed
                for i in range(n):
                    velocity[i] = velocity[i] - inverse_inertia[i, j] * change
        if settled:
            break
