"""View of a simulated arm with controls: motion, controller, base, payload, sensor faults, friction, cable wear."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Flags, Floats, as_array
from catenary.calibration.corrector import Corrector
from catenary.calibration.model import CalibrationModel
from catenary.control.controllers import CONTROLLERS, HOLDS, make_controller
from catenary.control.correction import Fade, StateCorrector
from catenary.control.loop import Tick, run_loop
from catenary.control.loop_report import LoopReport
from catenary.errors import CatenaryError
from catenary.gravity.payload import Payload
from catenary.gravity.torque import gravity_torque
from catenary.monitor import EventRate, Snapshot
from catenary.plant import Bounded, JointState, Plant, fault_of
from catenary.robots.catalog import RAVEN_SIDES
from catenary.sensing.gravity_vector import GravityReading, ReadingStatus
from catenary.sensing.imu import SensedGravity
from catenary.simulation.base_motion import BaseSamples, SteeredBase
from catenary.simulation.cable_plant import CablePlant, PositioningArm
from catenary.simulation.mujoco_plant import MujocoPlant
from catenary.simulation.sensors import InjectedFault
from catenary.simulation.simulated_plant import PacedPlant
from catenary.spatial import LEVEL
from catenary.trajectories.reference import InTurn, Reference, Rest, Trajectory
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.trajectories.zigzag import zigzag
from catenary.units import DISPLAY
from catenary.view.meshes import shapes_of
from catenary.view.page_content import Control, ControlTab, PageContent, Value, finite_ranges
from catenary.view.page_process import PageProcess
from catenary.workflows.gravity_trials import SimulatedArm, base_sensor, simulated_arm
from catenary.workflows.robot.motion import check_motion, gentle_way, random_within

_STOP_S = 0.4  # [s] in which an interrupted motion comes to rest

Motion = Callable[[Floats], Trajectory]  # creates a motion that starts at joint positions (n,) [rad|m]


class SteeredTrajectory:
    """A repeated motion that can be replaced: it decelerates along its own path, then the next one starts."""

    duration = np.inf

    def __init__(self, q: Floats) -> None:
        """Rest at q (n,) [rad|m]."""
        self._motion: Trajectory = Rest(q, 0.0)
        self._recipe: Motion | None = None
        self._next: Motion | None = None
        self._place, self._rate, self._time = 0.0, 1.0, 0.0  # along the motion; of it; of the last call

    def follow(self, recipe: Motion | None) -> None:
        """Come to rest, then follow the motions of a recipe, one after the other; None stays at rest."""
        self._next = _rest if recipe is None else recipe

    def rest_at(self, q: Floats) -> None:
        """Be at rest at q (n,) [rad|m] at once, as after hand guiding."""
        self._motion, self._recipe, self._next = Rest(q, 0.0), None, None
        self._place, self._rate = 0.0, 1.0

    def __call__(self, t: float) -> Reference:
        """Return the reference at `t` [s], which must not decrease between calls."""
        step = max(0.0, t - self._time)
        self._time = t
        slower = 0.0
        if self._next is not None:
            rate = max(0.0, self._rate - step / _STOP_S)
            slower = -1.0 / _STOP_S if rate > 0.0 else 0.0
            self._place += 0.5 * (self._rate + rate) * step
            self._rate = rate
        else:
            self._place += step
        at_rest = self._rate == 0.0 or self._place >= self._motion.duration
        if at_rest and (self._next is not None or self._recipe is not None):
            self._begin(self._motion(min(self._place, self._motion.duration)).q)
            slower = 0.0
        q, qd, qdd = self._motion(self._place)
        return Reference(q, self._rate * qd, self._rate**2 * qdd + slower * qd)

    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return references at increasing times (N,) [s]; this advances the motion."""
        rows = [self(float(t)) for t in as_array("times", times, (None,))]
        q, qd, qdd = (np.array(part) for part in zip(*rows, strict=True))
        return q, qd, qdd

    def _begin(self, q: Floats) -> None:
        recipe = self._next if self._next is not None else self._recipe
        self._next, self._place, self._rate = None, 0.0, 1.0
        self._motion = Rest(q, 0.0) if recipe is None else recipe(q)
        self._recipe = None if recipe is _rest else recipe


