"""What the loop asks of a controller, and what controllers share."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.plant import AT_REST, JointState
from catenary.trajectories.reference import Reference


class Controller(Protocol):
    """Joint torques from what is measured and what is wanted.

    Called once a tick, in order of time. It returns a new array each time and leaves its arguments as they are; a
    number that it cannot compute is NaN, never an exception. It raises only for a robot of another size.
    """

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return torques (n,) [Nm|N] for the next tick; q of the state is calibrated where there is a corrector."""
        ...


class SplitController(Controller, Protocol):
    """A controller that also tells the parts of its last torque: torque = feedback + feedforward.

    Both arrays are the controller's own and are overwritten by the next call of `torque`: copy what is to be kept.
    """

    @property
    def feedback(self) -> Floats:
        """What the errors asked for, (n,) [Nm|N]: the PD term."""
        ...

    @property
    def feedforward(self) -> Floats:
        """What the model asked for, (n,) [Nm|N]: gravity and inertia."""
        ...


def nominal_gravity(gravity: ArrayLike | None) -> Floats | None:
    """Return a gravity vector (3,) [m/s2] for all times, or None, which stands for the sensed one.

    Raises:
        InputError: Another shape, or not finite.
    """
    return None if gravity is None else as_array("gravity", gravity, (3,))


def gravity_and_rates(state: JointState, nominal: Floats | None) -> tuple[Floats, Floats, Floats]:
    """Return gravity [m/s2], and angular velocity and acceleration of the base, each (3,), as kernels take them.

    They are the state's own, or nominal gravity on a base at rest.
    """
    # copies: AT_REST is read-only, which kernels take too, but in five times the time
    if nominal is None:
        return state.gravity, *np.array(state.base_rates)
    return nominal, *np.array(AT_REST)
