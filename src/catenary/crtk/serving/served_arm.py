"""One arm of a CRTK server: turns clients' moves, servo steps and torques into one command per tick for its plant."""

from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple, cast

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.crtk.serving.master_arm import MasterArm
from catenary.crtk.serving.reports import Reports
from catenary.crtk.serving.state_machine import StateMachine
from catenary.crtk.serving.tool_pose import ToolPose, ToolState
from catenary.errors import CatenaryError, InputError, LimitError, UnreachablePoseError
from catenary.plant import JointState, OperatingState, Plant
from catenary.spatial import Pose, rotation_from_vector, rotation_vector
from catenary.trajectories.reference import Trajectory
from catenary.trajectories.smoothed_path import go_to

# largest number of messages added up per tick; more than two clients send at 1 kHz, so that a backlog shrinks
_INCREMENTS_A_TICK = 4
_BACKLOG_S = 0.25  # [s] longest wait of an increment
_FOLLOW_S = 0.1  # [s] watchdog: time after the last command in which a goal, velocity or torque acts
BASE_FRAME = "base"  # frame of all poses
_SETPOINT_SPEED = {"rad": 2.5, "m": 0.05}  # [rad/s], [m/s] largest of a setpoint: 0.0025 rad, 0.05 mm per millisecond
_LEAST_BUSY_S = 0.05  # [s] CRTK's Python client waits for a busy state and its end, even of a move of zero length
GravityTorque = Callable[[Floats, Floats], Floats]  # joints (n,), gravity (3,) -> torques (n,)


class ArmSettings:
    """Settings of an arm by clients, such as the base frame in which they give and receive tool poses."""

    def __init__(self) -> None:
        self.compensates_gravity = False
        self.forces_in_base_axes = False  # wrenches below body/ are in base axes
        self.speed_ratio = self.acceleration_ratio = 1.0  # scale of moves
        self.base: Pose | None = None  # of the arm's base in frame `base_name`; None if identical
        self.base_name = BASE_FRAME

    def placed(self, pose: Pose) -> Pose:
        """Convert a pose from the arm's base to the clients' frame."""
        return pose if self.base is None else self.base @ pose

    def unplaced(self, pose: Pose) -> Pose:
        """Convert a client's pose to the arm's base."""
        return pose if self.base is None else self.base.inverse() @ pose

    def turned(self, vector: Floats) -> Floats:
        """Convert vectors (..., 3) from the arm's base to the clients' axes."""
        return vector if self.base is None else vector @ self.base.rotation.T

    def unturned(self, vector: Floats) -> Floats:
        """Convert a client's vectors (..., 3) to the axes of the arm's base."""
        return vector if self.base is None else vector @ self.base.rotation


class _Push(NamedTuple):
    torques: Callable[[], Floats]  # (n,) of this tick, NaN for a joint that holds its setpoint
    until: float  # tick at which they expire


