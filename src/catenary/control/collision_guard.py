"""The end of a control loop by a collision, as the momentum observer tells it."""

import numpy as np

from catenary.control.loop import Tick
from catenary.dynamics.external_torque import MomentumObserver
from catenary.errors import InputError, LimitError
from catenary.units import TORQUE_UNIT


class CollisionGuard:
    """An observer for `run_loop`, which it ends: the robot holds. Beside it the loop's own guard looks at speeds.

    It looks at the torques that the robot reports, under the gravity of its state.

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> guard = catenary.CollisionGuard(catenary.MomentumObserver(arm, deviation=[0.3, 0.3]))
        >>> plant = catenary.MujocoPlant(arm, start=[0.3, 0.5])
        >>> plant.home()
        >>> path = catenary.go_to([0.3, 0.5], [0.6, 0.2], max_velocity=[1.0, 1.0], max_acceleration=[2.0, 2.0])
        >>> controller = catenary.GravityPD(arm, kp=[2000.0, 500.0], kd=[120.0, 13.0])
        >>> catenary.run_loop(plant, controller, path, observers=[guard]).finished
        True
    """

    def __init__(self, observer: MomentumObserver) -> None:
        """Take an observer of the robot with what it carries, which knows its deviation."""
        if not np.isfinite(observer.deviation).all():
            raise InputError("collision guard: expected an observer with a deviation, given or learnt")
        self.observer = observer
        observer.reset()

    def __call__(self, tick: Tick) -> None:
        """Look at a tick; LimitError where something touches the robot."""
        observer = self.observer
        if observer.follow(tick.state, tick.state.gravity) and (joints := observer.collided):
            k = observer.model.joint_names.index(joints[0])
            unit = TORQUE_UNIT[observer.model.joint_units[k]]
            values = observer.torque[k], observer.deviation[k], observer.sticking[k]
            torque, noise, friction = (f"{value:.3g} {unit}" for value in values)
            raise LimitError(
                f"collision at {tick.time:.3f} s, by {', '.join(joints)}: {joints[0]} is asked for {torque} from "
                f"outside, where noise is {noise}, dry friction {friction}"
            )
