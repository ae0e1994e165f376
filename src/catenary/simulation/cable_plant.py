"""A simulated RAVEN-II arm: real cables, its own firmware, homing, external encoders; a Plant."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import InputError, NotReadyError
from catenary.plant import JointState
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel, Tree
from catenary.simulation.base_motion import BaseTimeline, FixedBase, MovingBase
from catenary.simulation.cable_parameters import CableArm, Rig, load_cable_arm, right_arm, varied
from catenary.simulation.cable_physics import ArmState, Work, unstretched_rotors
from catenary.simulation.columns import COLUMNS, sample
from catenary.simulation.external_encoders import ExternalEncoders
from catenary.simulation.firmware import (
    OFF,
    POSITION,
    TORQUE,
    ControlState,
    TickLog,
    joint_torques,
    read_encoders,
)
from catenary.simulation.homing import home
from catenary.simulation.own_gravity import grav_dir_of, gravity_of, own_gravity
from catenary.simulation.records import AXES, POSITIONING, TOOLS
from catenary.simulation.simulated_plant import PERIOD, SimulatedPlant
from catenary.simulation.ticks import run_ticks
from catenary.transmission.drift import LARGEST_LOSS

JOINTS = ("shoulder", "elbow", "insertion", "roll", "wrist", "jaw1", "jaw2")
UNITS = ("rad", "rad", "m", "rad", "rad", "rad", "rad")
NO_LOG = TickLog.rows(0)
KEEP = np.full((1, AXES), np.nan)  # a row that leaves the setpoint where it is
# between which an arm stands at power-on [rad, rad, m]
STARTS = [*np.deg2rad([10.0, 60.0]), 0.30], [*np.deg2rad([70.0, 120.0]), 0.45]
PAYLOAD_PLACE = np.array([0.0, 0.0, -0.47])  # [m] in the insertion's frame: the tool's wrist


class CablePlant(SimulatedPlant):
    """One arm. Nothing moves before it is homed and enabled; brakes hold it while it is not enabled."""

    def __init__(
        self,
        arm: CableArm | None = None,
        *,
        side: str = "left",
        seed: int | None = None,
        start: ArrayLike | None = None,
        payload: float = 0.0,
        base: MovingBase | None = None,
        substeps: int = 2,
        grav_dir: Sequence[int] | None = None,
    ) -> None:
        """Put an arm on a base.

        Args:
            arm: Its numbers; the package's RAVEN-II when None.
            side: "left" (gold) or "right" (green).
            seed: Draws another robot of the same kind and where it stands; when None the nominal one, always
                at the same place.
            start: (3,) where the positioning joints stand at power-on [rad, rad, m], in place of a drawn one.
            payload: Mass at the tool's wrist [kg].
            base: What it stands on; a level base at rest when None.
            substeps: Physics steps in 1 ms; 1 is enough for hours-long runs.
            grav_dir: Gravity that its own compensation goes by, three whole numbers [cm/s2] as the robot has them,
                z down: (0, 0, 980) on the real one, on whatever base. No compensation of its own when None.

        Raises:
            InputError: An unknown side, a negative payload, fewer than one substep, or no such gravity.
        """
        if side not in ("left", "right"):
            raise InputError(f'side "{side}": expected left or right')
        if substeps < 1:
            raise InputError(f"substeps: expected at least 1, got {substeps}")
        rng = np.random.default_rng(0 if seed is None else seed)
        drawn = load_cable_arm() if arm is None else arm
        drawn = drawn if seed is None else varied(drawn, rng)
        self.arm = drawn if side == "left" else right_arm(drawn)
        super().__init__(BaseTimeline(FixedBase() if base is None else base, PERIOD), is_homed=False)
        self.side, self.seed, self.substeps = side, seed, substeps
        self.model: RobotModel = load_robot("raven2_full" if side == "left" else "raven2_full_right")
        positioning = load_robot("raven2" if side == "left" else "raven2_right")
        self._positioning = positioning
        self.carry(payload)
        # the arm's parameters and the firmware's; others may be put in place of them
        self.cable, self.firmware = self.arm.cable.copy(), self.arm.firmware.copy()
        self.state = ArmState()
        self.control = ControlState(braked=True, guarded=True)
        self.encoders = ExternalEncoders(self.arm.rig)
        self._own_gravity = own_gravity(positioning.tree)
        # what its program begins with
        self._written_gravity = None if grav_dir is None else gravity_of(grav_dir)
        self._work = Work()
        self._homing: Iterator[Floats] | None = None
        self._power_on(rng, start)

    # what a Plant says about itself

    joint_names: tuple[str, ...] = JOINTS
    joint_units: tuple[str, ...] = UNITS
    columns = COLUMNS

    @property
    def rig(self) -> Rig:
        """The external encoders' numbers."""
        return self.encoders.rig

    @property
    def lower(self) -> Floats:
        """Software limits below, (7,)."""
        return self.firmware.lower.copy()

    @property
    def upper(self) -> Floats:
        """Software limits above, (7,)."""
        return self.firmware.upper.copy()

    @property
    def grav_dir(self) -> tuple[int, int, int] | None:
        """Gravity that the robot's own compensation goes by [cm/s2], z down; None without compensation.

        May be set, as a program on the robot may: it holds until the arm is disabled or homes, and is then what it
        was at the beginning.
        """
        return None if self._written_gravity is None else grav_dir_of(self._own_gravity.gravity)

    @grav_dir.setter
    def grav_dir(self, grav_dir: Sequence[int]) -> None:
        gravity = gravity_of(grav_dir)
        if self._written_gravity is None:
            raise InputError("grav_dir: this robot was made without gravity compensation of its own")
        if self._own_gravity.weighs:
            self._own_gravity.gravity = gravity

    def measured_js(self) -> JointState:
        """Return the joint state that the firmware believes; gravity and base rates are an ideal sensor's."""
        control = self.control
        tau = joint_torques(self.firmware, control.torque)
        return self._joint_state(
            control.joint.copy(), control.joint_velocity.copy(), tau, control.motor.copy()
        )

    def setpoint_js(self) -> JointState:
        """Return the firmware's joint setpoint."""
        return self.measured_js()._replace(q=self.control.setpoint.copy(), qd=np.zeros(AXES))

    def telemetry(self) -> Mapping[str, Floats]:
        """Return the latest sample of every column of `columns`."""
        return sample(self.control, self.state.q, self.encoders, self._base_now())

    # what a Plant obeys

    def servo_jf(self, tau: Floats) -> None:
        """Command joint torques, (7,), or (3,) for the positioning joints with the tool held, [Nm, Nm, N, Nm...].

        They hold until the next command, and the setpoint follows the arm meanwhile.
        """
        self._require_ready()
        n = POSITIONING if np.shape(tau) == (POSITIONING,) else len(JOINTS)
        torque = as_array("servo_jf", tau, (n,))
        self.control.torque_command[:n] = torque
        self.control.mode[:n] = TORQUE
        self.control.mode[n:] = POSITION

    def wait(self) -> None:
        """Advance by one tick of 1 ms.

        Raises:
            NotReadyError: An axis that homes met no stop; the arm is then in FAULT.
        """
        row = self._wanted if self._homing is None else self._next_homing_row(self._homing)
        self._advance(KEEP if row is None else row[np.newaxis], NO_LOG)
        self._wanted = None
        self.encoders.see(self.state.q)

    def external_encoders(self) -> Floats:
        """Return where the external encoders see the positioning joints, (3,) [rad, rad, m]."""
        return self.encoders.positions(self.encoders.counts(self.state.q))

    # what only a simulator can do

    def run(self, setpoints: ArrayLike) -> TickLog:
        """Run a list of setpoints (T, 7), one a tick, in one compiled call, with the firmware inside.

        Equal, sample for sample, to `servo_jp` and `wait` for every row. NaN leaves that axis alone. Hours are run
        in pieces: the next call goes on where this one ended, bit for bit, and a log takes 528 B a tick.

        Raises:
            NotReadyError: Not homed, not enabled, or the software e-stop tripped on the way.
        """
        self._require_ready()
        rows = np.ascontiguousarray(setpoints, dtype=float)
        if rows.ndim != 2 or rows.shape[1] != 7:
            raise InputError(f"run: expected setpoints of shape (T, 7), got {rows.shape}")
        if np.isinf(rows).any():
            raise InputError(f"run: setpoints are infinite on {np.isinf(rows).any(axis=1).sum()} rows")
        self.control.mode[:] = POSITION
        log = TickLog.rows(len(rows))
        self._advance(rows, log)
        if self._state == "FAULT":
            raise NotReadyError(self._fault.removeprefix(": "))
        return log

    def carry(self, payload: float) -> None:
        """Carry a mass [kg] at the tool's wrist from now on, in place of the last one.

        Raises:
            InputError: Not zero or more.
        """
        if not payload >= 0.0 or not np.isfinite(payload):
            raise InputError(f"payload: expected zero or more kg, got {payload}")
        self.payload = payload
        links = self._positioning.with_payload("insertion", payload, PAYLOAD_PLACE).tree
        # writable ones, as deep copies are: compiled code is compiled once more for another kind of array
        self._tree = Tree._make(np.array(part) for part in links)

    def rub(self, factor: float) -> None:
        """Rub with so many times the arm's own Coulomb friction from now on, at rotors and joints.

        Raises:
            InputError: Not zero or more.
        """
        if not factor >= 0.0 or not np.isfinite(factor):
            raise InputError(f"friction: expected zero or more times the arm's own, got {factor}")
        for name in ("rotor_friction", "rotor_load_friction", "link_friction", "link_load_friction"):
            setattr(self.cable, name, factor * getattr(self.arm.cable, name))

    def wear(self, share: float) -> None:
        """Wear the cables: their permanent set and lost stiffness become a share, 0 to 1, of the largest there are.

        Raises:
            InputError: Not from 0 to 1.
        """
        if not 0.0 <= share <= 1.0:
            raise InputError(f"wear: expected a share from 0 to 1, got {share}")
        self.state.slack = share * self.cable.set_side * self.cable.largest_set
        self.state.loss = np.full(POSITIONING, share * LARGEST_LOSS)

    def resume_at(self, tick: int, rig_zero: Floats, *, is_homed: bool) -> None:
        """Go on from a saved tick, disabled; `state` and `control` have been written already.

        Args:
            tick: Since power-on.
            rig_zero: (3,) counts at which the rig's encoders are registered.
            is_homed: Whether the arm was homed then.
        """
        self._tick = tick
        self.encoders.zero = rig_zero.copy()
        self._is_homed = is_homed
        self._set_state("DISABLED")

    def _advance(self, rows: Floats, log: TickLog) -> None:
        """Run a tick for each row (T, 7), until the software e-stop trips."""
        done = 0
        while done < len(rows) and not (done and self.control.stopped):
            base, count = self._base.rows(self._tick, len(rows) - done)
            ran = run_ticks(
                self._tree,
                self.cable,
                self.firmware,
                self.state,
                self.control,
                self._own_gravity,
                self._work,
                rows[done : done + count],
                base.gravity,
                base.motion,
                self.substeps,
                log[done:],
            )
            done, self._tick = done + ran, self._tick + ran
        if self.control.stopped:
            self._set_state(
                "FAULT", f"the software e-stop tripped at {self.time:.3f} s: a motor's command was too large"
            )

    def _next_homing_row(self, homing: Iterator[Floats]) -> Floats | None:
        try:
            row = next(homing, None)
        except NotReadyError as error:
            self._set_state("FAULT", str(error))
            raise
        if row is None:  # the setpoint stays at home
            self._stop_homing()
            self._is_homed = True
            self._compensate()
        return row

    @property
    def _is_homing(self) -> bool:
        return self._homing is not None

    def _begin_homing(self) -> None:
        self._stop_homing()
        self._is_homed = False
        self._compensate()
        self.control.braked = False
        self._homing = home(
            self.firmware, self.control, self.encoders, self.cable.stop_side, self.joint_names
        )

    def _stop_homing(self) -> None:
        self._homing = None
        self.encoders.stop_watching()
        self.control.seek[:] = OFF
        self.control.guarded = True

    def _unhomed(self) -> None:
        """The firmware goes on; it is the servo verbs that are refused."""

    def _control_position(self) -> None:
        self.control.mode[:] = POSITION

    def _state_changed(self) -> None:
        self._stop_homing()
        control, moves = self.control, self._moves
        if self._state == "ENABLED":
            control.stopped = False
        control.braked = not moves
        control.mode[:] = POSITION if moves else OFF
        if moves:  # no jump when control begins
            control.setpoint = control.joint
        self._compensate()

    def _compensate(self) -> None:
        """Switch the robot's own gravity compensation: once homed, whether the pedal is down or not."""
        own = self._own_gravity
        runs = self._is_homed and not self._is_homing and self._state in ("ENABLED", "PAUSED")
        own.weighs = runs and self._written_gravity is not None
        if not own.weighs:
            self.control.gravity_torque[:] = 0.0
            own.gravity = np.zeros(3) if self._written_gravity is None else self._written_gravity

    def _power_on(self, rng: np.random.Generator, start: ArrayLike | None) -> None:
        state, control = self.state, self.control
        state.q = rng.uniform(*STARTS) if start is None else as_array("start", start, (POSITIONING,))
        state.rotor[:POSITIONING] = unstretched_rotors(self.cable, state.q)
        tools = rng.uniform(-0.5, 0.5, TOOLS)
        insertion = state.rotor[POSITIONING - 1]
        state.rotor[POSITIONING:] = self.cable.tool_ratio * tools + self.cable.tool_carried * insertion
        # the encoders count from wherever they woke up
        control.offset = np.round(rng.uniform(-2e5, 2e5, AXES))
        read_encoders(self.firmware, state, control)
        control.motor_velocity[:] = 0.0
        control.joint_velocity[:] = 0.0
        control.setpoint = control.joint
