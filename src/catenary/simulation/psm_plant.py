"""Simulated da Vinci PSM under the dVRK's control: links, cables, a wrist with backlash, an optical tracker."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.dvrk_psm import PSM_JOINTS
from catenary.plant import Column
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.simulation.base_motion import BaseSamples, MovingBase
from catenary.simulation.compiled_records import AXES, POSITION
from catenary.simulation.firmware_plant import AXIS_FIELDS, FirmwarePlant, columns_of, half_cosine
from catenary.simulation.psm_controller import (
    ARM_JOINTS,
    PsmArm,
    PsmControlState,
    PsmLog,
    PsmState,
    PsmWork,
    load_psm,
    read_psm_encoders,
    register_psm,
    run_psm_ticks,
    unstretched_motors,
    varied_psm,
)
from catenary.simulation.simulated_plant import PERIOD

_PSM_UNITS = ("rad", "rad", "m", "rad", "rad", "rad", "rad")
_POWER_WAIT_S = 0.5  # [s] until the amplifiers hold the arm
_NOISE_ROWS = 8191  # period of the tracker's noise, in ticks
_HOME_TIME_S = 3.0  # [s] of the half cosine to the home position
# range of the positions at power-on [rad, rad, m, rad...]
_START_ENDS = (
    np.array([*np.deg2rad([-20.0, -20.0]), 0.06, *np.deg2rad([-30.0, -10.0, -10.0, 0.0])]),
    np.array([*np.deg2rad([20.0, 20.0]), 0.18, *np.deg2rad([30.0, 10.0, 10.0, 10.0])]),
)
_REPORTED_FIELDS = {  # name in telemetry: field of the controller's state, unit
    **AXIS_FIELDS,
    "effort": ("torque", "Nm|N"),
    "current": ("current", "A"),
}
PSM_COLUMNS = ("measured_js", "measured_js_velocity", "measured_js_effort", "setpoint_js", "ext_jpos")


class PsmPlant(FirmwarePlant[PsmLog]):
    """Simulated PSM with its instrument. Brakes hold it while it is not enabled; the real one is balanced instead."""

    joint_names = (*PSM_JOINTS, "jaw")
    joint_units = _PSM_UNITS
    reported = _REPORTED_FIELDS
    columns = columns_of(_REPORTED_FIELDS, Column("ext_jpos", "rad|m", ARM_JOINTS), Column("q_true", "rad|m", AXES))
    log = PsmLog
    state: PsmState
    stops_when = "the controller stopped at {time}: a joint was farther from its setpoint than the PID tolerates"

    def __init__(
        self,
        arm: PsmArm | None = None,
        *,
        seed: int | None = None,
        start: ArrayLike | None = None,
        base: MovingBase | None = None,
        substeps: int = 2,
    ) -> None:
        """Create an arm, powered on and disabled.

        Args:
            arm: Parameters; the package's PSM when None.
            seed: Draws a random arm of the kind and its start; None is the nominal arm at a fixed start.
            start: (7,) joint positions at power-on [rad, rad, m, rad...]; drawn when None.
            base: Motion of the base; level and fixed when None.
            substeps: Physics steps per millisecond.
        """
        rng = np.random.default_rng(0 if seed is None else seed)
        drawn = load_psm() if arm is None else arm
        self.arm = drawn if seed is None else varied_psm(drawn, rng)
        super().__init__(base, substeps)
        self.seed = seed
        self.model: RobotModel = load_robot("dvrk_psm")
        # parameters of the arm and of its controller, which may be replaced
        self.drive, self.firmware = self.arm.drive.copy(), self.arm.controller.copy()
        self.state = PsmState()
        self.control = PsmControlState(braked=True, guarded=True)
        self._work = PsmWork()
        self._noise = np.random.default_rng([0 if seed is None else seed, 1]).normal(size=(_NOISE_ROWS, ARM_JOINTS))
        self._power_on(rng, start)

    def telemetry(self) -> Mapping[str, Floats]:
        """Return the latest sample of every column of `columns`."""
        return self._sample(ext_jpos=self.external_encoders(), q_true=self.state.q.copy())

    def external_encoders(self) -> Floats:
        """Return the arm's joint positions by the tracker, (6,) [rad, rad, m, rad, rad, rad]."""
        return self.seen(self.state.q, self._tick)

    def seen(self, q: Floats, ticks: ArrayLike) -> Floats:
        """Return the tracker's reading (..., 6) of true joint positions q (..., 7) in ticks (...).

        Its noise is a function of the tick, however often it is read.
        """
        tracker = self.arm.tracker
        noisy = q[..., :ARM_JOINTS] + tracker.noise * self._noise[np.asarray(ticks) % _NOISE_ROWS]
        return np.asarray(np.round(noisy / tracker.resolution) * tracker.resolution)

    @property
    def identity(self) -> dict[str, object]:
        """Parameters that distinguish this arm from others of its kind."""
        return {"robot": self.arm.name, "seed": self.seed}

    def _run_ticks(self, rows: Floats, base: BaseSamples, log: PsmLog) -> int:
        return run_psm_ticks(
            self.arm.links, self.arm.coupling, self.drive, self.firmware, self.state, self.control, self._work, rows,
            base.gravity, base.motion, self.substeps, log,
        )  # fmt: skip

    def _homing_rows(self) -> Iterator[Floats]:
        """Register by the potentiometers, hold, and move home along half a cosine, as the dVRK does.

        The potentiometers are at the actuators: registration does not remove backlash and stretch of the cables.
        """
        control, home = self.control, self.firmware.home_value
        register_psm(self.firmware, control, self.drive, self.state.rotor)
        control.guarded = False  # it may be beyond the joint limits
        control.mode[:] = POSITION
        start = control.joint.copy()
        for _ in range(round(_POWER_WAIT_S / PERIOD)):
            yield start
        yield from half_cosine(start, home, _HOME_TIME_S)

    def _power_on(self, rng: np.random.Generator, start: ArrayLike | None) -> None:
        state = self.state
        state.q = rng.uniform(*_START_ENDS) if start is None else as_array("start", start, (AXES,))
        state.rotor = unstretched_motors(self.drive, state.q)
        self._wake_encoders(rng, 2e4, lambda: read_psm_encoders(self.firmware, state, self.control))


def psm_telemetry(plant: PsmPlant, log: PsmLog) -> dict[str, Floats]:
    """Return T ticks of a run as telemetry: columns (T, 6) by name, without the jaw, in SI.

    Args:
        log: Its last T ticks.
    """
    measured = (log.joint, log.joint_velocity, log.torque, log.setpoint)
    columns = {name: values[:, :ARM_JOINTS].copy() for name, values in zip(PSM_COLUMNS, measured, strict=False)}
    return {**columns, "ext_jpos": plant.seen(log.q, plant.ticks - np.arange(len(log.q), 0, -1))}
