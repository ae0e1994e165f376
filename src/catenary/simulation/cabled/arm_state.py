"""What changes while an arm behind cables moves."""

from catenary.simulation.records import PerAxis, PerJoint, Record


class ArmState(Record):
    """What changes while an arm moves. Positioning joints come first among the seven rotors."""

    rotor: PerAxis  # motor shafts [rad]
    rotor_velocity: PerAxis  # [rad/s]
    q: PerJoint  # where the joints really are [rad, rad, m]
    qd: PerJoint  # [rad/s, rad/s, m/s]
    hysteresis: PerJoint  # Bouc-Wen states, -1 to 1
    slow_stretch: PerJoint  # Maxwell branches [rad, rad, m]
    slack: PerJoint  # permanent set of the cables [rad, rad, m]
    loss: PerJoint  # share of the stiffness that is lost
    tension: PerJoint  # of the last step [Nm, Nm, N]
    friction: PerJoint  # impulses of the last step, where the next one's search starts