def _rest(q: Floats) -> Trajectory:
    return Rest(q, 0.0)


class SwitchedCorrector:
    """Corrector whose correction is faded into the loop when switched on, and out when switched off."""

    def __init__(
        self, corrector: StateCorrector, whole: Callable[[JointState], JointState], n: int, period: float
    ) -> None:
        """Wrap a corrector of the `whole` robot's state, whose first n joints are the loop's; `period` [s]."""
        self._corrector, self._whole, self._n = corrector, whole, n
        self._fade = Fade(np.zeros(n), period)
        self.is_on = self._was_on = False
        self.calibrated, self.interval = np.full(n, np.nan), np.full(n, np.nan)
        self.inside: Flags = np.ones(n, dtype=bool)

    def prepare(self, joint_names: Sequence[str], joint_units: Sequence[str], rate_hz: float) -> None:
        """Do nothing: the model knows the whole robot."""

    def correct_state(self, state: JointState, out: Floats, inside: Flags, interval: Floats) -> None:
        """Write positions (n,), reported, calibrated or faded between them, flags and half-widths."""
        whole = self._whole(state)
        size, n = len(whole.q), self._n
        q, flags, widths = np.empty(size), np.empty(size, dtype=bool), np.empty(size)
        self._corrector.correct_state(whole, q, flags, widths)
        self.calibrated, self.inside, self.interval = q[:n], flags[:n], widths[:n]
        correction = self.calibrated - state.q if self.is_on else np.zeros(n)
        out[:] = state.q + correction - self._fade.remainder(correction, self.is_on != self._was_on)
        self._was_on = self.is_on
        inside[:], interval[:] = self.inside, self.interval


# fault kinds by label
_SENSOR_FAULTS = {
    "unplugged": "drop_out", "stuck": "stuck", "wrong sign": "wrong_sign", "spikes": "spikes", "came loose": "jump",
}  # fmt: skip
# warnings of aged readings (SensedGravity)
_AGED_READINGS = {
    ReadingStatus.STALE: "no new gravity: the last one is held",
    ReadingStatus.FALLBACK: "no new gravity: its mean direction of the last seconds is used",
}
# friction of a robot without cables at "1", relative to its largest torque, or to 1 Nm or N if unknown
_RIGID_FRICTION = 0.02
_FRICTION_END = 4.0
_GOTO_PREFIX = "goto:"  # of the names of joint sliders
_MOTIONS = _REST, _GO_TO, _RANDOM, _ZIGZAG = "rest", "go to the sliders", "random motion", "zig-zag"
_ENABLE, _PAUSE, _HOME = _LEVELS = ("enable", "pause", "home")
_QUICKER = 2.5  # speed relative to a gentle go-to, which is for real robots
_RANDOM_S = 60.0  # duration of a random motion
_SPARSITY = 0.25  # of RAVEN-II's zig-zag
_OWN_CONTROL = "the robot's own position control"
_HOLD_CONTROL = "gravity compensation alone"


