"""Ticks of the MuJoCo plant through the protocol: measure, command torques, wait."""

import numpy as np

from catenary import FixedBase, MujocoPlant, gravity_torque, load_robot, mass_matrix
from catenary.simulation.base_motion import RockingBase
from catenary.simulation.joint_hardware import JointHardware
from tests.benchmarks.measure import Call, Tables, report, side_by_side

BASES = {"still base": FixedBase(), "rocking base": RockingBase(mean=0.1, amplitude=0.2, frequency=0.5)}
DRIVES = {
    "ideal": JointHardware(),
    "friction": JointHardware(friction=0.5, damping=0.05),
    "elastic": JointHardware(armature=0.3, stiffness=2e3, spring_damping=2.0),
}


def tick_of(robot: str, base: str, drives: str) -> Call:
    """Return one tick of a robot that holds its pose by gravity compensation and PD."""
    model = load_robot(robot)
    plant = MujocoPlant(model, base=BASES[base], hardware=DRIVES[drives])
    plant.home()
    start = plant.measured_js()
    wanted, hold = start.q, gravity_torque(model, start.q, start.gravity)
    inertia = np.diag(mass_matrix(model, wanted))

    def tick() -> None:
        state = plant.measured_js()
        plant.servo_jf(hold + inertia * (400.0 * (wanted - state.q) - 40.0 * state.qd))
        plant.wait()
        if plant.operating_state().state != "ENABLED":
            raise RuntimeError("the robot left its motion")

    return tick


def tables() -> Tables:
    """Return microseconds of CPU time for a tick of 1 ms, and ticks in a second."""
    pairs = [("still base", "ideal"), ("rocking base", "ideal"), ("still base", "friction"), ("still base", "elastic")]
    cases = [(robot, *pair) for robot in ("two_link", "dual_arm_19") for pair in pairs]
    table = side_by_side({", ".join(case): tick_of(*case) for case in cases}, calls=1000)
    for row in table.values():
        row["ticks_per_second"] = float(np.round(1e6 / row["cpu_us"]))
    return {"MuJoCo plant, a tick of 1 ms through the protocol": table}


if __name__ == "__main__":
    report(tables, __doc__)
