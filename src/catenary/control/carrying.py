"""Any controller, with the torque of a load that is taken up and put down while it runs."""

from catenary.arrays import Floats
from catenary.control.controller import Controller
from catenary.errors import InputError
from catenary.gravity.payload import CarriedLoad
from catenary.plant import JointState
from catenary.trajectories.reference import Reference


class Carrying:
    """Adds the torque that holds a load against gravity to the torque of a controller.

    Gravity is that of the state, also for a controller that compensates a nominal vector.
    While nothing is carried the torques are the controller's own, to the bit. A load that comes or goes is a step of
    torque; `TorqueLimits` bounds its slope.
    """

    def __init__(self, controller: Controller, load: CarriedLoad) -> None:
        """Take the controller and the load, which may be attached and detached between ticks."""
        self.controller, self.load = controller, load

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return torques (n,) [Nm|N]; NaN where the controller's are, or a position or gravity that a load needs.

        Raises:
            InputError: The robot has another number of joints.
        """
        tau = self.controller.torque(state, reference)
        if len(tau) != self.load.model.n:
            raise InputError(f"load: is for {self.load.model.n} joints, the robot has {len(tau)}")
        self.load.add(state.q, state.gravity, state.base_rates, tau)
        return tau
