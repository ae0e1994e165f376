"""What a controller is to the loop."""

from typing import Protocol

from catenary.arrays import Floats
from catenary.plant import JointState
from catenary.trajectories.reference import Reference


class Controller(Protocol):
    """Joint torques from what is measured and what is wanted.

    Called once a tick, in order of time. It gives an array of its own each time and leaves its arguments as they
    are; a number that it cannot compute is NaN, never an exception. It raises only for a robot of another size.
    """

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Torques (n,) [Nm|N] for the next tick; q of the state is calibrated where a corrector is there."""
        ...


class SplitController(Controller, Protocol):
    """A controller that also says what its last torque was made of: torque = feedback + feedforward.

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
