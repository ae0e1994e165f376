"""An ideal RAVEN-II arm with external encoders that disagree with it by a known, linear error."""

from collections.abc import Mapping

import numpy as np

from catenary.plant import Column
from catenary.raven2.topics import JOINTS
from catenary.simulation.cable_plant import UNITS
from oracles.ideal_plant import Floats, IdealPlant

START = (0.6, 1.4, 0.38, 0.0, 0.1, 0.2, -0.2)
OFFSET = np.array([0.02, -0.03, 0.001])  # [rad, rad, m]


class EncodedPlant(IdealPlant):
    """Its encoders count from the homing on; before it they read NaN."""

    def __init__(self, *, ready: bool = True) -> None:
        super().__init__(
            START,
            joint_names=JOINTS,
            joint_units=UNITS,
            lower=[0.0, 0.785, 0.23, -3.17, -1.22, -1.83, -1.83],
            upper=[1.57, 2.356, 0.56, 3.17, 1.22, 1.83, 1.83],
            ready=ready,
        )
        self.columns = (Column("jpos", "rad|m", 7), Column("ext_jpos", "rad|m", 3), Column("joint_enc", "count", 3))

    def telemetry(self) -> Mapping[str, Floats]:
        state = self.measured_js()
        true = state.q[:3] + OFFSET
        counts = np.round(true * 1e5)
        read = true if self.operating_state().is_homed else np.full(3, np.nan)
        told = {"jpos": state.q, "jpos_d": self.setpoint_js().q}
        return {**told, "jvel": state.qd, "tau": state.tau, "ext_jpos": read, "joint_enc": counts}
