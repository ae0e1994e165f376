"""A simulated arm driven from the page: its control loop, and the changes while it runs."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import cast

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.model import CalibrationModel
from catenary.calibration.model_file import load_model
from catenary.control.loop import Tick, run_loop
from catenary.control.loop_report import LoopReport
from catenary.control.pd import SplitController
from catenary.errors import CatenaryError
from catenary.gravity.torque import gravity_torque
from catenary.monitor import EventRate, Snapshot
from catenary.plant import JointState, Plant, fault_of
from catenary.simulation.base_motion import SteeredBase
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.simulated_plant import PacedPlant
from catenary.spatial import LEVEL
from catenary.trajectories.reference import Reference
from catenary.units import DISPLAY
from catenary.view import steering
from catenary.view import surroundings as around
from catenary.view.page_process import PageProcess
from catenary.view.shapes import shapes_of
from catenary.view.shown import Change, Shown, Value
from catenary.view.state import ViewState
from catenary.view.surroundings import Surroundings, driving_tabs
from catenary.view.watched import operating_in_words, view_state
from catenary.workflows.gravity.simulated_arm import SimulatedArm, simulated_arm
from catenary.workflows.gravity.trials import make_controller, make_hold

SHOW_EVERY = 40  # ticks: 25 states a second, which the page draws 20 of at most
LISTEN_EVERY = 10  # ticks
SAID = 8.0  # [s] for which a refusal stays on the page


class LeaveLoop(Exception):
    """A change that the running control loop cannot make; what comes next: resume, home, or nothing, paused."""


class DrivenArm:
    """A simulated arm, its surroundings, and the page that shows and drives it."""

    def __init__(
        self,
        robot: str,
        *,
        model: Path | None = None,
        seed: int | None = None,
        rng: np.random.Generator,
        real_time: bool = True,
    ) -> None:
        """Set up an arm with inertia, homed on a level base; without `real_time` ticks are as short as they can be."""
        loaded = None if model is None else load_model(model)[0]
        self.arm: SimulatedArm = simulated_arm(robot, base=SteeredBase(), seed=seed)
        self.surroundings = Surroundings(self.arm)
        # paced, and without a real loop's priority: a picture must not hold up whatever else the machine does
        self._paced = PacedPlant(self.arm.plant) if real_time else None
        self._plant = self.arm.plant if self._paced is None else cast(Plant, self._paced)
        self._rng = rng
        self._n = self.arm.model.n
        self._corrector = None if loaded is None else self._switched(loaded)
        self._controllers: dict[str, SplitController] = {k: make_controller(k, self.arm) for k in ("pd", "sg", "dg")}
        self._controllers["hold"] = make_hold("dg", self.arm)
        self._controller = self._controllers["dg"]
        self.control = around.OWN if model is not None else "PD + sensed gravity (DG)"
        self._goal = np.array(self._plant.measured_js().q)
        self.motion = around.RANDOM
        self._recipe: steering.Motion | None = None
        self._trajectory = steering.SteeredTrajectory(self._goal)
        self._ticks, self._late, self._seen_late = EventRate(), EventRate(), 0
        self._robot = robot
        self._said: tuple[float, str] = (-np.inf, "")
        self._values: dict[str, Value] = {}
        self._page: PageProcess | None = None

    def shown(self, title: str) -> Shown:
        """Return what its page shows."""
        legend = {"reported": "reported", "true": "true"}
        if self._corrector is not None:
            legend["calibrated"] = "calibrated"
        tabs = driving_tabs(
            self._plant, self._goal, motion=self.motion, controller=self.control,
            has_cables=self.surroundings.has_cables, has_model=self._corrector is not None,
        )  # fmt: skip
        shapes, why = shapes_of(self._robot, self.arm.model)
        if why is not None:
            self._say(why)
        return Shown(title, self.arm.model, shapes, tabs, self._goal, legend)

    def run(self, page: PageProcess, ended: Callable[[], bool] = lambda: False) -> None:
        """Run until the page is gone, `ended` says so, or Ctrl-C."""
        self._page, self._ended = page, ended
        self._choose_motion(self.motion)
        while page.is_running and not ended():
            state = self._plant.operating_state()
            try:
                if state.state == "ENABLED" and state.is_homed and not state.is_busy:
                    self.run_loop()
                else:
                    self._wait_a_while()
            except LeaveLoop as leave:
                self._reach_level(str(leave))
            except CatenaryError as error:
                self._say(str(error))

    def run_loop(self) -> LoopReport:
        """Run the control loop until something ends it; it ends by an exception, with the arm held and paused."""
        own = self.control == around.OWN
        start = self._plant.setpoint_js().q if own else self._plant.measured_js().q
        self._trajectory = steering.SteeredTrajectory(np.array(start))
        if self._recipe is not None:
            self._trajectory.follow(self._recipe)
        return run_loop(
            self._plant, None if own else self, self._trajectory, limits=self.arm.limits(),
            corrector=self._corrector, gravity=self.surroundings, observers=[self._observe],
            duration=np.inf,
        )  # fmt: skip

    # in the loop

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return torques (n,) [Nm|N] of the controller that is chosen."""
        return self._controller.torque(state, reference)

    def _observe(self, tick: Tick) -> None:
        self._count()
        if tick.number % LISTEN_EVERY == 0:
            self._listen(in_loop=True)
        if tick.number % SHOW_EVERY == 0 and self._page is not None:
            setpoint = tick.reference.q
            if self.control == "gravity compensation alone":
                setpoint = np.full(self._n, np.nan)
                self._trajectory.rest_at(tick.state.q)
            feedback = None if self.control == around.OWN else self._controller.feedback.copy()
            self._page.put(self._state(tick.state._replace(q=tick.q_nominal), setpoint, feedback))

    def _count(self) -> None:
        now, late = time.perf_counter(), 0 if self._paced is None else self._paced.late
        self._ticks.count(now)
        self._late.count(now, late - self._seen_late)
        self._seen_late = late

    def _wait_a_while(self) -> None:
        """Pass 20 ms while the arm is not controlled: it homes, or brakes hold it."""
        for _ in range(20):
            self._plant.wait()
            self._count()
        self._listen(in_loop=False)
        if self._page is not None:
            state = self._plant.measured_js()
            self.surroundings.read(state.time)
            self._page.put(self._state(state, self._plant.setpoint_js().q, None))

    def _state(self, state: JointState, setpoint: Floats, feedback: Floats | None) -> ViewState:
        """Return what is shown of a state whose q is as reported."""
        plant, world, now = self._plant, self.surroundings, time.perf_counter()
        reading = world.reading
        gravity = state.gravity if reading is None else reading.gravity
        operating = plant.operating_state()
        corrector = self._corrector if operating.is_homed else None
        encoder = None
        if corrector is not None and isinstance(world.plant, CablePlant):
            encoder = world.plant.external_encoders()
        snapshot = Snapshot(
            state.time, plant.joint_names, plant.joint_units, state.q, setpoint,
            None if corrector is None else corrector.calibrated,
            None if corrector is None else corrector.inside,
            None if corrector is None else corrector.interval,
            encoder=encoder, tau=state.tau, gravity_tau=gravity_torque(self.arm.model, state.q, gravity),
            gravity=gravity, gravity_age=state.gravity_age if reading is None else reading.age, fault=fault_of(plant),
            operating=operating, lower=plant.lower, upper=plant.upper, rate_hz=self._ticks.hertz(now),
            late=self._late.within(now), error=state.q - self.arm.q_true() if operating.is_homed else None,
        )  # fmt: skip
        notes = list(world.warnings())
        if now - self._said[0] < SAID:
            notes.insert(0, self._said[1])
        doing = f": {self.motion}" if operating.state == "ENABLED" and operating.is_homed else ""
        assumed = {"PD + gravity of a level base (SG)": LEVEL, "PD + sensed gravity (DG)": gravity}
        return view_state(
            snapshot, self._n, 1.0 / plant.period, feedback=state.tau if feedback is None else feedback, notes=notes,
            assumed=assumed.get(self.control), actual=world.actual(), mode=operating_in_words(operating) + doing,
            values=self._values,
        )  # fmt: skip

    # what somebody changes

    def _listen(self, *, in_loop: bool) -> None:
        if self._page is None:
            return
        for change in self._page.changes():
            try:
                self._take(change, in_loop=in_loop)
            except CatenaryError as error:
                self._say(str(error))
        if in_loop and (self._ended() or (self._page is not None and not self._page.is_running)):
            raise LeaveLoop

    def _take(self, change: Change, *, in_loop: bool) -> None:
        name, value = change
        if self.surroundings.set(name, value):
            return
        if name.startswith(around.GOTO):
            self._go_to(name.removeprefix(around.GOTO), float(value))
        elif name == "motion" and str(value) in around.MOTIONS:
            self._choose_motion(str(value))
        elif name == "controller" and str(value) in around.CONTROLLERS:
            self._choose_controller(str(value), in_loop=in_loop)
        elif name == "model" and self._corrector is not None:
            self._corrector.is_on = bool(value)
        elif name == "level" and str(value) in around.LEVELS:
            self._change_level(str(value), in_loop=in_loop)

    def _go_to(self, joint: str, value: float) -> None:
        """Go where the sliders are; value [deg|mm]."""
        j = self._plant.joint_names.index(joint)
        self._goal = self._goal.copy()
        goal = value / DISPLAY[self._plant.joint_units[j]][1]
        self._goal[j] = np.clip(goal, self._plant.lower[j], self._plant.upper[j])
        self._choose_motion(around.GO_TO)

    def _choose_motion(self, motion: str) -> None:
        plant, model = self._plant, self.arm.model
        recipes: dict[str, Callable[[], steering.Motion | None]] = {
            around.REST: lambda: None,
            around.GO_TO: lambda: lambda q: steering.quick_way(plant, q, np.clip(self._goal, plant.lower, plant.upper)),
            around.RANDOM: lambda: steering.random_motions(model, plant, self._rng),
            around.ZIGZAG: lambda: steering.zigzags(plant),
        }
        self._recipe = recipes[motion]()
        self.motion = motion
        self._values["motion"] = motion
        self._trajectory.follow(self._recipe)

    def _choose_controller(self, control: str, *, in_loop: bool) -> None:
        before, self.control = self.control, control
        if control != around.OWN:
            self._controller = self._controllers[around.CONTROLLERS[control]]
        self._values["controller"] = control
        if in_loop and around.OWN in (before, control) and before != control:
            raise LeaveLoop("resume")

    def _change_level(self, level: str, *, in_loop: bool) -> None:
        """Leave the loop, which pauses the arm, or reach the level at once."""
        then = {around.ENABLE: "resume", around.HOME: "home"}.get(level, "")
        if not in_loop:
            self._reach_level(then)
        elif then != "resume":
            raise LeaveLoop(then)

    def _reach_level(self, then: str) -> None:
        """Enable or home the arm; the robot decides."""
        state = self._plant.operating_state().state
        if then and state != "ENABLED":
            self._plant.state_command("resume" if state == "PAUSED" else "enable")
        if then == "home":
            self._plant.state_command("home")

    def _say(self, text: str) -> None:
        self._said = (time.perf_counter(), text)

    # setting up

    def _switched(self, loaded: CalibrationModel) -> steering.SwitchedCorrector:
        corrector = Corrector(loaded, rate_hz=1.0 / self._plant.period)
        whole = self.surroundings.plant
        corrector.prepare(whole.joint_names, whole.joint_units, 1.0 / self._plant.period)
        measured = (lambda _: whole.measured_js()) if isinstance(whole, CablePlant) else (lambda state: state)
        return steering.SwitchedCorrector(corrector, measured, self._n, self._plant.period)
