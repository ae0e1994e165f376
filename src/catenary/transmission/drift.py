"""What hours of motion do to a cable: it sets, and it loses stiffness."""

from catenary.kernels.compiled import inlined

LARGEST_LOSS = 0.3  # of the stiffness


@inlined
def set_rate(
    tension: float, reference: float, side: float, speed: float, slack: float, rate: float, most: float
) -> float:
    """Return the rate at which a cable's permanent set grows [rad/s or m/s].

    d(set)/dt = rate (1/2 + side T / T_ref) |dq/dt| (1 - |set| / most): by travel, more under tension, ever
    slower.

    Args:
        tension: T [Nm or N].
        reference: T_ref.
        side: 1 or -1, the way in which the cable is laid.
        speed: |dq/dt| [rad/s or m/s].
        slack: The set so far [rad or m].
        rate: Set per rad or m of travel.
        most: The largest set [rad or m].
    """
    return rate * (0.5 + side * tension / reference) * speed * (1.0 - abs(slack) / most)


@inlined
def loss_rate(tension: float, reference: float, speed: float, loss: float, rate: float) -> float:
    """Return the rate at which the lost share of stiffness grows [1/s]: by travel under tension, 0.3 at most."""
    return rate * abs(tension / reference) * speed * (1.0 - loss / LARGEST_LOSS)
