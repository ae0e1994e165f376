"""What joints wind up of cables; a cable as a spring behind a backlash, with a memory: hysteresis, creep, and wear."""

import math

from catenary.dynamics.recursion import Numbers, Vector
from catenary.kernels.compiled import inlined


@inlined
def winding_of(coupling: Numbers, q: Numbers) -> Vector:
    """Return the winding of each cable at joint positions (or velocities) q (3,)."""
    return q[0], q[1] + coupling[0] * q[0], q[2] + coupling[1] * q[0] + coupling[2] * q[1]


@inlined
def joints_of(coupling: Numbers, winding: Vector) -> Vector:
    """Return the joint positions (or velocities) at which the cables have the given winding."""
    first = winding[0]
    second = winding[1] - coupling[0] * first
    return first, second, winding[2] - coupling[1] * first - coupling[2] * second


@inlined
def joint_forces(coupling: Numbers, tension: Vector) -> Vector:
    """Return the joint torques of cable tensions [Nm or N]: the transpose of `winding_of`, so that power is kept."""
    return (
        tension[0] + coupling[0] * tension[1] + coupling[1] * tension[2],
        tension[1] + coupling[2] * tension[2],
        tension[2],
    )


@inlined
def tensions_for(coupling: Numbers, force: Numbers) -> Vector:
    """Return the cable tensions that give joint torques (3,): the inverse of `joint_forces`."""
    third = force[2]
    second = force[1] - coupling[2] * third
    return force[0] - coupling[0] * second - coupling[1] * third, second, third


LARGEST_LOSS = 0.3  # of the stiffness


@inlined
def beyond_backlash(stretch: float, width: float) -> float:
    """Return the stretch that the cable feels beyond a backlash of total width `width`; zero inside it."""
    half = 0.5 * width
    if stretch > half:
        return stretch - half
    if stretch < -half:
        return stretch + half
    return 0.0


@inlined
def tension_of(
    stretch: float,  # s, beyond the backlash [rad or m]
    rate: float,  # ds/dt
    hysteresis: float,  # z, between -1 and 1
    slow_stretch: float,  # s_v
    stiffness: float,  # K [Nm/rad or N/m]
    elastic_share: float,  # a
    hysteresis_width: float,  # w, the stretch at which the hysteretic part yields [rad or m]
    slow_share: float,  # k
    damping: float,  # D [Nm s/rad or N s/m]
) -> float:
    """Return the tension of a cable [Nm or N].

    T = a K s + (1 - a) K w z + k K (s - s_v) + D ds/dt: an elastic part, a Bouc-Wen part with state z, a
    Maxwell branch with state s_v, and a damper. The first two and the damper are the model of M. Miyasaka et
    al., "Hysteresis model of longitudinally loaded cable for cable driven robots", ICRA 2016; the Maxwell branch
    adds creep under load.
    """
    return (
        elastic_share * stiffness * stretch
        + (1.0 - elastic_share) * stiffness * hysteresis_width * hysteresis
        + slow_share * stiffness * (stretch - slow_stretch)
        + damping * rate
    )


@inlined
def bouc_wen_step(state: float, stretching: float, width: float) -> float:
    """Return the Bouc-Wen state after the stretch has grown by `stretching`.

    dz = ds / w (1 - |z| (1/2 sgn(ds z) + 1/2)): unloading follows a straight line to zero, loading nears 1
    exponentially. Both are solved exactly, so only the path counts, not the steps in which it is taken, and z stays
    between -1 and 1. state is z before, stretching ds and width w, the stretch at which it yields [rad or m].
    """
    side = 1.0 if stretching >= 0.0 else -1.0
    way = abs(stretching) / width
    along = side * state  # negative while it unloads
    if along + way <= 0.0:
        return state + side * way
    if along < 0.0:
        way += along
        along = 0.0
    return side * (along - (1.0 - along) * math.expm1(-way))


@inlined
def maxwell_step(slow_stretch: float, stretch: float, step: float, time_constant: float) -> float:
    """Return the stretch that a Maxwell branch has relaxed, `step` [s] later: ds_v/dt = (s - s_v) / time_constant."""
    return slow_stretch + (stretch - slow_stretch) * step / time_constant


@inlined
def set_rate(
    tension: float, reference: float, side: float, speed: float, slack: float, rate: float, most: float
) -> float:
    """Return the rate at which a cable's permanent set grows [rad/s or m/s].

    d(set)/dt = rate (1/2 + side T / T_ref) |dq/dt| (1 - |set| / most): by travel, more under tension, ever slower. side
    is 1 or -1, the way in which the cable is laid; slack the set so far, most the largest [rad or m].
    """
    return rate * (0.5 + side * tension / reference) * speed * (1.0 - abs(slack) / most)


@inlined
def loss_rate(tension: float, reference: float, speed: float, loss: float, rate: float) -> float:
    """Return the rate at which the lost share of stiffness grows [1/s]: by travel under tension, 0.3 at most."""
    return rate * abs(tension / reference) * speed * (1.0 - loss / LARGEST_LOSS)


SPREAD = 2147483647.0  # of random numbers 16807 x modulo 2^31 - 1 [Park and Miller 1988]; exact in doubles


@inlined
def next_draw(number: float) -> float:
    """Return the next random number, a whole one between 1 and SPREAD - 1, after one of the same kind."""
    return (16807.0 * number) % SPREAD


@inlined
def wandered(slack: float, number: float, way: float, wander: float, most: float) -> float:
    """Return a cable's permanent set after its joint has gone a way: strands seat anew, either way as likely.

    Var(d set) = wander^2 |way|, by travel whatever its speed, less as the set nears `most`. number is a random one as
    `next_draw` gives it; wander in rad or m per square root of travel.
    """
    kick = 3.4641016151377544 * (number / SPREAD - 0.5)  # of variance 1
    return slack + wander * math.sqrt(abs(way)) * kick * max(0.0, 1.0 - abs(slack) / most)
