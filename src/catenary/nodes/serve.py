"""Serve a simulated robot to other programs, in real time, until somebody ends it."""

import gc
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.control.realtime import RealTime
from catenary.crtk.dialects import DIALECTS
from catenary.crtk.reader import NeverMoved
from catenary.crtk.serving.reports import Reports
from catenary.crtk.serving.served_arm import ServedArm
from catenary.crtk.serving.server import ServedEncoders, Server
from catenary.crtk.serving.tool_pose import ToolPose
from catenary.crtk.topic_names import console_topics, crtk_topics
from catenary.crtk.transport import Transport
from catenary.dvrk_psm import psm_topic
from catenary.dynamics.robot_kernels import gravity_kernel
from catenary.errors import InputError
from catenary.open_robot import KINDS, PSM, RobotKind, Simulated, open_robot, refuse_unsupported, spoken_dialect
from catenary.plant import JointState, OperatingState, Plant
from catenary.raven2.topics import EXT_JPOS, JOINT_ENC, ROBOT
from catenary.robots.catalog import load_robot
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.psm_controller import joints_per_actuator, load_psm
from catenary.simulation.psm_plant import PsmPlant
from catenary.spatial import LEVEL
from catenary.trajectories.smoothed_path import go_to

_CATCH_UP_S = 0.02  # [s] of lateness that is made up for by ticks without a pause; the rest is given up
_SERVED_ROBOTS = ("raven2", *(name for name, kind in KINDS.items() if kind.dvrk))


@dataclass(frozen=True)
class Serving:
    """Settings of a served robot."""

    robot: str = "raven2"  # or an arm of a dVRK, which speaks crtk
    dialect: str = "raven"
    simulated: Simulated = field(default_factory=lambda: Simulated(homed=False))  # the robot that is served
    with_green: bool = False  # a green arm that moves, in place of a parked one
    with_encoders: bool = True  # publish a RAVEN-II's external encoders, in its dialect, or a PSM's tracker
    namespace: str | None = None  # of a dVRK's arm; its own when None

    def __post_init__(self) -> None:
        if self.robot not in _SERVED_ROBOTS:
            raise InputError(
                f'robot "{self.robot}": expected one of {", ".join(_SERVED_ROBOTS)}, the robots that can be served'
            )
        spoken_dialect(self.robot, self.dialect)
        refuse_unsupported(self.robot, self.simulated)
        if self.kind.dvrk:
            if self.with_green:
                raise InputError(f"robot {self.robot}: has no green arm, which is a RAVEN-II's")
            self.kind.place(self.namespace)  # refuses that of another arm

    @property
    def kind(self) -> RobotKind:
        """Kind of the served robot."""
        return KINDS[self.robot]


class ServerStatus(NamedTuple):
    """Status of the server over the last second, or over its whole run."""

    seconds: float  # since it began
    rate_hz: float  # ticks
    cpu: float  # cores
    states: dict[str, str]  # by arm
    commands_hz: float
    clients: int  # programs that listen or command
    lost_ticks: int  # given up since it began, because the machine was late
    overflowed: int  # messages that slow clients missed since it began
    missed: dict[str, int]  # the same by client
    is_up: bool  # whether the transport's network answers
    warnings: tuple[str, ...]
    ended_by: str = ""  # of the last one: the signal's name, or Ctrl-C; empty when its time was over


