"""Steps and sustained acceleration, on the simulated RAVEN-II: what the gravity paper leaves to future work.

Lewis and Hannaford 2014, conclusion: step responses and perturbations under dynamic gravity compensation. Three events:

- reference: joint 1's reference goes 5 degrees in a third of a second, base at 20 degrees about Z0;
- tilt: the base turns from level to 10 degrees about Z0 within 0.5 s, the arm holding a pose;
- drive: the base accelerates by 2 m/s2 for 3 s, the arm holding a pose.

Sensed gravity comes from a simulated inertial unit of the MPU-6050's class (200 Hz, noise, latency), angular terms and
all; `attitude` is told the true attitude of the base and nothing of its acceleration, as from an ideal inclinometer.
Positions are those that the robot reports. Gains and damping are the robot's own. Run it with `make gravity-figures`;
it writes gravity_step.json and .html and prints the table.
"""

import sys
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from catenary import CablePlant, go_to, run_loop
from catenary.arrays import Floats
from catenary.control.loop import GravitySource, Tick
from catenary.reports.page import Block, Picture, Table, Text, picture
from catenary.sensing.faults import Fault
from catenary.sensing.imu import SensedGravity
from catenary.sensing.mailbox import Mailbox
from catenary.sensing.vector import GravityReading, ReadingStatus
from catenary.simulation.base_motion import BaseSamples, MovingBase
from catenary.simulation.sensors import SimulatedSensor
from catenary.spatial import LEVEL
from catenary.trajectories.in_turn import InTurn, Rest
from catenary.trajectories.reference import Trajectory
from catenary.workflows.gravity.controllers import make_controller
from catenary.workflows.gravity.motions import RAVEN_START
from catenary.workflows.gravity.simulated_arm import raven_arm
from catenary.workflows.gravity.track import with_approach
from papers.arguments import folder_argument
from papers.figures import COLORS, LABELS, panels
from papers.gravity.raven_base import Z0, turned_base
from papers.results import shown, write_results

Event = Literal["reference", "tilt", "drive"]
EVENTS: tuple[Event, ...] = get_args(Event)
CONTROLLERS = ("pd", "sg", "dg", "attitude")
TITLES: dict[Event, str] = {
    "reference": "reference steps by 5 deg",
    "tilt": "base turns by 10 deg",
    "drive": "base drives off at 2 m/s2",
}
STEP_DEG, STEP_BASE_DEG = 5.0, 20.0
# [rad/s, rad/s2] slow enough for the drive
STEP_VELOCITY, STEP_ACCELERATION = np.full(3, 0.5), np.full(3, 5.0)
TILT_DEG, TILT_SECONDS = 10.0, 0.5
ACCELERATION, DRIVE_SECONDS, ONSET = 2.0, 3.0, 0.2  # [m/s2], [s], [s] in which it comes and goes
WARM = 1.2  # [s] at the pose before the event, in which the sensor is met
WATCHED: dict[Event, float] = {"reference": 1.5, "tilt": 1.5, "drive": DRIVE_SECONDS}  # [s] from the event on
ALONG = np.array([1.0, 0.0, 0.0])  # of the base, where it drives to


class CuedBase:
    """A base that stands level until a time, and then turns to a new attitude, or drives off.

    Quintics lead from one attitude, or acceleration, to the next.
    """

    def __init__(
        self, *, turn: float = 0.0, turn_time: float = 0.5, acceleration: float = 0.0, onset: float = ONSET
    ) -> None:
        """Take what happens.

        Args:
            turn: About Z0 [rad].
            turn_time: In which it turns [s].
            acceleration: Along ALONG, for DRIVE_SECONDS [m/s2].
            onset: In which that comes, and goes [s].
        """
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


class TrueAttitude:
    """Gravity along the true vertical, without the base's acceleration or turning; a GravitySource."""

    def __init__(self, base: MovingBase) -> None:
        """Take the base."""
        self._base = base

    def read(self, time: float) -> GravityReading:
        """Return gravity at a time [s]."""
        gravity = self._base.sample(np.array([time])).gravity[0]
        return GravityReading(gravity, 0.0, np.zeros((2, 3)), ReadingStatus.LIVE, Fault.NONE)


class Response(NamedTuple):
    """What joint 1 did; errors are desired minus reported, over those just before the event [deg]."""

    event: Event
    controller: str
    before: float  # error just before the event [deg]
    rise_time: float  # [s] from 10 to 90 % of the step of the reference; NaN where that stands still
    overshoot: float  # [deg] beyond the end of the step; NaN likewise
    largest: float  # change of the error [deg], at most, whatever its sign
    final: float  # change of the error in the mean of the last 0.2 s [deg]
    last_error: float  # error in the mean of the last 0.2 s [deg]
    time: tuple[float, ...]  # [s] since the event, for the picture
    error: tuple[float, ...]  # [deg]
    moved: tuple[float, ...]  # of the reported joint since the event [deg]


def homed(event: Event, *, seed: int | None = None) -> CablePlant:
    """Return a robot, homed on the base of the event before the event begins."""
    base: MovingBase
    if event == "reference":
        base = turned_base(STEP_BASE_DEG)
    elif event == "tilt":
        base = CuedBase(turn=float(np.deg2rad(TILT_DEG)), turn_time=TILT_SECONDS)
    else:
        base = CuedBase(acceleration=ACCELERATION)
    plant = CablePlant(seed=seed, base=base)
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
    time, wanted, reached = np.array(rows).T
    return _measure(event, name, time, wanted, reached)


def _event_motion(begin: Floats, end: Floats, seconds: float) -> list[Trajectory]:
    if np.array_equal(begin, end):
        return [Rest(begin, seconds)]
    step = go_to(begin, end, max_velocity=STEP_VELOCITY, max_acceleration=STEP_ACCELERATION)
    return [step, Rest(end, seconds - step.duration)]


