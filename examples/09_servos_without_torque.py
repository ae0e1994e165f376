"""An arm of two Dynamixel servos that floats: gravity torque as current, over the protocol of dynamixel-sdk.

A real one has its port as argument (/dev/ttyUSB0), mode and limits set before; without, a bus with the same methods
moves a simulated arm, whose servos are 4 % weaker than said. Prints how far it falls, and what its second joint holds.
"""

import sys

import numpy as np

import catenary

CURRENT_A, POSITION_RAD, VELOCITY_RAD_S = 2.69e-3, 2.0 * np.pi / 4096, 0.229 * 2.0 * np.pi / 60.0  # per count, XM430
GOAL_CURRENT, PRESENT_VELOCITY, PRESENT_POSITION = 102, 128, 132  # control table of protocol 2.0
arm, start, down = catenary.load_robot("two_link"), np.array([0.3, 0.5]), np.array([0.0, 0.0, -9.81])


class SimulatedBus:
    """What dynamixel_sdk.PacketHandler is, on a simulated arm; a tick of 1 ms passes once all are told."""

    def __init__(self, gain: float) -> None:
        self.gain, self.currents, self.plant = gain, np.zeros(arm.n), catenary.MujocoPlant(arm, start=start)
        self.plant.state_command("enable")

    def read4ByteTxRx(self, port, servo: int, address: int) -> tuple[int, int, int]:
        state = self.plant.measured_js()
        value = state.q / POSITION_RAD if address == PRESENT_POSITION else state.qd / VELOCITY_RAD_S
        return int(np.rint(value[servo])) % 2**32, 0, 0

    def write2ByteTxRx(self, port, servo: int, address: int, count: int) -> tuple[int, int]:
        self.currents[servo] = (count - 65536 if count > 32767 else count) * CURRENT_A  # two's complement
        self.plant.servo_jf(self.gain * self.currents)
        self.plant.wait() if servo == arm.n - 1 else None
        return 0, 0


def fall(bus, port, share: float):  # how far the arm moves in 300 ticks, and the last command
    servos = [catenary.Servo("current", gain=8.0, error=0.05, step=CURRENT_A, limit=4.0)] * arm.n
    for _ in range(300):
        told = [[bus.read4ByteTxRx(port, k, a) for k in range(arm.n)] for a in (PRESENT_POSITION, PRESENT_VELOCITY)]
        if np.any(np.array(told)[:, :, 1:]):  # results and errors of the bus
            raise OSError(f"servos answer {told}")
        q, qd = np.array(told)[:, :, 0].astype(np.uint32).view(np.int32) * [[POSITION_RAD], [VELOCITY_RAD_S]]
        command = catenary.servo_command(servos, share * catenary.gravity_torque(arm, q, down), q, qd)
        for k, count in enumerate(command.counts.tolist()):
            bus.write2ByteTxRx(port, k, GOAL_CURRENT, count % 65536)
    return q - start, command


if len(sys.argv) > 1 and sys.argv[1].startswith("/dev/"):
    import dynamixel_sdk

    (port := dynamixel_sdk.PortHandler(sys.argv[1])).openPort()
    fall(dynamixel_sdk.PacketHandler(2.0), port, 1.0)
else:
    for share in (0.0, 1.0):
        moved, command = fall(SimulatedBus(0.96 * 8.0), None, share)
        holds = f"{command.torque[1]:.2f} +- {command.half_width[1]:.2f} Nm"
        print(f"gravity times {share:g}: moved by {np.rad2deg(moved).round(1)} deg; joint 2 holds {holds}")