def make_server(
    serving: Serving, transport: Transport, *, rate_hz: float = 1000.0, plants: dict[str, Plant] | None = None
) -> Server:
    """Serve a robot over a transport; nothing moves before the server's ticks.

    Args:
        rate_hz: Rate of states: the robot's own divided by a whole number [Hz].
        plants: Robots in place of simulated arms, by name.
    """
    reports = Reports()
    plants = _plants(serving) if plants is None else plants
    arms = {name: _served(name, plant, serving, reports) for name, plant in plants.items()}
    is_raven, listed, is_psm = DIALECTS[serving.dialect].has_run_levels, None, serving.kind is PSM
    if serving.kind.dvrk:
        place = serving.kind.place(serving.namespace)
        listed = (*crtk_topics(next(iter(arms)), place), *console_topics(place))
    speaker = DIALECTS[serving.dialect].serve(arms, listed)
    period = max(arm.plant.period for arm in arms.values())
    every = round(1.0 / (rate_hz * period)) if rate_hz > 0.0 else 0
    if every < 1 or abs(every * rate_hz * period - 1.0) > 0.01:
        raise InputError(f"rate: expected the robot's {1.0 / period:g} Hz divided by a whole number, got {rate_hz:g}")
    measured = (psm_topic(place, "tracker/measured_js"),) if is_psm else (JOINT_ENC, EXT_JPOS)
    plant = next(iter(plants.values()))  # the gold arm, or a dVRK's
    columns = {column.name for column in plant.columns if serving.with_encoders and (is_raven or is_psm)}
    has_all = columns >= {topic.columns[0].name for topic in measured}
    encoders = ServedEncoders(transport, plant, measured) if has_all else None
    return Server(transport, arms, speaker, reports, button=is_raven, publish_every=every, encoders=encoders)


def _plants(serving: Serving) -> dict[str, Plant]:
    where = serving.simulated

    def opened(robot: str) -> Plant:
        plant = open_robot(robot, where)
        if where.homed:
            plant.state_command("pause" if DIALECTS[serving.dialect].has_run_levels else "disable")
        return plant

    if serving.kind.dvrk:
        return {serving.kind.place(serving.namespace)[1:]: opened(serving.robot)}
    gold = opened("raven2")
    if serving.with_green:
        return {"gold": gold, "green": opened("raven2_right")}
    home = cast(CablePlant, gold).firmware.home_value
    return {"gold": gold, "green": ParkedArm(gold.joint_names, gold.joint_units, home, period=gold.period)}


def _served(name: str, plant: Plant, serving: Serving, reports: Reports) -> ServedArm:
    kind = serving.kind if serving.kind.dvrk else KINDS[ROBOT[name]]
    tool = ToolPose(load_robot(kind.whole), plant.joint_names)
    # a RAVEN-II's positioning joints alone are held against gravity; a load at the tool is unknown to it
    model = load_psm().loaded_model() if kind is PSM else load_robot(kind.robot, massless="all" if kind.dvrk else ())
    kernel, others = gravity_kernel(model), np.zeros(len(plant.joint_names) - model.n)
    return ServedArm(
        plant, serving.dialect, reports, arm=name, tool=tool,
        gravity_torque=lambda q, gravity: np.append(kernel(q[: model.n], gravity), others),
        dvrk=kind.dvrk, joints_per_actuator=_joints_per_actuator(kind, plant),
    )  # fmt: skip


def _joints_per_actuator(kind: RobotKind, plant: Plant) -> Floats | None:
    """Return the matrix (n, n) from a dVRK's actuators to its joints."""
    if kind is PSM:
        return joints_per_actuator(cast(PsmPlant, plant).firmware)
    coupling = np.eye(len(plant.joint_names))
    if kind.dvrk == "MTM":  # its parallelogram [share/kinematic/MTMR.json]
        coupling[2, 1], coupling[3, 1], coupling[3, 2] = -1.0, 0.6697, -0.6697
    return coupling if kind.dvrk else None


def prepare_server(server: Server) -> None:
    """Compile what is compiled on first use: half a minute, the first time on a machine."""
    server.tick()
    for arm in server.arms.values():
        arm.tool.prepare()
        rest, unit = np.zeros(len(arm.setpoint.q)), np.ones(len(arm.setpoint.q))
        go_to(rest, unit, max_velocity=unit, max_acceleration=unit)(0.0)


