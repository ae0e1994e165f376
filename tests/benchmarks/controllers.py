"""What each controller's torque costs in a tick, beside the PD alone."""

from functools import partial

import numpy as np

from catenary.control.controller import Controller
from catenary.control.elastic import ElasticPD
from catenary.control.gravity_pd import GravityHold, GravityPD
from catenary.control.inertia_pd import InertiaPD
from catenary.control.pd import JointPD
from catenary.plant import JointState
from catenary.robots.catalog import load_robot
from catenary.trajectories.reference import Reference
from tests.benchmarks.measure import side_by_side, tell

KP, KD, SPRINGS = [454.0, 362.0, 57e3], [12.0, 9.6, 4564.0], [264.0, 507.0, 71e3]


def main() -> None:
    """Time every controller of the RAVEN-II, on a base at rest and on one that turns."""
    arm = load_robot("raven2")
    controllers: dict[str, Controller] = {
        "pd": JointPD(KP, KD),
        "hold": GravityHold(arm),
        "pd and gravity": GravityPD(arm, KP, KD),
        "inertia": InertiaPD(arm, 900.0, 42.0),
        "elastic, biased": ElasticPD(arm, KP, KD, SPRINGS),
    }
    q, rest = np.array([0.5, 1.5, 0.4]), np.zeros(3)
    reference = Reference(q + 0.01, rest, rest)
    still = JointState(0.0, q, rest, rest, np.zeros(0), np.array([0.0, 0.0, -9.81]), 0.0, np.zeros((2, 3)))
    turning = still._replace(base_rates=np.full((2, 3), 0.1))
    tell(
        {
            f"torque on a base {base}, us": side_by_side(
                {name: partial(one.torque, state, reference) for name, one in controllers.items()}
            )
            for base, state in (("at rest", still), ("turning", turning))
        }
    )


if __name__ == "__main__":
    main()
