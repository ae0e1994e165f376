"""Steps of the reference and of the base: what the gravity paper leaves to future work.

Lewis and Hannaford 2014, section VII: "The step-response of the PD+DG controller under these conditions would provide
an interesting study": perturbations of the base, sustained accelerations. It claims nothing of them. Three events,
the arm holding a pose:

- reference: joint 1's reference goes 5 degrees in a third of a second, base at 20 degrees about Z0;
- tilt: the base turns from level to 10 degrees about Z0 within 0.5 s;
- drive: the base accelerates by 2 m/s2 for 3 s.

Sensed gravity comes from a simulated inertial unit of the MPU-6050's class (200 Hz, noise, latency), angular terms and
all; `attitude` is told the true attitude of the base and nothing of its acceleration, as from an ideal inclinometer.

Errors are desired minus reported position; changes are against just before the event.
"""

from collections.abc import Sequence
from copy import deepcopy
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from catenary import CablePlant, go_to, run_loop
from catenary.arrays import Floats
from catenary.control.controllers import make_controller
from catenary.control.loop import GravitySource, Tick
from catenary.sensing.gravity_vector import Mailbox
from catenary.sensing.imu import SensedGravity
from catenary.simulation.base_motion import BaseSamples, MovingBase
from catenary.simulation.sensors import SimulatedSensor
from catenary.spatial import LEVEL
from catenary.trajectories.reference import InTurn, Rest, Trajectory
from catenary.workflows.gravity_trials import RAVEN_START, raven_arm, with_approach
from papers.experiment import Case, Experiment, Outcomes, Plain, Report, Result, Scope, run
from papers.figures import COLORS, LABELS, panels
from papers.gravity.raven_base import Z0, TrueAttitude, raven_of_2014, turned_base
from papers.kit import filled, grid, mean_and_spread, rows, sample, table

Event = Literal["reference", "tilt", "drive"]
EVENTS: tuple[Event, ...] = get_args(Event)
STEP_DEG, STEP_BASE_DEG = 5.0, 20.0
# [rad/s, rad/s2] slow enough for the drive
STEP_VELOCITY, STEP_ACCELERATION = np.full(3, 0.5), np.full(3, 5.0)
TILT_DEG, TILT_SECONDS = 10.0, 0.5
ACCELERATION, DRIVE_SECONDS, ONSET = 2.0, 3.0, 0.2  # [m/s2], [s], [s] in which it comes and goes
WARM = 1.2  # [s] at the pose before the event, in which the sensor is met
WATCHED: dict[Event, float] = {"reference": 1.5, "tilt": 1.5, "drive": DRIVE_SECONDS}  # [s] from the event on
ALONG = np.array([1.0, 0.0, 0.0])  # of the base, where it drives to
EVERY = 10  # ticks of a picture's line
CONTROLLERS = ("pd", "sg", "dg", "attitude")
TITLES: dict[Event, str] = {
    "reference": f"reference steps by {STEP_DEG:g} deg",
    "tilt": f"base turns by {TILT_DEG:g} deg",
    "drive": f"base drives off at {ACCELERATION:g} m/s2",
}


class CuedBase:
    """A base that stands level until a time, and then turns to a new attitude, or drives off.

    Quintics lead from one attitude, or acceleration, to the next.
    """

    def __init__(
        self, *, turn: float = 0.0, turn_time: float = 0.5, acceleration: float = 0.0, onset: float = ONSET
    ) -> None:
        """Take how far it turns about Z0 [rad], in [s]; an acceleration [m/s2] that comes and goes in `onset` [s]."""
        self.turn, self.turn_time, self.acceleration, self.onset = turn, turn_time, acceleration, onset
        self.begin = np.inf  # [s] on the plant's clock; set it a second ahead, for what is sampled is kept

    def sample(self, times: Floats) -> BaseSamples:
        """Return the base's motion at times (N,) [s]."""
        since = np.maximum(np.asarray(times, dtype=float) - min(self.begin, 1e9), 0.0)
        x = np.minimum(since / self.turn_time, 1.0)
        angle = self.turn * _quintic(x)
        rate = self.turn * 30.0 * x**2 * (1.0 - x) ** 2 / self.turn_time
        change = self.turn * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / self.turn_time**2
        # Rodrigues: gravity is perpendicular to Z0; turning axes by an angle turns what stands still back
        gravity = np.cos(angle)[:, None] * LEVEL - np.sin(angle)[:, None] * np.cross(Z0, LEVEL)
        push = _quintic(np.minimum(since / self.onset, 1.0)) - _quintic(
            np.clip((since - DRIVE_SECONDS) / self.onset, 0.0, 1.0)
        )
        linear = self.acceleration * push[:, None] * ALONG
        return BaseSamples(gravity, np.stack([rate[:, None] * Z0, change[:, None] * Z0, linear], axis=1))


