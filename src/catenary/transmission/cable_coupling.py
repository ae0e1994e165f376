"""How three positioning joints share their cables: the insertion's runs over the shoulder's and elbow's pulleys.

winding_j = m_j / ratio_j is what a motor winds up, in units of its joint:
    winding_0 = q_0
    winding_1 = q_1 + c01 q_0
    winding_2 = q_2 + c02 q_0 + c12 q_1
with `coupling` = (c01 [rad/rad], c02 [m/rad], c12 [m/rad]). [RAVEN-II source, fwd_cable_coupling]
"""

from catenary.dynamics.vectors import Numbers, Vector
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