def serve(
    server: Server, *, show: Callable[[ServerStatus], None], start: bool = False, duration: float | None = None
) -> ServerStatus:
    """Run a server at its robot's rate, then pause the arms and sum up.

    Late ticks are caught up within 20 ms; later ones are dropped and counted, so that after a stall nothing runs faster
    than it should for long.

    Args:
        show: Called with a status every second.
        start: Whether to press the silver button first, or to enable and home the arms of a robot without one.
        duration: Time [s]; until Ctrl-C when None.
    """
    period = max(arm.plant.period for arm in server.arms.values())
    prepare_server(server)
    server.require_alone()
    settled = RealTime(period)
    settled.begin()
    clock = time.perf_counter

    def counted() -> Floats:
        """Return time [s], time of the processor [s], ticks and commands until now."""
        return np.array([clock(), time.process_time(), server.ticks, server.commands])

    begin = last = counted()
    deadline, lost = float(begin[0]), 0
    ended_by = ""
    if start:
        server.start()

    def status(since: Floats, now: Floats) -> ServerStatus:
        missed, (took, cpu, ticks, commands) = server.missed, (now - since).tolist()
        took = max(took, 1e-9)
        return ServerStatus(
            seconds=float(now[0] - begin[0]),
            rate_hz=ticks / took,
            cpu=cpu / took,
            states={name: _state_text(arm) for name, arm in server.arms.items()},
            commands_hz=commands / took,
            clients=len(server.clients()),
            lost_ticks=lost,
            overflowed=sum(missed.values()),
            missed=missed,
            is_up=server.transport.is_up(),
            warnings=tuple(server.reports.take()),
        )

    try:
        while duration is None or clock() - begin[0] < duration:
            server.tick(late=min(max(0.0, clock() - deadline), _CATCH_UP_S))
            deadline += period
            now = clock()
            if now - last[0] >= 1.0:
                before, last = last, counted()
                show(status(before, last))
                gc.collect(0)  # the loop runs without the collector; what rospy leaves behind is little
                now = clock()
            if deadline > now:
                time.sleep(deadline - now)
            elif now - deadline > _CATCH_UP_S:
                skipped = int((now - deadline) / period)
                lost += skipped
                deadline += skipped * period
    except KeyboardInterrupt as stop:  # how a server is ended; of a signal it is the name
        ended_by = str(stop) or "Ctrl-C"
    finally:
        settled.end()
        for arm in server.arms.values():
            arm.hold()
            if arm.machine.can_change:
                arm.machine.command("pause")
                arm.advance()
        server.say_states()
    return status(begin, counted())._replace(ended_by=ended_by)


def _state_text(arm: ServedArm) -> str:
    state = arm.state
    if not arm.machine.can_change:
        return "parked"
    words = [state.state, "homed" if state.is_homed else "not homed"]
    return " ".join([*words, "busy"] if state.is_busy else words)


class ParkedArm(NeverMoved):
    """A `Plant` that is DISABLED for good, in the place of an arm that a robot has but nobody uses."""

    why_not = "the arm is parked"
    simulated = True

    def __init__(
        self, joint_names: tuple[str, ...], joint_units: tuple[str, ...], q: ArrayLike, *, period: float = 1e-3
    ) -> None:
        """Park an arm at joints q (n,) [rad|m]."""
        self.joint_names, self.joint_units, self.period = joint_names, joint_units, period
        n = len(joint_names)
        place = as_array("q", q, (n,))
        self.lower, self.upper = place.copy(), place.copy()
        zeros = np.zeros(n)
        self._state = JointState(0.0, place, zeros, zeros, np.zeros(0), LEVEL.copy(), np.inf)

    def measured_js(self) -> JointState:
        """Where it stands."""
        state = self._state
        return state._replace(q=state.q.copy(), qd=state.qd.copy(), tau=state.tau.copy())

    setpoint_js = measured_js

    def operating_state(self) -> OperatingState:
        """Disabled."""
        return OperatingState("DISABLED", False, False)

    def wait(self) -> None:
        """Stand."""