class Response(NamedTuple):
    """What joint 1 did; errors are desired minus reported."""

    before: float  # error just before the event [deg]
    rise_time: float | None  # [s] from 10 to 90 % of the step of the reference; None where that stands still
    overshoot: float | None  # [deg] beyond the end of the step; None likewise
    largest: float  # change of the error [deg] against before, at most, whatever its sign
    final: float  # the same in the mean of the last 0.2 s [deg]
    last_error: float  # error in the mean of the last 0.2 s [deg]
    time: list[float]  # [s] since the event, for the picture
    error: list[float]  # [deg]
    moved: list[float]  # of the reported joint since the event [deg]

    def plain(self) -> dict[str, Plain]:
        """Return it by name, as a case does."""
        return self._asdict()


def homed(event: Event, *, seed: int | None = None) -> CablePlant:
    """Return a robot, homed on the base of the event before the event begins."""
    base: MovingBase
    if event == "reference":
        base = turned_base(STEP_BASE_DEG)
    elif event == "tilt":
        base = CuedBase(turn=float(np.deg2rad(TILT_DEG)), turn_time=TILT_SECONDS)
    else:
        base = CuedBase(acceleration=ACCELERATION)
    plant = CablePlant(raven_of_2014(), seed=seed, base=base)
    plant.home()
    return plant


def respond(plant: CablePlant, event: Event, name: str) -> Response:
    """Hold a pose with a controller, let the event happen, and see what joint 1 does."""
    plant = deepcopy(plant)
    arm = raven_arm(plant)
    controller = make_controller("dg" if name == "attitude" else name, arm)
    begin = np.array(RAVEN_START)
    way, _ = with_approach(arm, Rest(begin, 0.0), 0.0)
    run_loop(arm.plant, make_controller("dg", arm), way, limits=arm.limits())
    cue = plant.time + WARM
    if isinstance(plant.base, CuedBase):
        plant.base.begin = cue
    source: GravitySource
    if name == "attitude":
        source = TrueAttitude(plant.base)
    else:
        mailbox = Mailbox()
        sensor = SimulatedSensor(plant.base, mailbox, seed=1, start=plant.time)
        source = SensedGravity(mailbox, sensor.model.mounting, feed=sensor.advance)
    end = begin + (np.deg2rad([STEP_DEG, 0.0, 0.0]) if event == "reference" else 0.0)
    motion: Trajectory = InTurn([Rest(begin, WARM), *_event_motion(begin, end, WATCHED[event])])
    rows: list[tuple[float, float, float]] = []

    def observe(tick: Tick) -> None:
        rows.append((tick.time - WARM, tick.reference.q[0], tick.state.q[0]))

    run_loop(arm.plant, controller, motion, limits=arm.limits(), gravity=source, observers=[observe])
    time, reference, reached = np.array(rows).T
    return _measure(event, time, reference, reached)


def _event_motion(begin: Floats, end: Floats, seconds: float) -> list[Trajectory]:
    if np.array_equal(begin, end):
        return [Rest(begin, seconds)]
    step = go_to(begin, end, max_velocity=STEP_VELOCITY, max_acceleration=STEP_ACCELERATION)
    return [step, Rest(end, seconds - step.duration)]


def _measure(event: Event, time: Floats, reference: Floats, reached: Floats) -> Response:
    error = np.rad2deg(reference - reached)
    after = time >= 0.0
    before = float(error[(time >= -0.1) & ~after].mean())
    change = error[after] - before
    last = float(error[time >= time[-1] - 0.2].mean())
    rise = over = None
    if event == "reference":
        share = np.rad2deg(reached[after] - reached[~after][-1]) / STEP_DEG
        rise = float(time[after][np.argmax(share >= 0.9)] - time[after][np.argmax(share >= 0.1)])
        over = max(0.0, float(np.rad2deg(reached[after].max() - reference[-1])))
    return Response(
        before,
        rise,
        over,
        float(change[np.abs(change).argmax()]),
        last - before,
        last,
        _line(time[after]),
        _line(error[after]),
        _line(np.rad2deg(reached[after] - reached[~after][-1])),
    )