class Surroundings:
    """Base, payload, sensor, friction and wear of a simulated arm; a GravitySource by a sensor on its base."""

    def __init__(self, arm: SimulatedArm) -> None:
        plant = arm.plant
        self.plant = cast(CablePlant | MujocoPlant, plant.arm if isinstance(plant, PositioningArm) else plant)
        self.has_cables = isinstance(self.plant, CablePlant)
        self._torque = np.where(np.isfinite(arm.largest_torque), arm.largest_torque, 1.0)
        self._sensor, mounting = base_sensor(self, start=self.plant.time)
        self._sensed = SensedGravity(self._sensor.mailbox, mounting, feed=self._sensor.advance)
        self._attitude = {"roll_deg": 0.0, "pitch_deg": 0.0, "rocking_deg": 0.0, "rocking_hz": 0.5}
        self._base = SteeredBase()
        self.reading: GravityReading | None = None  # the last one

    def changes(self) -> dict[str, Callable[[Any], None]]:
        """Return the functions that apply a control's value, by the control's name."""
        actions: dict[str, Callable[[Any], None]] = {name: partial(self._tilt, name) for name in self._attitude}
        actions["sensor"] = self._break_sensor
        plant, unit = self.plant, _RIGID_FRICTION * self._torque
        if isinstance(plant, CablePlant):
            return actions | {"payload_kg": plant.carry, "friction": plant.set_coulomb_friction, "wear": plant.wear}
        actions["payload_kg"] = lambda mass: plant.attach(Payload(mass) if mass > 0.0 else None)
        return actions | {"friction": lambda factor: plant.set_coulomb_friction(factor * unit)}

    def sample(self, times: Floats) -> BaseSamples:
        """Return the present base's motion at times (N,) [s]."""
        return self.plant.base.sample(times)

    def _tilt(self, name: str, value: float) -> None:
        self._attitude[name] = value
        *angles, frequency = self._attitude.values()
        roll, pitch, amplitude = np.deg2rad(angles)
        self._base = self._base.toward(self.plant.time, roll, pitch, amplitude=amplitude, frequency=frequency)
        self.plant.set_base(self._base)

    def _break_sensor(self, fault: str) -> None:
        known = fault in _SENSOR_FAULTS
        self._sensor.faults = (InjectedFault(_SENSOR_FAULTS[fault], self.plant.time),) if known else ()

    def read(self, time: float) -> GravityReading:
        """Return gravity by the sensor at a time [s]."""
        self.reading = self._sensed.read(time)
        return self.reading

    def actual(self) -> Floats:
        """Return true gravity (3,) [m/s2] in the base frame."""
        return np.asarray(self._base.sample(np.array([self.plant.time])).gravity[0])

    def warnings(self) -> tuple[str, ...]:
        """Return warnings of the sensor."""
        reading = self.reading
        if reading is None:
            return ()
        warnings = []
        if reading.status in _AGED_READINGS:
            warnings.append(_AGED_READINGS[reading.status])
        if reading.faults:
            warnings.append(f"sensor: {reading.faults.message}")
        return tuple(warnings)


def driving_tabs(
    limits: Bounded, q: Floats, *, motion: str, controllers: tuple[str, ...], has_cables: bool, has_model: bool
) -> tuple[ControlTab, ...]:
    """Return the tabs of an arm at q (n,) [rad|m]: motion and controller, as selected, surroundings, model."""
    drive = ControlTab(
        "Drive",
        (
            Control(
                "buttons", "level", "run level", None, _LEVELS, "Home: against the stops, as a real RAVEN-II does."
            ),
            Control("choice", "motion", "motion", motion, _MOTIONS if has_cables else _MOTIONS[:3]),
            Control("choice", "controller", "controller", controllers[0], controllers),
            *joint_sliders(limits, q),
        ),
    )
    max_payload = 1.0 if has_cables else 5.0
    friction = ("Coulomb friction, x its own", 1.0) if has_cables else ("Coulomb friction", 0.0)
    sliders = [  # name, label, value, ends and step, hint
        ("roll_deg", "base roll [deg]", 0.0, (-90.0, 90.0, 1.0), "About x."),
        ("pitch_deg", "base pitch [deg]", 0.0, (-90.0, 90.0, 1.0), "Then about the base's own y."),
        ("rocking_deg", "rocking, to either side [deg]", 0.0, (0.0, 20.0, 0.5), "About x."),
        ("rocking_hz", "rocking [Hz]", 0.5, (0.1, 2.0, 0.1), ""),
        ("payload_kg", "payload [kg]", 0.0, (0.0, max_payload, 0.05), "Unknown to the controller."),
        ("friction", *friction, (0.0, _FRICTION_END, 0.1), ""),
        ("wear", "cable wear [share]", 0.0, (0.0, 1.0, 0.05), "Permanent stretch and loss of stiffness."),
    ]
    world = [Control("slider", *slider) for slider in sliders[: None if has_cables else -1]]
    world.insert(5, Control("choice", "sensor", "gravity sensor's fault", "none", ("none", *_SENSOR_FAULTS)))
    tabs = [drive, ControlTab("Surroundings", tuple(world))]
    if has_model:
        text = "The calibrated arm shows the joint positions by the model. Switched on, the loop uses them."
        switch = Control("switch", "model", "use the model in the loop", False)
        tabs.append(ControlTab("Model", (switch,), text))
    return tuple(tabs)


