"""Forward dynamics: accelerations by torques, the inverse of `inverse_dynamics`."""

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats
from catenary.dynamics.actuation_loads import ActuationLoads
from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics, mass_matrix, motion_rows
from catenary.errors import InputError
from catenary.robots.model import RobotModel

_MASSLESS_CONDITION = 1e13  # condition of a mass matrix from which on some motion moves no mass
_LOAD_ROUNDS = 200  # in which friction that grows with the load must settle
_SETTLED_SHARE = 1e-12  # of the torque


def forward_dynamics(
    model: RobotModel,
    q: ArrayLike,
    qd: ArrayLike,
    tau: ArrayLike,
    gravity: ArrayLike,
    base: BaseMotion | None = None,
    *,
    loads: ActuationLoads | None = None,
) -> Floats:
    """Return the accelerations that torques give a robot at q, qd.

    M(q) qdd = tau - C(q, qd) qd - g(q). With `loads`, such as `known_loads(model)`, friction, rotors, springs and known
    torques take part as in `inverse_dynamics`: friction as in sliding, and none at rest where it has the sign of the
    speed, so that no joint sticks. Friction that grows with the load depends on the accelerations, and is found by
    iteration.

    For q, qd and tau (n,) or (N, n) [rad or m, and per s; Nm or N], gravity and base as of `inverse_dynamics`: (n,) or
    (N, n) [rad/s2 or m/s2].

    Raises:
        MissingInertiaError: Links without inertia.
        InputError: A motion that moves no mass; friction that takes more than the load that it grows with.
    """
    (rows, rates, torques), single = motion_rows(model, q, qd=qd, tau=tau)
    still = np.zeros_like(rows)
    M: Floats = mass_matrix(model, rows)
    moving: Floats = torques
    if loads is not None:
        M = M + loads.rotors
        for _ in range(
            _LOAD_ROUNDS if loads.depends_on_load else 1
        ):  # of links and rotors, which friction may grow with
            before, moving = moving, np.asarray(torques - loads.torque(rows, rates, still, moving))
            if np.abs(moving - before).max(initial=0.0) <= _SETTLED_SHARE * max(1.0, np.abs(torques).max(initial=0.0)):
                break
        else:
            if loads.depends_on_load:
                raise InputError(f'robot "{model.name}": friction takes more than the load that it grows with')
    free = moving - inverse_dynamics(model, rows, rates, still, gravity, base)
    if not (np.linalg.cond(M) < _MASSLESS_CONDITION).all():
        raise InputError(
            f'robot "{model.name}": its joints can move so that no mass moves: accelerations have no bound'
        )
    out = np.asarray(np.linalg.solve(M, free[:, :, None])[:, :, 0], dtype=np.float64)
    return out[0] if single else out