def _line(values: Floats) -> list[float]:
    return [round(float(value), 5) for value in values[::EVERY]]


def _quintic(x: Floats) -> Floats:
    rise: Floats = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    return rise


@run(revision=1)
def responses(*, seed: int | None, event: Event) -> Result:
    """Let an event happen to a robot under each controller; return joint 1's response to it by controller."""
    plant = homed(event, seed=seed)
    # tilt alone is another vector than the sensor's only where the base accelerates
    names = [name for name in CONTROLLERS if name != "attitude" or event == "drive"]
    return {name: respond(plant, event, name).plain() for name in names}


def cases(scope: Scope) -> list[Case]:
    """Return a case per robot and event."""
    events: tuple[Event, ...] = ("tilt",) if scope.quick else EVENTS
    return grid(responses, {"seed": scope.robots, "event": events})


def report(o: Outcomes) -> Report:
    """Return how joint 1 follows the step of its reference, and what its base's motion does to it."""

    def row(event: Event, name: str, numbers: Sequence[str]) -> list[str]:
        return [mean_and_spread(each) for each in (sample(o, responses, name, n, event=event) for n in numbers)]

    def step(name: str) -> list[str]:
        return [LABELS[name], *row("reference", name, ("before", "rise_time", "overshoot", "last_error"))]

    def of_base(event: Event, name: str) -> list[str]:
        return [f"{TITLES[event]}, {LABELS[name]}", *row(event, name, ("before", "largest", "final"))]

    tables = [
        table(
            f"Step of joint 1's reference by {STEP_DEG:g} deg, base at {STEP_BASE_DEG:g} deg",
            "controller | error before [deg] | 10 to 90 % [s] | overshoot [deg] | error at the end [deg]",
            rows(step, CONTROLLERS),
        ),
        table(
            f"Joint 1 while its base turns from 0 to {TILT_DEG:g} deg in {TILT_SECONDS:g} s, or accelerates by "
            f"{ACCELERATION:g} m/s2 along x",
            "event, controller | error before [deg] | largest change [deg] | final change [deg]",
            rows(of_base, EVENTS[1:], CONTROLLERS),
        ),
    ]
    caption = "Joint 1, nominal robot: its motion in the step, its error where the base moves"
    return Report(filled(tables), {caption: _picture(o)})


def _picture(o: Outcomes) -> Any:
    by_event = {event: results[0] for event in EVENTS if (results := o.of(responses, event=event))}
    figure, parts = panels(max(len(by_event), 1), 3.6)
    labelled: dict[str, Any] = {}
    for axes, (event, by_name) in zip(parts, by_event.items(), strict=False):
        for name, row in by_name.items():
            # PD+SG and the true attitude's term are the same on a level base
            style = "--" if name == "attitude" else "-"
            line = row["moved" if event == "reference" else "error"]
            labelled[LABELS[name]] = axes.plot(row["time"], line, style, color=COLORS[name], lw=1.2)[0]
        if event == "reference":
            one = next(iter(by_name.values()))
            reference = np.array(one["error"]) + one["moved"]
            labelled["reference"] = axes.plot(one["time"], reference - reference[0], ":", color="#7a8699", lw=1.2)[0]
        axes.set_title(TITLES[event], fontsize=10)
        axes.set_ylabel("joint 1 moved [deg]" if event == "reference" else "error of joint 1 [deg]")
        axes.set_xlabel("time since it began [s]")
    form: dict[str, Any] = {
        "frameon": False,
        "fontsize": 8,
        "ncols": max(len(labelled), 1),
        "loc": "outside lower center",
    }
    figure.legend(labelled.values(), labelled.keys(), **form)
    return figure


EXPERIMENT = Experiment(
    "gravity-steps", "section VII", "Steps of the reference and of the base", __doc__, cases, report, minutes=3.0
)