class ServedArm:
    """An arm, its state machine and its current command: a new command replaces the last, only increments add up."""

    def __init__(
        self,
        plant: Plant,
        dialect: str,
        reports: Reports,
        *,
        arm: str,
        tool: ToolPose,
        gravity_torque: GravityTorque,
        dvrk: str = "",
        joints_per_actuator: Floats | None = None,
    ) -> None:
        """Serve a plant whose weight `gravity_torque` holds; `dvrk` is one of DVRK_ARMS, with `joints_per_actuator`."""
        self.plant, self.arm, self.tool, self.gravity_torque = plant, arm, tool, gravity_torque
        self.reports, self.dvrk, self.joints_per_actuator = reports, dvrk, joints_per_actuator
        self.master = MasterArm() if dvrk == "MTM" else None
        self.names = plant.joint_names
        self.reported = self.names[:-1] if tool.jaw_is_apart else self.names  # joints of its joint states
        self.machine = StateMachine(plant, dialect)
        self.lower, self.upper = plant.lower, plant.upper
        self.place = ""  # namespace of the commands
        self.most = plant.period * np.array([_SETPOINT_SPEED[unit] for unit in plant.joint_units])
        self._increments: deque[tuple[Floats, int]] = deque()  # waiting (n,), and their ticks of arrival
        self._goal: Floats | None = None  # (n,) approached by clamped steps
        self._pace = self.most  # (n,) largest step to the goal
        self._steps = 0  # steps left to the goal: one per message, or for the watchdog's time
        self._follow_ticks = max(1, round(_FOLLOW_S / plant.period))
        self.settings = ArmSettings()
        self.moves_ended = 0, False  # number, and whether the last one reached its goal
        self._before: tuple[Floats, bool] | None = None  # setpoint of the last tick, whether the arm was ready
        self.tick = 0
        self.reports_time = 0  # [ns] stamp of reports in this tick
        self.statistics: tuple[float, ...] | None = None  # of the last second's ticks, in cisst's format
        self.changes = 0  # number of reads of the plant's state
        self._doing: Iterator[Floats | None] = iter(())  # setpoints (n,) of the current command, tick by tick
        self._is_moving = False  # along a trajectory
        self._push: _Push | None = None
        self._pushed: Floats | None = None  # torques (n,) requested in this tick
        self._jaw_wanted: Callable[[], Trajectory] | None = None
        self._jaw: tuple[Trajectory, int] | None = None  # of a jaw that moves independently of the arm
        self._arrived = self._was_moving = False
        self._was_ready = self._is_known = False
        self._takes_positions = "servo_jp" in plant.supports
        self.refresh()

    # commands

    @property
    def is_ready(self) -> bool:
        """Whether the arm obeys motion commands."""
        return self.plant.operating_state().is_ready

    def increment(self, dq: Floats) -> None:
        """Add an increment dq (n,) [rad|m], clamped to a millisecond's motion, to those waiting."""
        if not self._increments:
            self._do(self._increment())
        self._increments.append((self._clamped(dq), self.tick))

    def step_towards(self, q: Floats) -> None:
        """Move one clamped step towards q (n,) [rad|m], plus the steps left of the last goal."""
        self._go(q, min(self._steps + 1, self._follow_ticks))

    def go_towards(self, q: Floats, qd: Floats | None = None) -> None:
        """Move towards q (n,) [rad|m] for at most 0.1 s, at the speed of qd (n,), all joints arriving together.

        A separate jaw keeps its goal.
        """
        self._go(q if self._apart is None else np.append(q[:-1], self._apart[-1]), self._follow_ticks, qd)

    def open_jaws(self, opening: float) -> None:
        """Move the jaws towards an opening [rad] for at most 0.1 s; if they are separate, the arm keeps its goal."""
        q = self.joints_at_opening(opening)
        self._go(q if self._apart is None else np.append(self._apart[:-1], q[-1]), self._follow_ticks)

    @property
    def _apart(self) -> Floats | None:
        """Goal (n,) of an arm with a separate jaw, which commands of the other leave as it is."""
        return self._goal if self.tool.jaw_is_apart else None

    def _go(self, q: Floats, steps: int, qd: Floats | None = None) -> None:
        if self._goal is None:
            self._do(self._approach())
        self._goal, self._steps, self._pace = q, steps, self.most
        if qd is not None and qd.any():
            way = np.abs(q - self.setpoint.q)
            ticks = np.max(way / self.most) / np.max(np.abs(qd) * self.plant.period / self.most)
            self._pace = np.minimum(way / max(ticks, 1.0), self.most)

    def run_at(self, qd: Floats) -> None:
        """Move at qd (n,) [rad/s|m/s] for 0.1 s."""
        step = self._clamped(qd * self.plant.period)
        self._do(self.setpoint.q + step for _ in range(self._follow_ticks + 1))

    def push_with(self, torques: Callable[[], Floats]) -> None:
        """Command torques (n,) for 0.1 s, plus gravity's if compensated; a joint with NaN holds its setpoint.

        An MTM exerts them until the next command, as on the dVRK, so that the operator can feel them.
        """
        if "servo_jf" not in self.plant.supports:
            raise InputError("the arm takes no torques")
        if np.isnan(torques()).any() and "servo_jf_of" not in self.plant.supports:
            raise InputError("the arm takes torques only for all its joints")
        if self._push is None:
            self._do(self._exert())
            self._jaw = self._jaw_wanted = None
        self._push = _Push(torques, np.inf if self.master else self.tick + self._follow_ticks)

    def go_limp(self) -> None:
        """Command zero torque, plus gravity's if compensated, until the next command."""
        none = np.zeros(len(self.names))
        self.push_with(lambda: none)
        self._push = _Push(lambda: none, np.inf)
        self.unlock()

    def unlock(self) -> None:
        """Unlock an MTM's orientation."""
        if self.master is not None:
            self.master.locked = None

    def move(self, make: Callable[[], Trajectory]) -> None:
        """Follow a trajectory from the setpoint, busy until it ends; of several in a tick only the last one acts."""
        self._do(self._follow(make))

    def move_jaw(self, make: Callable[[], Trajectory]) -> None:
        """Move the jaw along a trajectory of all joints, independently of the arm if it is separate, as on a dVRK."""
        if self.tool.jaw_is_apart and self._push is None:
            self._jaw_wanted = make
        else:
            self.move(make)

    def hold(self) -> None:
        """Drop all commands and hold the position."""
        self._jaw = self._jaw_wanted = None
        self._do(iter(()))

    def _do(self, way: Iterator[Floats | None]) -> None:
        """Replace the arm's commands by another; an independent motion of the jaw continues."""
        self._increments.clear()
        self._goal, self._steps = None, 0
        self._doing, self._is_moving = way, False
        if self._push is not None:
            self._push = None
            if self.is_ready and self._takes_positions:
                self._send(self.measured.q)

    # reports

    @property
    def commanded(self) -> Floats:
        """Setpoint (n,) after all waiting increments, from which relative poses start."""
        return np.sum([self.setpoint.q, *(dq for dq, _ in self._increments)], axis=0)

    def scaled(self, dq: Floats) -> Floats:
        """Return a tick's motion dq (n,) [rad|m], so small that no joint exceeds its clamp, in its own direction."""
        with np.errstate(divide="ignore"):
            return dq * min(1.0, float((self.most / np.abs(dq)).min()))

    def whole(self, q: Floats) -> Floats:
        """Return positions (n,) with those of joint states; a jaw that these lack keeps its setpoint or goal."""
        setpoint = self.setpoint.q if self._jaw is None else self._jaw[0](self._jaw[0].duration).q
        return np.append(q, setpoint[len(q) :])

    def require_inside(self, q: Floats) -> None:
        """Refuse positions (n,) [rad|m] beyond the joints' limits."""
        for name, unit, value, lower, upper in zip(
            self.names, self.plant.joint_units, q, self.lower, self.upper, strict=True
        ):
            if not lower - 1e-9 <= value <= upper + 1e-9:
                raise LimitError(f'joint "{name}": {value:.6g} {unit} outside [{lower:.6g}, {upper:.6g}]')

    def jaw_increments(self, angle: float) -> Floats:
        """Return increments (n,) that open the jaws by an angle [rad], shared by two jaws."""
        dq, jaws = np.zeros(len(self.names)), self.tool.jaws
        dq[-jaws:] = angle / jaws
        return dq

    def joints_at_opening(self, opening: float) -> Floats:
        """Return the setpoint (n,) with the jaws opened to an angle [rad]."""
        return self.setpoint.q + self.jaw_increments(opening - self.setpoint.q[-self.tool.jaws :].sum())

    # ticks

    def advance(self) -> None:
        """End a tick: command the plant and wait for it."""
        ready = self.is_ready
        try:
            if ready:
                self._act()
            elif self._was_ready:
                self.hold()
            self._was_ready = ready
            if self.master is not None:
                cast(Any, self.plant).pushed_by[:] = self.master.hand(self.measured_tool, self.measured.time)
            self.plant.wait()
        except CatenaryError as error:
            # homing failed, or the robot tripped within the tick: the server continues
            self.hold()
            self.reports.say(f"{self.arm}: fault", str(error), self.reports_time)
        self.machine.update()
        self.tick += 1
        self.refresh()
        if self._pushed is not None:
            self._report_limits(self._pushed)
            self._pushed = None

    def refresh(self) -> None:
        """Read the plant; only once if it cannot change, such as a parked arm."""
        if self._is_known and not self.machine.can_change:
            return
        self._is_known = True
        self.changes += 1
        self.measured: JointState = self.plant.measured_js()
        self.setpoint: JointState = self.plant.setpoint_js()
        measured, setpoint = self.measured, self.setpoint
        self.measured_tool = ToolState(self.tool, measured.q, measured.qd, self._beyond_weight)
        # the setpoint's velocity is that of its last step
        self.setpoint_tool = ToolState(self.tool, setpoint.q, self._step_velocity(), self._beyond_weight)
        state = self.plant.operating_state()
        is_moving = self._is_moving or self._jaw is not None
        if self._was_moving and not is_moving:
            self.moves_ended, self._arrived = (self.moves_ended[0] + 1, self._arrived), False
        self._was_moving = is_moving
        self.state: OperatingState = state._replace(is_busy=True) if is_moving and state.state == "ENABLED" else state

    def _beyond_weight(self) -> Floats:  # (n,), measured, less the arm's gravity torques
        measured = self.measured
        return measured.tau - self.gravity_torque(measured.q, measured.gravity)

    def _step_velocity(self) -> Floats:
        """Return the velocity of the setpoint (n,); zero when control has just begun."""
        before, self._before = self._before, (self.setpoint.q, self.is_ready)
        q, ready = self._before
        return (q - before[0]) / self.plant.period if before and before[1] and ready else np.zeros(len(q))

    def _act(self) -> None:
        if self._jaw_wanted is not None:
            self._jaw, self._jaw_wanted = (self._jaw_wanted(), self.tick), None
        q = next(self._doing, None)
        if q is not None:
            self._send(q)
        elif self._jaw is not None:
            self._send(self.setpoint.q)

    def _clamped(self, way: Floats) -> Floats:
        return np.minimum(np.maximum(way, -self.most), self.most)

    def _increment(self) -> Iterator[Floats]:
        """Add up a tick's increments of all clients, up to the clamp; the rest waits for the next ticks.

        The total motion does not depend on how messages bunch up. The robot itself drops increments beyond the clamp.
        """
        waiting, patience = self._increments, max(1, round(_BACKLOG_S / self.plant.period))
        while True:
            while waiting and self.tick - waiting[0][1] > patience:
                waiting.popleft()
            if not waiting:
                return
            total = waiting.popleft()[0]
            for _ in range(min(_INCREMENTS_A_TICK - 1, len(waiting))):
                more = total + waiting[0][0]
                if (np.abs(more) > self.most).any():
                    break
                waiting.popleft()
                total = more
            yield self.setpoint.q + total

    def _approach(self) -> Iterator[Floats]:
        while self._goal is not None:
            way, self._steps = self._goal - self.setpoint.q, self._steps - 1
            step = np.clip(way, -self._pace, self._pace)
            if self._steps <= 0 or (step == way).all():
                self._goal, self._steps = None, 0
            yield self.setpoint.q + step

    def _follow(self, make: Callable[[], Trajectory]) -> Iterator[Floats]:
        trajectory, begin, self._is_moving = make(), self.tick, True
        while self._is_moving:
            q, has_ended = self._along(trajectory, begin)
            if self.tool.jaw_is_apart:
                q[-1] = self.setpoint.q[-1]
            if has_ended:
                self._is_moving, self._arrived = False, True
            yield q

    def _along(self, trajectory: Trajectory, begin: int) -> tuple[Floats, bool]:
        """Return the current position (n,) on a trajectory that began in a tick, and whether it has ended."""
        time = (self.tick + 1 - begin) * self.plant.period
        q = np.array(trajectory(min(time, trajectory.duration)).q)
        return q, time >= max(trajectory.duration, _LEAST_BUSY_S)

    def _exert(self) -> Iterator[Floats | None]:
        while self._push is not None and self.tick < self._push.until:
            tau, q = self._push.torques(), self.measured.q
            if self.master is not None:
                tau = tau + self.master.lock(self.measured_tool)
            if self.settings.compensates_gravity:
                tau = tau + self.gravity_torque(q, self.measured.gravity)
            self._pushed = tau
            # no torque further beyond a joint limit, as the robot may not check limits itself
            outward = ((q > self.upper) & (tau > 0.0)) | ((q < self.lower) & (tau < 0.0))
            tau = np.where(outward, 0.0, tau)
            held = np.isnan(tau)
            if held.any():
                cast(Any, self.plant).servo_jf_of(tau, ~held)  # which it supports
            else:
                self.plant.servo_jf(tau)
            yield None
        self._push = None
        yield self.measured.q  # the firmware holds where the arm is

    def _report_limits(self, requested: Floats) -> None:
        """Report torques that differ from those requested, with the joint's position."""
        acts = self.measured.tau
        for j in np.flatnonzero(np.abs(acts - requested) > 1e-3 * (1.0 + np.abs(requested))):
            text = (
                f'joint "{self.names[j]}": torque {requested[j]:.4g} requested, {acts[j]:.4g} applied, at '
                f"{self.measured.q[j]:.4g} {self.plant.joint_units[j]} of [{self.lower[j]:.4g}, {self.upper[j]:.4g}]"
            )
            self.reports.say(f"{self.arm}: limited", text, self.reports_time, to=(self.arm,))

    def _send(self, q: Floats) -> None:
        if self._jaw is not None:
            jaw, has_ended = self._along(*self._jaw)
            q = np.append(q[:-1], jaw[-1])
            if has_ended:
                self._jaw, self._arrived = None, True
        if self._takes_positions:
            self.plant.servo_jp(np.minimum(np.maximum(q, self.lower), self.upper))
        else:
            self.reports.say(f"{self.arm}: cannot", "the robot takes no positions", self.reports_time)