def joint_sliders(limits: Bounded, q: Floats) -> list[Control]:
    """Return a slider for each joint [deg|mm]."""
    sliders: list[Control] = []
    ranges = finite_ranges(limits)
    for j, (name, unit) in enumerate(zip(limits.joint_names, limits.joint_units, strict=True)):
        shown, scale = DISPLAY[unit]
        # rounded to a tenth within the limits
        low = float(np.ceil(10.0 * scale * ranges.lower[j] - 1e-6) / 10.0)
        high = float(np.floor(10.0 * scale * ranges.upper[j] + 1e-6) / 10.0)
        value = float(np.clip(round(scale * float(q[j]), 1), low, high))
        sliders.append(Control("slider", f"{_GOTO_PREFIX}{name}", f"{name} [{shown}]", value, (low, high, 0.1)))
    return sliders


_SHOW_EVERY_TICKS = 40  # 25 states a second, of which the page draws 20 at most
_LISTEN_EVERY_TICKS = 10
_NOTICE_S = 8.0  # [s] for which an error stays on the page


class LeaveLoop(Exception):
    """Ends the running control loop for a change outside it; its text is the next run level, if any."""


class DrivenArm:
    """A simulated arm with its surroundings, controlled from a page."""

    def __init__(
        self,
        robot: str,
        *,
        model: CalibrationModel | None = None,
        seed: int | None = None,
        rng: np.random.Generator,
        real_time: bool = True,
    ) -> None:
        """Set up an arm, homed on a level base.

        Args:
            robot: Name or file of a robot with inertia.
            seed: Draws a random arm; None for the nominal one.
            real_time: Pace ticks in real time; as fast as possible otherwise.
        """
        self.arm: SimulatedArm = simulated_arm(robot, base=SteeredBase(), seed=seed)
        self.surroundings = Surroundings(self.arm)
        # paced, without real-time priority: a view must not block other programs
        self._paced = PacedPlant(self.arm.plant) if real_time else None
        self._plant = self.arm.plant if self._paced is None else cast(Plant, self._paced)
        self._rng = rng
        self._n = self.arm.model.n
        self._corrector = None if model is None else self._switched(model)
        self._kinds = {kind.words: kind for kind in CONTROLLERS.values() if kind.fits(self.arm)}
        self._controllers = {words: kind.make(self.arm) for words, kind in self._kinds.items()}
        self._controllers[_HOLD_CONTROL] = make_controller("dg", self.arm, among=HOLDS)
        usual = CONTROLLERS["dg"].words
        self._controller = self._controllers[usual]
        self.control = _OWN_CONTROL if model is not None else usual
        self._goal = np.array(self._plant.measured_js().q)
        self.motion = _RANDOM
        self._recipe: Motion | None = None
        self._zigzag = zigzag("J2-J3", (_SPARSITY,))
        self._trajectory = SteeredTrajectory(self._goal)
        self._ticks, self._late, self._seen_late = EventRate(), EventRate(), 0
        self._robot = robot
        self._notice: tuple[float, str] = (-np.inf, "")
        self._values: dict[str, Value] = {}
        self._does: dict[str, Callable[[Any], None]] = {  # by the name of a control, with its value
            **self.surroundings.changes(), "motion": self._choose_motion, "controller": self._choose_controller,
            "model": partial(setattr, self._corrector, "is_on"), "level": self._change_level,
            **{f"{_GOTO_PREFIX}{name}": partial(self._go_to, j) for j, name in enumerate(self._plant.joint_names)},
        }  # fmt: skip

    def shown(self, title: str) -> PageContent:
        """Return the content of its page."""
        legend = {"reported": "reported", "true": "true"}
        if self._corrector is not None:
            legend["calibrated"] = "calibrated"
        others = [one for one in (*self._controllers, _OWN_CONTROL) if one != self.control]
        tabs = driving_tabs(
            self._plant, self._goal, motion=self.motion, controllers=(self.control, *others),
            has_cables=self.surroundings.has_cables, has_model=self._corrector is not None,
        )  # fmt: skip
        shapes, why = shapes_of(self._robot, self.arm.model)
        if why is not None:
            self._say(why)
        return PageContent(title, self.arm.model, shapes, tabs, self._goal, legend, nominal_hz=1.0 / self._plant.period)

    def run(self, page: PageProcess, ended: Callable[[], bool] = lambda: False) -> None:
        """Run until the page, `ended` or Ctrl-C ends it; the control loop runs whenever the robot is ready."""
        self._page, self._ended = page, ended
        self._choose_motion(self.motion)
        while page.is_running and not ended():
            try:
                if self._plant.operating_state().is_ready:
                    self.run_loop()
                else:
                    self._wait_a_while()
            except LeaveLoop as leave:
                self._reach_level(str(leave))
            except CatenaryError as error:
                self._say(str(error))

    def run_loop(self) -> LoopReport:
        """Run the control loop, which ends by an exception, with the arm held and paused."""
        own = self.control == _OWN_CONTROL
        start = self._plant.setpoint_js().q if own else self._plant.measured_js().q
        self._trajectory = SteeredTrajectory(np.array(start))
        if self._recipe is not None:
            self._trajectory.follow(self._recipe)
        return run_loop(
            self._plant, None if own else self, self._trajectory, limits=self.arm.limits(),
            corrector=self._corrector, gravity=self.surroundings, observers=[self._observe],
            duration=np.inf, max_speed=np.inf,  # a simulated arm may fall
        )  # fmt: skip

    # in the loop

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return torques (n,) [Nm|N] of the selected controller."""
        return self._controller.torque(state, reference)

    def _observe(self, tick: Tick) -> None:
        self._count()
        if tick.number % _LISTEN_EVERY_TICKS == 0:
            self._listen()
            if self._ended() or not self._page.is_running:
                raise LeaveLoop
        if tick.number % _SHOW_EVERY_TICKS == 0:
            setpoint: Floats | None = tick.reference.q
            if self.control == _HOLD_CONTROL:
                setpoint = None
                self._trajectory.rest_at(tick.state.q)
            feedback = None if self.control == _OWN_CONTROL else self._controller.feedback.copy()
            self._show(tick.state._replace(q=tick.q_nominal), setpoint, feedback)

    def _count(self) -> None:
        now, late = time.perf_counter(), 0 if self._paced is None else self._paced.late
        self._ticks.count(now)
        self._late.count(now, late - self._seen_late)
        self._seen_late = late

    def _wait_a_while(self) -> None:
        """Advance by 20 ms while the arm is not controlled: it is homing, or brakes hold it."""
        for _ in range(20):
            self._plant.wait()
            self._count()
        self._listen()
        state = self._plant.measured_js()
        self.surroundings.read(state.time)
        self._show(state, self._plant.setpoint_js().q, None)

    def _show(self, state: JointState, setpoint: Floats | None, feedback: Floats | None) -> None:
        """Show a state whose q is as reported."""
        plant, world, now = self._plant, self.surroundings, time.perf_counter()
        reading = world.reading
        gravity = state.gravity if reading is None else reading.gravity
        operating = plant.operating_state()
        corrector = self._corrector if operating.is_homed else None
        known: dict[str, Any] = {}
        if corrector is not None:
            known = {"calibrated": corrector.calibrated, "inside": corrector.inside, "interval": corrector.interval}
            if isinstance(world.plant, CablePlant):
                known["encoder"] = world.plant.external_encoders()
        notes = [self._notice[1]] if now - self._notice[0] < _NOTICE_S else []
        kind = self._kinds.get(self.control)
        shot = Snapshot(
            state.time, plant.joint_names, plant.joint_units, state.q, setpoint, tau=state.tau, gravity=gravity,
            gravity_tau=gravity_torque(self.arm.model, state.q, gravity), fault=fault_of(plant), operating=operating,
            gravity_age=state.gravity_age if reading is None else reading.age, lower=plant.lower, upper=plant.upper,
            rate_hz=self._ticks.hertz(now), late=self._late.within(now),
            error=state.q - self.arm.q_true() if operating.is_homed else None,
            feedback=state.tau if feedback is None else feedback, actual=world.actual(),
            assumed={"level": LEVEL, "sensed": gravity}.get(kind.gravity or "") if kind else None,
            doing=f": {self.motion}" if operating.state == "ENABLED" and operating.is_homed else "",
            notes=(*notes, *world.warnings()), **known,
        )  # fmt: skip
        self._page.put(shot, self._values)

    # changes of controls

    def _listen(self) -> None:
        for name, value in self._page.changes():
            try:
                self._does[name](value)
            except CatenaryError as error:
                self._say(str(error))

    def _go_to(self, j: int, value: float) -> None:
        """Go to the sliders' positions; value [deg|mm]."""
        self._goal = self._goal.copy()
        goal = value / DISPLAY[self._plant.joint_units[j]][1]
        self._goal[j] = np.clip(goal, self._plant.lower[j], self._plant.upper[j])
        self._choose_motion(_GO_TO)

    def _choose_motion(self, motion: str) -> None:
        if motion == _ZIGZAG:
            check_motion(self._plant, self._zigzag)
        self._recipe = None if motion == _REST else partial(self._way, motion)
        self.motion = self._values["motion"] = motion
        self._trajectory.follow(self._recipe)

    def _way(self, motion: str, q: Floats) -> Trajectory:
        """Return the next part of a motion that is not rest, from q (n,) [rad|m]."""
        limits = finite_ranges(self._plant)
        if motion == _GO_TO:
            return gentle_way(q, np.clip(self._goal, limits.lower, limits.upper), limits.joint_units, speed=_QUICKER)
        made: Trajectory = self._zigzag
        if motion == _RANDOM and self.arm.model.name in RAVEN_SIDES:
            made = random_sinusoids(self._rng, _RANDOM_S)
        elif motion == _RANDOM:
            made = random_within(limits, _RANDOM_S, self._rng)
        return InTurn([gentle_way(q, made(0.0).q, limits.joint_units, speed=_QUICKER), made])

    def _choose_controller(self, control: str) -> None:
        before, self.control = self.control, control
        if control != _OWN_CONTROL:
            self._controller = self._controllers[control]
        self._values["controller"] = control
        if _OWN_CONTROL in (before, control) and before != control and self._plant.operating_state().is_ready:
            raise LeaveLoop(_ENABLE)

    def _change_level(self, level: str) -> None:
        if not self._plant.operating_state().is_ready:
            self._reach_level(level)
        elif level != _ENABLE:
            raise LeaveLoop(level)

    def _reach_level(self, level: str) -> None:
        state = self._plant.operating_state().state
        if level in (_ENABLE, _HOME) and state != "ENABLED":
            self._plant.state_command("resume" if state == "PAUSED" else "enable")
        if level == _HOME:
            self._plant.state_command("home")

    def _say(self, text: str) -> None:
        self._notice = (time.perf_counter(), text)

    # setting up

    def _switched(self, loaded: CalibrationModel) -> SwitchedCorrector:
        corrector = Corrector(loaded, rate_hz=1.0 / self._plant.period)
        whole = self.surroundings.plant
        corrector.prepare(whole.joint_names, whole.joint_units, 1.0 / self._plant.period)
        measured = (lambda _: whole.measured_js()) if isinstance(whole, CablePlant) else (lambda state: state)
        return SwitchedCorrector(corrector, measured, self._n, self._plant.period)
