"""Messages of any content to every command topic of a served RAVEN-II, in every operating state, in simulated time."""

import gc
from functools import cache, partial
from pathlib import Path
from time import thread_time
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.campaign.part import Fell, Part

if TYPE_CHECKING:
    from catenary.crtk.topic_names import CrtkTopic

MOST_OF_A_TICK = 1e-3  # [s] of processor time, beyond that of an idle tick
OR_IDLE_TICKS = 8.0  # where a busy machine makes idle ticks slow, too; on an idle one a pose to reach takes 4
OF_A_CASE = 50  # messages
AGAIN = 25  # times that a message which took longer is tried, on a busy machine; the quickest counts
# of the measured joints beyond their soft limits under torques, as docs/reliability.md has it
BEYOND = np.array([0.02, 0.02, 0.001, 0.08, 0.08, 0.08, 0.08])  # [rad, rad, m, rad...]
MOST_KINDS = 400  # of reports: as many as there are topics and reasons, whatever comes


class CommandedRobot:
    """A served robot that hears all messages of a child process, and what must hold of it."""

    def __init__(self, dialect: str) -> None:
        from catenary.crtk.message_values import command_message, pose_message
        from catenary.crtk.topic_names import topics
        from served_robot import JointState, ServedRobot

        self.robot = robot = ServedRobot(dialect)
        self.server, self.plant, self.arm = robot.server, robot.plant, robot.server.arms["gold"]
        self.served = {source.topic.name: source._subscription for source in self.server._sources}
        self.topics = [one for one in topics(dialect) if one.direction == "in" and one.name in self.served]
        self.wrongly_moved = ""
        for verb in ("servo_jp", "servo_jf"):
            setattr(self.plant, verb, partial(self._watched, verb, getattr(self.plant, verb)))
        self.command_message = command_message
        self.arm.tool.prepare()
        here = pose_message(self.arm.tool.pose(robot.setpoint), 0, "", child=None if dialect == "crtk" else "tool")
        for topic in self.topics:  # what is compiled is compiled now
            if topic.arm == "gold" and topic.type == type(here).__name__:
                robot.say(topic.verb, here)
            elif topic.arm == "gold" and "servo_j" in topic.verb:
                robot.say(topic.verb, JointState(position=robot.setpoint, effort=np.zeros(7), velocity=np.zeros(7)))
            self.ticks(20)

    def _watched(self, verb: str, call: Any, values: Any) -> None:
        state = self.plant.operating_state()
        if state.state != "ENABLED" or not state.is_homed or state.is_busy:
            self.wrongly_moved = f"{verb} while {state}"
        call(values)

    def ticks(self, count: int) -> float:
        """Run ticks; return the processor time of the longest [s]."""
        longest = 0.0
        for _ in range(count):
            self.robot.clock.sleep(0.001)
            ready = self.arm.is_ready
            before = self.arm.setpoint.q
            begin = thread_time()
            self.server.tick()
            longest = max(longest, thread_time() - begin)
            self._check(ready, before)
        return longest

    def _check(self, was_ready: bool, before: Any) -> None:
        arm, state = self.arm, self.plant.operating_state()
        if self.wrongly_moved:
            raise Fell(self.wrongly_moved)
        q, setpoint = arm.measured.q, arm.setpoint.q
        if not (np.isfinite(q).all() and np.isfinite(setpoint).all()):
            raise Fell(f"measured {q}, setpoint {setpoint}")
        if state.is_homed and not state.is_busy:
            if ((q < arm.lower - BEYOND) | (q > arm.upper + BEYOND)).any():
                raise Fell(f"measured {q} outside [{arm.lower}, {arm.upper}]")
            if not was_ready and not arm.is_ready and np.abs(setpoint - before).max() > 1e-9:
                raise Fell(f"setpoint of an arm that is {state} went from {before} to {setpoint}")
        if len(self.server.reports.kinds) > MOST_KINDS:
            raise Fell(f"{len(self.server.reports.kinds)} kinds of reports")

    def enter(self, rng: np.random.Generator) -> None:
        """Bring the arm into an operating state, mostly ready."""
        drawn = rng.random()
        if drawn < 0.2:
            self.arm.machine.command(str(rng.choice(["disable", "pause", "enable", "resume", "home"])))
        elif drawn < 0.8 and not self.arm.is_ready:
            self.server.press_button()
            for command in ("enable", "home", "resume"):
                self.arm.machine.command(command)

    def noticed(self) -> int:
        """Messages that were taken in, or refused and counted."""
        return int(self.server.commands + sum(one.count for one in self.server.reports.kinds.values()))

    def require_quick(self, topic: "CrtkTopic", data: bytes, count: int) -> None:
        """Send a message again until no tick takes too long, on a busy machine; the quickest counts."""
        beyond = np.inf
        for _ in range(AGAIN):
            self.arm.machine.command("resume")
            idle = sorted(self.ticks(1) for _ in range(9))[4]
            self.hears(topic, data)
            beyond = min(beyond, self.ticks(count) - idle)
            if beyond < max(MOST_OF_A_TICK, OR_IDLE_TICKS * idle):
                return
        raise Fell(f"{topic.name}: a tick took {1e3 * beyond:.2f} ms longer than an idle one")

    def hears(self, topic: "CrtkTopic", data: bytes) -> None:
        """Take in a message as a transport does."""
        self.served[topic.name].push(data, self.robot.clock.now())


@cache
def _commanded(dialect: str) -> CommandedRobot:
    return CommandedRobot(dialect)


def messages(dialect: str, seed: int, folder: Path) -> None:
    """Send messages, in some states; the robot goes on, within its bounds and its time, and counts each of them."""
    rng = np.random.default_rng([seed, len(dialect)])
    one = _commanded(dialect)
    gc.disable()  # as in a served robot's loop
    try:
        _send(one, rng, folder)
    finally:
        gc.enable()


def _send(one: CommandedRobot, rng: np.random.Generator, folder: Path) -> None:
    from odd_messages import odd_bytes

    idle = sorted(one.ticks(1) for _ in range(7))[3]
    counted = one.noticed()
    with (folder / "input").open("w") as file:
        for _ in range(OF_A_CASE):
            topic = one.topics[int(rng.integers(len(one.topics)))]
            one.enter(rng)
            data = odd_bytes(rng, topic, one.arm)
            print(topic.name, topic.type, one.arm.state, data[:10_000].hex(), file=file, flush=True)
            one.hears(topic, data)
            count = 30 if "move_c" in topic.verb and rng.random() < 0.2 else 2
            if one.ticks(count) - idle > MOST_OF_A_TICK:
                one.require_quick(topic, data, count)
    one.ticks(110)  # what was dropped is reported ten times a second
    if one.noticed() - counted < OF_A_CASE:
        raise Fell(f"{OF_A_CASE} messages came, {one.noticed() - counted} were obeyed or counted")


PARTS = tuple(
    Part(f"messages.{dialect}", 100_000 // OF_A_CASE, partial(messages, dialect), processor_time=60.0)
    for dialect in ("raven", "crtk")
)