# a third of a setpoint's largest speed, reached in half a second
_SPEED = {"rad": 0.8, "m": 0.016}  # [rad/s], [m/s]
_ACCELERATION = {"rad": 1.6, "m": 0.032}  # [rad/s2], [m/s2]
_GOAL_STEPS = 60  # iterations of inverse kinematics far from the setpoint: some milliseconds, once


def joint_move(arm: ServedArm, q: Floats) -> Callable[[], Trajectory]:
    """Return a function that makes a trajectory from the setpoint to q (n,), with all joints arriving together."""
    arm.require_inside(q)
    velocity, acceleration = _bounds(arm)
    return partial(go_to, arm.setpoint.q, q, max_velocity=velocity, max_acceleration=acceleration)


def pose_move(arm: ServedArm, goal: Pose) -> Callable[[], Trajectory]:
    """Return a `joint_move` to a pose; not a straight line of the tool, as on a dVRK.

    [jhu-dvrk/sawIntuitiveResearchKit: mtsIntuitiveResearchKitArm::control_move_cp]
    """
    try:
        q = arm.tool.joints(goal, arm.setpoint.q, steps=_GOAL_STEPS)
    except UnreachablePoseError:  # from the setpoint, for example after torques have wound up the roll
        q = arm.tool.joints(goal, arm.tool.middle(arm.setpoint.q), steps=_GOAL_STEPS)
    return joint_move(arm, q)