def _measure(event: Event, name: str, time: Floats, wanted: Floats, reached: Floats) -> Response:
    error = np.rad2deg(wanted - reached)
    after = time >= 0.0
    before = float(error[(time >= -0.1) & ~after].mean())
    change = error[after] - before
    last = float(error[time >= time[-1] - 0.2].mean())
    rise = over = float("nan")
    if event == "reference":
        share = np.rad2deg(reached[after] - reached[~after][-1]) / STEP_DEG
        rise = float(time[after][np.argmax(share >= 0.9)] - time[after][np.argmax(share >= 0.1)])
        over = max(0.0, float(np.rad2deg(reached[after].max() - wanted[-1])))
    return Response(
        event,
        name,
        before,
        rise,
        over,
        float(change[np.abs(change).argmax()]),
        last - before,
        last,
        tuple(time[after][::10].tolist()),
        tuple(error[after][::10].tolist()),
        tuple(np.rad2deg(reached[after] - reached[~after][-1])[::10].tolist()),
    )


def _quintic(x: Floats) -> Floats:
    rise: Floats = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    return rise


def step_table(rows: Sequence[Response]) -> Table:
    """Return how joint 1 follows the step of its reference, by controller."""
    return Table(
        ["controller", "error before [deg]", "10 to 90 % [s]", "overshoot [deg]", "error at the end [deg]"],
        [
            [
                LABELS[row.controller],
                f"{row.before:+.3f}",
                f"{row.rise_time:.3f}",
                f"{row.overshoot:.3f}",
                f"{row.last_error:+.3f}",
            ]
            for row in rows
        ],
    )


def base_table(rows: Sequence[Response]) -> Table:
    """Return by how much joint 1's error changes when its base moves, by controller."""
    return Table(
        ["event", "controller", "error before [deg]", "largest change [deg]", "final change [deg]"],
        [
            [
                TITLES[row.event],
                LABELS[row.controller],
                f"{row.before:+.3f}",
                f"{row.largest:+.3f}",
                f"{row.final:+.3f}",
            ]
            for row in rows
        ],
    )


def figure(rows: Sequence[Response]) -> Picture:
    """Draw joint 1 over time for each event: its motion in the step, its error where the base moves."""
    events: list[Event] = list(dict.fromkeys(row.event for row in rows))
    drawn, parts = panels(len(events), 3.6)
    labelled: dict[str, Any] = {}
    for axes, event in zip(parts, events, strict=True):
        of = [row for row in rows if row.event == event]
        for row in of:
            # PD+SG and the true attitude's term are the same on a level base
            style = "--" if row.controller == "attitude" else "-"
            line = row.moved if event == "reference" else row.error
            labelled[LABELS[row.controller]] = axes.plot(
                row.time, line, style, color=COLORS[row.controller], lw=1.2
            )[0]
        if event == "reference":
            wanted = np.array(of[0].error) + of[0].moved
            labelled["reference"] = axes.plot(of[0].time, wanted - wanted[0], ":", color="#7a8699", lw=1.2)[0]
        axes.set_title(TITLES[event], fontsize=10)
        axes.set_ylabel("joint 1 moved [deg]" if event == "reference" else "error of joint 1 [deg]")
        axes.set_xlabel("time since it began [s]")
    drawn.legend(
        labelled.values(),
        labelled.keys(),
        frameon=False,
        fontsize=8,
        ncols=len(labelled),
        loc="outside lower center",
    )
    return picture(drawn, "Positions as reported; errors are desired minus reported.")


def main(
    folder: Path, events: Sequence[Event] = EVENTS, controllers: Sequence[str] = CONTROLLERS
) -> list[Response]:
    """Run every event with every controller, print the table, write gravity_step.json and .html."""
    rows = []
    for event in events:
        plant = homed(event)
        # tilt alone is another vector than the sensor's only where the base accelerates
        names = [name for name in controllers if name != "attitude" or event == "drive"]
        rows += [respond(plant, event, name) for name in names]
        print(f"  {event}: done", file=sys.stderr, flush=True)
    blocks: list[Block] = [figure(rows)]
    steps = [row for row in rows if row.event == "reference"]
    bases = [row for row in rows if row.event != "reference"]
    if steps:
        blocks += shown("Step of joint 1's reference", step_table(steps))
    if bases:
        blocks += shown("Joint 1 while its base moves", base_table(bases))
    blocks.append(
        Text(
            f"reference: {STEP_DEG:g} deg on joint 1, base at {STEP_BASE_DEG:g} deg. tilt: base from 0 to "
            f"{TILT_DEG:g} deg about Z0 within {TILT_SECONDS:g} s. drive: {ACCELERATION:g} m/s2 along x for "
            f"{DRIVE_SECONDS:g} s. Changes are against just before the event."
        )
    )
    write_results(
        folder,
        "gravity_step",
        "Steps and sustained acceleration, simulated",
        "Step of the reference, step of the base's tilt, and a base that drives off; PD, PD+SG and PD+DG.",
        blocks,
        configuration={
            "robot": "nominal",
            "pose": list(RAVEN_START),
            "events": list(events),
            "controllers": list(controllers),
            "step_deg": STEP_DEG,
            "step_base_deg": STEP_BASE_DEG,
            "tilt_deg": TILT_DEG,
            "tilt_seconds": TILT_SECONDS,
            "acceleration_m_s2": ACCELERATION,
            "drive_seconds": DRIVE_SECONDS,
            "sensor_seed": 1,
        },
        results=[row._asdict() for row in rows],
    )
    return rows


if __name__ == "__main__":
    main(folder_argument(__doc__))
