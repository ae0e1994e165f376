"""Controllers' torques on a base at rest as one compiled call each, around the robot's own kernels.

On a base that turns there is no kernel: there, and for arrays of another layout or size, the controllers run their
recursions.
"""

from collections.abc import Callable
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

from catenary.arrays import Floats
from catenary.control import pd
from catenary.dynamics.kernels import gravity_module, inverse_dynamics_module
from catenary.kernels.exact_calls import Exact
from catenary.kernels.numba_files import load_source, seal
from catenary.robots.model import RobotModel

HEAD = '''\
"""A controller's torque on a base at rest."""
# of {digest}


@exact(*kinds, result=bool)
def torque({names}):
    if others(({names})):
        return False
    {names} = as_arrays(({names}))
    for r in range(3):
        # a NaN is not zero either
        if rates[0, r] != 0.0 or rates[1, r] != 0.0:
            return False
'''
HOLD = """\
    hold(q, gravity, feedforward)
    for j in range(len(q)):
        tau[j] = feedforward[j]
    return True
"""
GRAVITY_PD = """\
    hold({at}, gravity, feedforward)
    for j in range(len(q)):
        feedback[j] = pd_term(gains, j, q[j], qd[j], q_ref[j], qd_ref[j])
        tau[j] = feedback[j] + feedforward[j]
    return True
"""
ELASTIC_PD = """\
    wanted, at = work[0], work[1]
    hold(q_ref, gravity, wanted)
    for j in range(len(q)):
        wind_up = wanted[j] / stiffness[j]
        feedback[j] = pd_term(gains, j, q[j], qd[j], q_ref[j] + wind_up, qd_ref[j])
        at[j] = q[j] - wind_up if {biased} else q[j]
        feedforward[j] = wanted[j]
    if {online}:
        hold(at, gravity, feedforward)
    for j in range(len(q)):
        tau[j] = feedback[j] + feedforward[j]
    return True
"""
INERTIA_PD = """\
    still, correction = work[0], work[1]
    for j in range(len(q)):
        still[j] = 0.0
        correction[j] = pd_term(gains, j, q[j], qd[j], q_ref[j], qd_ref[j])
    move(q, {qd}, qdd_ref, gravity, feedforward)
    # M(q) times an acceleration is what it takes from rest where nothing pulls
    move(q, still, correction, nothing, feedback)
    for j in range(len(q)):
        for k in range(len(q)):
            feedback[j] += motor_inertia[j, k] * correction[k]
            feedforward[j] += motor_inertia[j, k] * qdd_ref[k]
        tau[j] = feedback[j] + feedforward[j]
    return True
"""


def torque_at_rest(model: RobotModel, text: str, **arrays: Floats) -> Callable[..., bool]:
    """Compile `torque(q, qd, q_ref, qd_ref, gravity, rates, tau)`, which says whether it has written the torques.

    Where the text mentions it, `qdd_ref` comes before `gravity`.

    Args:
        model: The robot.
        text: What it does, one of the above.
        arrays: The controller's own, by the names that the text has for them.

    Raises:
        MissingInertiaError: Links without inertia.
    """
    n = model.n
    moving = ("q", "qd", "q_ref", "qd_ref", *(["qdd_ref"] if "qdd_ref" in text else []))
    shapes = {name: array.shape for name, array in arrays.items()} | dict.fromkeys(moving, (n,))
    shapes |= {"gravity": (3,), "rates": (2, 3), "tau": (n,)}
    written = ("feedback", "feedforward", "work", "tau")
    given: dict[str, Any] = {
        "kinds": [Exact("float64", shape, writable=name in written) for name, shape in shapes.items()],
        "pd_term": pd.pd_term,
    }
    called, of = ("move", inverse_dynamics_module) if "move(" in text else ("hold", gravity_module)
    kernel = of(model)
    given[called] = kernel.into
    of_what = f"{kernel.__name__} {shapes}".encode() + Path(str(pd.__file__)).read_bytes()
    source = HEAD.format(digest=sha256(of_what).hexdigest()[:32], names=", ".join(shapes)) + text
    module = load_source("controller", source, given)
    seal(module)
    return partial(module.torque, *arrays.values())