def _bounds(arm: ServedArm) -> tuple[Floats, Floats]:
    units = arm.plant.joint_units
    speed = arm.settings.speed_ratio * np.array([_SPEED[unit] for unit in units])
    return speed, arm.settings.acceleration_ratio * np.array([_ACCELERATION[unit] for unit in units])


_REFUSED_FROM_M = 0.075  # [m] distance to the setpoint beyond which the RAVEN-II refuses a servo_cp
_CLIPPED_TO_M = 0.015  # [m] longest motion of a servo_cp


def servo_pose(arm: ServedArm, pose: Pose, twist: Floats | None = None) -> None:
    """Move up to 15 mm towards a pose, at the speed of a twist (6,); refuse poses over 75 mm from the setpoint."""
    start = arm.tool.pose(arm.setpoint.q)
    way = pose.position - start.position
    distance = float(np.linalg.norm(way))
    if distance > _REFUSED_FROM_M:
        raise InputError(
            f"servo_cp: {1e3 * distance:.1f} mm from the setpoint, expected at most {1e3 * _REFUSED_FROM_M:.0f}"
        )
    if distance > _CLIPPED_TO_M:
        share = _CLIPPED_TO_M / distance
        turn = share * rotation_vector(start.rotation.T @ pose.rotation)
        pose = Pose(start.rotation @ rotation_from_vector(turn), start.position + share * way)
    arm.go_towards(arm.tool.joints(pose, arm.setpoint.q), None if twist is None else _speeds(arm, twist))


