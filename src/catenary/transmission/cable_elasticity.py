"""Cable coupling of joints, and a cable as a spring with backlash, hysteresis, creep, permanent set and wear."""

import math

from catenary.dynamics.recursion import Numbers, Vector
from catenary.kernels.compiled import inlined


@inlined
def winding_of(coupling: Numbers, q: Numbers) -> Vector:
    """Return the winding (q0, q1 + c01 q0, q2 + c02 q0 + c12 q1) at joint positions, or its rate at joint velocities.

    Args:
        coupling, q: c01, c02, c12 [rad/rad, m/rad, m/rad]; (3,) joint positions [rad, rad, m] or velocities.
    """
    return q[0], q[1] + coupling[0] * q[0], q[2] + coupling[1] * q[0] + coupling[2] * q[1]


@inlined
def joints_of(coupling: Numbers, winding: Vector) -> Vector:
    """Return the joint positions (or velocities) of a winding: the inverse of `winding_of`.

    Args:
        coupling, winding: Coefficients c01, c02, c12, and cable positions at the joints (3,).
    """
    first = winding[0]
    second = winding[1] - coupling[0] * first
    return first, second, winding[2] - coupling[1] * first - coupling[2] * second


@inlined
def joint_forces(coupling: Numbers, tension: Vector) -> Vector:
    """Return the joint torques (3,) of cable tensions: the transpose of `winding_of`, which conserves power.

    Args:
        coupling, tension: c01, c02, c12; (3,) in joint units [Nm, Nm, N].
    """
    return (
        tension[0] + coupling[0] * tension[1] + coupling[1] * tension[2],
        tension[1] + coupling[2] * tension[2],
        tension[2],
    )


@inlined
def tensions_for(coupling: Numbers, force: Numbers) -> Vector:
    """Return the cable tensions of joint torques: the inverse of `joint_forces`.

    Args:
        coupling, force: Coefficients c01, c02, c12, and joint torques (3,) [Nm, Nm, N].
    """
    third = force[2]
    second = force[1] - coupling[2] * third
    return force[0] - coupling[0] * second - coupling[1] * third, second, third


MAX_LOSS = 0.3  # relative loss of stiffness


@inlined
def beyond_backlash(stretch: float, width: float) -> float:
    """Return the stretch beyond a backlash; zero inside it.

    Args:
        stretch, width: Stretch [rad or m], and total width of the backlash, same unit.
    """
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

    Args: with symbols and units at the signature.
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
    exponentially. Both are solved exactly: the result depends on the path, not on the steps, and |z| <= 1.

    Args:
        state: z before, -1 to 1.
        stretching: ds [rad or m].
        width: w, the stretch at yield [rad or m].
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
    """Return the relaxed stretch of a Maxwell branch after a step: ds_v/dt = (s - s_v) / time_constant.

    Args:
        slow_stretch, stretch: s_v before, and s [rad or m].
        step, time_constant: Duration, and time constant [s].
    """
    return slow_stretch + (stretch - slow_stretch) * step / time_constant


@inlined
def set_rate(
    tension: float, reference: float, side: float, speed: float, slack: float, rate: float, max_set: float
) -> float:
    """Return the growth rate of a cable's permanent set [rad/s or m/s].

    d(set)/dt = rate (1/2 + side T / T_ref) |dq/dt| (1 - |set| / max_set): travel, faster under tension, saturating.

    Args:
        tension, reference: T and T_ref [Nm or N].
        side: 1 or -1, direction in which the cable is laid.
        speed: |dq/dt| of the joint.
        slack, max_set: Set so far, and largest set [rad or m].
        rate: Set per travel, initially.
    """
    return rate * (0.5 + side * tension / reference) * speed * (1.0 - abs(slack) / max_set)


@inlined
def loss_rate(tension: float, reference: float, speed: float, loss: float, rate: float) -> float:
    """Return the growth rate of the relative loss of stiffness [1/s]: with travel under tension, up to `MAX_LOSS`.

    Args:
        tension: [Nm or N].
        reference: Tension at which the loss grows by `rate` per travel [Nm or N].
        speed: Of the joint.
        loss: So far, 0 to MAX_LOSS.
        rate: Loss per travel [1/rad or 1/m].
    """
    return rate * abs(tension / reference) * speed * (1.0 - loss / MAX_LOSS)


RANDOM_MODULUS = 2147483647.0  # of random numbers 16807 x modulo 2^31 - 1 [Park and Miller 1988]; exact in doubles


@inlined
def next_draw(number: float) -> float:
    """Return the next pseudo-random number after `number`, both integers from 1 to RANDOM_MODULUS - 1."""
    return (16807.0 * number) % RANDOM_MODULUS


@inlined
def wander_step(slack: float, number: float, way: float, wander: float, max_set: float) -> float:
    """Return a cable's permanent set after a random-walk step by travel, as strands settle.

    Var(d set) = wander^2 |way|, independent of speed, less as the set nears `max_set`.

    Args:
        number: Random number from `next_draw`.
        way: Travel of the joint [rad or m].
        wander: [rad or m per square root of travel].
        slack, max_set: Set so far, and largest set [rad or m].
    """
    kick = 3.4641016151377544 * (number / RANDOM_MODULUS - 0.5)  # of variance 1
    return slack + wander * math.sqrt(abs(way)) * kick * max(0.0, 1.0 - abs(slack) / max_set)
