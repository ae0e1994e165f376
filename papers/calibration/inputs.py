"""The calibration paper's inputs, by name: 16 of an arm, positions and torques of its eight channels, and all 138.

Section IV-C lists what the robot state holds: operating status, encoder values and offsets, motor and joint positions
and velocities, the desired ones, tip pose and desired pose, current commands, torques, Jacobian velocity and force. Of
one arm that is 122 numbers, the time stamp among them; the paper counts 138, and does not say which the other 16 are.
Here they are the other arm's joint positions and torques, which hold a setpoint meanwhile and tell nothing. The robot's
`dt` stands in the stamp's place, which in an hour's test goes beyond all training.
"""

from catenary.raven2.topics import AXES

SIXTEEN = ("q", "tau")  # groups: all joints, tool and unused channel included

_PER_AXIS = ("encVals", "dac_val", "mpos", "mvel", "jvel", "mpos_d", "jpos_d", "encoffsets")
_MATRIX = tuple(f"{row}{column}" for row in "123" for column in "123")
ALL_138 = (
    *(f"{group}:{axis}" for group in SIXTEEN for axis in AXES),
    *(f"{name}:{axis}" for name in _PER_AXIS for axis in AXES),
    *(f"{name}:{axis}" for name in ("pos", "pos_d") for axis in "xyz"),
    *(f"{name}:{entry}" for name in ("ori", "ori_d") for entry in _MATRIX),
    *(f"{name}:{i}" for name in ("jac_vel", "jac_f") for i in range(1, 7)),
    *("runlevel", "sublevel", "last_seq", "type", "grasp_d", "dt"),
    *(f"green_{name}:{axis}" for name in ("jpos", "tau") for axis in AXES),
)
# the same with the time stamp itself
STAMP = "stamp"
STAMPED_138 = tuple(STAMP if name == "dt" else name for name in ALL_138)