def servo_pose_increment(arm: ServedArm, step: Floats, turn: Floats) -> None:
    """Move the tool by a step (3,) [m] and turn it by a rotation vector (3,) [rad], both in base axes."""
    q = arm.commanded
    arm.increment(arm.scaled(_joints_beside(arm, q, step, turn) - q))


def servo_twist(arm: ServedArm, twist: Floats) -> None:
    """Move the tool at a velocity and angular velocity (6,) in base axes [m/s, rad/s], for 0.1 s."""
    arm.run_at(arm.scaled(_speeds(arm, twist) * arm.plant.period) / arm.plant.period)


def _speeds(arm: ServedArm, twist: Floats) -> Floats:
    """Return joint velocities (n,) that move the tool at a twist (6,) from the setpoint."""
    dt, q = arm.plant.period, arm.setpoint.q
    return (_joints_beside(arm, q, dt * twist[:3], dt * twist[3:]) - q) / dt


def _joints_beside(arm: ServedArm, q: Floats, step: Floats, turn: Floats) -> Floats:
    step, turn = as_array("translation", step, (3,)), as_array("rotation", turn, (3,))
    start = arm.tool.pose(q)
    goal = Pose(rotation_from_vector(turn) @ start.rotation, start.position + step)
    return arm.tool.joints(goal, q)
