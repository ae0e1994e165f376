"""Server of a robot over ROS 1, ROS 2 or within a process: each tick reads commands, moves the arms and publishes.

The server has no timer: the caller calls `tick` at the robot's rate (`catenary.nodes.serve`, a test).

In addition to its dialect it publishes `/diagnostics` (each arm's state and the reason of a FAULT, once a second and
when a state changes [diagnostic_msgs/DiagnosticArray; ROS REP 107: name, hardware_id]) and external encoders.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from time import perf_counter

import numpy as np

from catenary.crtk.client import STARTS_TEXT
from catenary.crtk.exclusive_control import WATCH_EVERY_NS, Commander, another_robot, require_no_other_robot
from catenary.crtk.message import Message, header, message_class
from catenary.crtk.message_queues import Arrival
from catenary.crtk.message_values import Stamps, joint_state_message
from catenary.crtk.serving.command_source import TOPIC_COMMANDS_A_TICK, CommandSource
from catenary.crtk.serving.dialect import Dialect, LazyPublisher
from catenary.crtk.serving.reports import Reports
from catenary.crtk.serving.served_arm import ServedArm
from catenary.crtk.serving.state_machine import why_not_obeyed
from catenary.crtk.topic_names import (
    BUTTON,
    BUTTON_TYPE,
    CONSOLE_COMMANDS,
    DIAGNOSTICS,
    DIAGNOSTICS_TYPE,
    ERROR,
    JOINT_STATE,
    WARNING,
    CrtkTopic,
)
from catenary.crtk.transport import Transport
from catenary.errors import CatenaryError, TransportError
from catenary.plant import OperatingState, Plant, fault_of
from catenary.topics import SECOND, Topic

_Array, _Status, _KeyValue = (
    message_class(f"diagnostic_msgs/{name}") for name in ("DiagnosticArray", "DiagnosticStatus", "KeyValue")
)
_OK, _WARN, _ERROR = 0, 1, 2  # levels


class Diagnostics:
    """Publisher of a diagnostic status for each arm that moves."""

    def __init__(self, transport: Transport, arms: Mapping[str, ServedArm], reports: Reports) -> None:
        self._publisher = transport.publisher(DIAGNOSTICS, DIAGNOSTICS_TYPE, latch=True)
        self._arms = {name: arm for name, arm in arms.items() if arm.machine.can_change}
        self._reports = reports
        self._told: dict[str, OperatingState] = {}
        self._at: int | None = None  # [ns]

    def publish(self, now: int, stamp: int) -> None:
        """Publish with a stamp [ns] if due at `now` [ns] or after a change; report the cause of a new fault."""
        states = {name: arm.state for name, arm in self._arms.items()}
        if states == self._told and self._at is not None and 0 <= now - self._at < SECOND:
            return
        for name, arm in self._arms.items():
            if states[name].state == "FAULT" and (name not in self._told or self._told[name].state != "FAULT"):
                why = fault_of(arm.plant) or "the robot states no reason"
                self._reports.say(f"{name}: FAULT", why, now, to=(name,), each=True)
        self._told, self._at = states, now
        self._publisher.publish(
            _Array(header(stamp), tuple(self._status(name, arm) for name, arm in self._arms.items()))
        )

    def _status(self, name: str, arm: ServedArm) -> Message:
        state = arm.state
        refused = sum(one.count for kind, one in self._reports.kinds.items() if kind.endswith(": refused"))
        level, text = (_OK, state.state) if state.is_homed or state.is_busy else (_WARN, f"{state.state}, not homed")
        if state.state == "FAULT":
            level, text = _ERROR, f"FAULT: {fault_of(arm.plant) or 'reason unknown'}"
        values = {**state._asdict(), "commands refused": refused}
        pairs = tuple(_KeyValue(key, str(value)) for key, value in values.items())
        return _Status(level, f"catenary: {name} arm", text, arm.place, pairs)


class ServedEncoders:
    """Publisher of `joint_enc`, and of `ext_jpos` [rad, rad, m] once registered; or of a tracker's joint positions."""

    def __init__(self, transport: Transport, plant: Plant, topics: Sequence[Topic]) -> None:
        self._plant = plant
        self.publishers = tuple(
            LazyPublisher(transport, CrtkTopic(topic.name, JOINT_STATE, "out", topic.columns[0].name))
            for topic in topics
        )
        self._joints = topics[0].joint_names
        self._every = min(round(SECOND / topic.rate) for topic in topics)  # [ns]
        self._due: int | None = None

    def publish(self, now: int, stamp: int) -> None:
        """Publish with a stamp [ns] if due at `now` [ns] and anybody subscribes."""
        if self._due is not None and 0 <= self._due - now < self._every:
            return
        # on a grid, so that late ticks do not lower the rate; never two at once to catch up
        late = now - self._due if self._due is not None else 0
        self._due = now + self._every - (late if 0 <= late < self._every else 0)
        if not any(lazy.heard for lazy in self.publishers):
            return
        telemetry = self._plant.telemetry()
        for lazy in self.publishers:
            values = telemetry[lazy.topic.verb]
            if lazy.heard and np.isfinite(values).all():
                lazy.publish(joint_state_message(self._joints, stamp, values))


_ANNOUNCED_WITHIN_S = 0.6  # [s] until a robot is known in the whole network: ROS 1's master is polled twice a second
_STOPPING_VERBS = ("hold", "free")  # commands that discard queued ones
_String = message_class("std_msgs/String")
_COMMAND_COST_A_TICK = 8  # tenths of a millisecond for the commands of a tick; the rest wait for the next tick


class _Periods:
    """Statistics of ticks over a second, as in cisst's mtsIntervalStatistics."""

    def __init__(self, period: float) -> None:
        self._period, self._ticks = period, list[tuple[float, float]]()  # when they began and took [s]
        self.reported: tuple[float, ...] | None = None  # of the last whole second, in the message's order

    def add(self, began: float, took: float) -> None:
        self._ticks.append((began, took))
        if began - self._ticks[0][0] < 1.0:
            return
        when, took_all = np.array(self._ticks).T
        periods, overruns = np.diff(when), int(np.sum(took_all > self._period))
        moments = [f(row) for row in (periods, took_all[1:]) for f in (np.mean, np.std, np.min, np.max)]
        self.reported = (*map(float, moments), len(periods), overruns, float(when[-1] - when[0]), 0)
        self._ticks = self._ticks[-1:]


class Server:
    """Server of arms over a transport, in a dialect."""

    def __init__(
        self,
        transport: Transport,
        arms: Mapping[str, ServedArm],
        dialect: Dialect,
        reports: Reports,
        *,
        button: bool = False,
        publish_every: int = 1,
        encoders: ServedEncoders | None = None,
    ) -> None:
        """Advertise and subscribe; nothing moves before `tick`, and every `publish_every`-th tick is published."""
        self._joints = tuple(topic.name for topic in dialect.topics if topic.verb == "measured_js")
        require_no_other_robot(transport, self._joints)
        self.transport, self.arms, self.reports = transport, arms, reports
        self.commands = 0  # received, whether obeyed or refused
        self.ticks = 0
        self._dialect = dialect
        self._periods = _Periods(max(arm.plant.period for arm in arms.values()))
        self._every = publish_every
        self._stamps = Stamps(transport.clock)
        begin, published, processes = transport.steady(), transport.topics(), transport.publishing()
        topics = dialect.topics
        self._sources = [
            CommandSource(
                transport, topic, reports, begin=begin, waits=topic.name in published,
                old=processes.get(topic.name, frozenset()),
            )
            for topic in topics if topic.direction == "in"
        ]  # fmt: skip
        # state commands first, so that commands sent after a `resume` are obeyed in the same tick
        self._sources.sort(key=lambda source: not source.topic.commands_state)
        self._others = sum(source.topic.commands_state for source in self._sources)  # where the others begin
        self._commanders = {name: Commander(transport) for name in arms}
        self._due = begin  # [ns] when the tick was due
        self._arrivals = 0  # messages processed or waiting
        self._is_behind = False  # messages are waiting
        self.publishers = {
            (topic.verb, topic.arm): LazyPublisher(transport, topic) for topic in topics if topic.direction == "out"
        }
        dialect.begin(self.publishers)
        for topic in topics:
            if topic.verb == "state_command" and topic.arm is not None:
                arms[topic.arm].place = topic.name.rpartition("/")[0]
        self._diagnostics = Diagnostics(transport, arms, reports)
        self._encoders = encoders
        self._heard = (*self.publishers.values(), *(() if encoders is None else encoders.publishers))
        self._watched = begin
        for service in dialect.services if transport.has_services else ():
            transport.service(service.name, service.type, service.answer)
        self.button = BUTTON if button else None
        if button and transport.has_services:
            transport.service(BUTTON, BUTTON_TYPE, self._pressed)

    def tick(self, late: float = 0.0) -> None:
        """Read commands, move the arms by a tick, publish; a tick `late` by so many seconds gets the stamp when due."""
        now, began = self.transport.steady(), perf_counter()
        self._due = now - round(late * SECOND)
        self.transport.poll()
        arrivals = self.transport.inbox.arrivals
        if arrivals != self._arrivals or self._is_behind:  # else nothing waits
            self._arrivals = arrivals
            self._take_in(now)
        stamp = self._stamps.next(self._due)  # after those of answers to state commands
        for arm in self.arms.values():
            arm.reports_time = now
            arm.advance()
        settled = self._dialect.settle()
        if settled is not None:
            self.reports.say("robot: stopped", settled, now, to=tuple(self.arms))
        self._diagnostics.publish(now, stamp)
        for name, line in self.reports.take_told():
            self.publishers[WARNING, name].publish(_String(line))
            if line.startswith((f"{name}: FAULT", f"{name}: fault")) and (ERROR, name) in self.publishers:
                self.publishers[ERROR, name].publish(_String(line))
        if self.ticks % self._every == 0:
            self._dialect.publish(stamp)
        if self._encoders is not None:
            self._encoders.publish(now, stamp)
        self.ticks += 1
        # one topic a tick: a new subscriber gets messages at once, even if the robot had no subscribers before
        self._heard[self.ticks % len(self._heard)].watch()
        if not 0 <= now - self._watched < WATCH_EVERY_NS:
            self._watched = now
            for source in self._sources:
                source.watch(now)
            self._stop_beside_another(now)
            for name, arm in self.arms.items():
                self._pause_abandoned(arm, self._commanders[name], now)
        self._periods.add(now / SECOND, perf_counter() - began)
        if self._periods.reported is not None:
            for arm in self.arms.values():
                arm.statistics = self._periods.reported

    def require_alone(self) -> None:
        """Refuse to start if another robot has this name, even one announced at the same time."""
        self.transport.sleep(_ANNOUNCED_WITHIN_S)
        if other := another_robot(self.transport, self._joints):
            raise TransportError(other)

    def say_states(self) -> None:
        """Publish the arms' states immediately, as at the server's end."""
        self._dialect.publish(self._stamps.next(self.transport.steady()))

    def _take_in(self, now: int) -> None:
        """Obey what has come, as much as a tick has time for; what comes faster waits, then the oldest gives way."""
        left, waiting = _COMMAND_COST_A_TICK, 0
        for k, source in enumerate(self._sources):
            # state commands leave half to the others
            free = left - _COMMAND_COST_A_TICK // 2 if k < self._others else left
            count = min(len(source), TOPIC_COMMANDS_A_TICK, free // source.cost)
            left -= count * source.cost
            if count and k < self._others:  # who asks for a state reads the robot next, as soon as it is answered
                for lazy in self._heard:
                    lazy.watch()
                if self.ticks % self._every:
                    self._dialect.publish(self._stamps.next(self._due))
            for arrival in source.take(now, count) if count else ():
                self.commands += 1
                self._obey(source, arrival, now)
            for arm in self._arms_of(source.topic) if count and source.moves else ():
                self._commanders[arm.arm].hears(source.heard)
            if len(source) and source.moves and not any(arm.is_ready for arm in self._arms_of(source.topic)):
                self._forget(source, now)
            waiting += len(source)
        self._is_behind = waiting > 0
        if waiting:  # another topic is first in the next tick
            states, others = self._sources[: self._others], self._sources[self._others :]
            self._sources = [*states[1:], *states[:1], *others[1:], *others[:1]]

    def press_button(self) -> list[str]:
        """Press the silver button; return its effect on each arm."""
        answers = []
        for name, arm in self.arms.items():
            if arm.machine.can_change:
                refused = arm.machine.press_button()
                answers.append(f"{name}: {refused}" if refused else f"{name}{STARTS_TEXT}")
        return answers

    def start(self) -> None:
        """Press the silver button; enable and home the arms of a robot without one."""
        if self.button is not None:
            self.press_button()
            return
        for arm in self.arms.values():
            for command in ("enable", "home") if arm.machine.can_change else ():
                if (ignored := arm.machine.command(command)) is not None:
                    self.reports.say("start", ignored, self.transport.steady())

    def clients(self) -> set[str]:
        """Names of the programs that subscribe or send commands."""
        names: set[str] = set()
        for lazy in self._heard:
            names.update(self.transport.connections(lazy.topic.name).subscribers)
        for source in self._sources:
            names.update(self.transport.connections(source.topic.name).publishers)
        return names

    @property
    def published(self) -> int:
        """Number of published topics."""
        return len(self._heard)

    @property
    def missed(self) -> dict[str, int]:
        """Number of messages that slow clients missed, by client name."""
        return dict(sum((Counter(lazy.publisher.missed) for lazy in self._heard), Counter()))

    def _pressed(self, request: Message) -> Message:
        answers = self.press_button()
        return message_class(f"{BUTTON_TYPE}Response")(
            success=any(text.endswith(STARTS_TEXT) for text in answers), message="; ".join(answers)
        )

    def _obey(self, source: CommandSource, arrival: Arrival, now: int) -> None:
        topic, message, process = source.topic, arrival.message, arrival.process
        try:
            if topic.commands_state:
                for text in CONSOLE_COMMANDS.get(topic.verb) or (message.string,):
                    self._state_command(topic, text, now)
            elif topic.name == BUTTON:
                self.reports.say("button", "; ".join(self.press_button()), now, to=tuple(self.arms), each=True)
            else:
                moved = self.arms if topic.arm is None else (topic.arm,)
                if source.moves and topic.verb != "hold":  # which any program may send
                    for name in moved:
                        is_busy = self.arms[name].state.is_busy
                        self._commanders[name].require_free(process, now, is_moving=is_busy)
                self._dialect.obey(topic, message)
                if topic.verb in _STOPPING_VERBS and topic.arm is not None:
                    self._forget_others(self.arms[topic.arm], now)
                for name in moved if source.moves else ():
                    self._commanders[name].commands(topic.name, process, now)
        # the server keeps running whatever a client sends
        except (CatenaryError, ArithmeticError, ValueError, LookupError) as error:
            self._refuse(topic, str(error) if isinstance(error, CatenaryError) else repr(error), now)

    def _arms_of(self, topic: CrtkTopic) -> tuple[ServedArm, ...]:
        return tuple(self.arms.values()) if topic.arm is None else (self.arms[topic.arm],)

    def _forget_others(self, arm: ServedArm, now: int) -> None:
        """Drop the motion commands of an arm that wait: what stops it is not followed by what came before."""
        if not self._is_behind:
            return  # all that waits came in this tick, and no order is kept between topics within one
        for source in self._sources:
            if source.moves and len(source) and source.topic.arm == arm.arm:
                self._forget(source, now)

    def _forget(self, source: CommandSource, now: int) -> None:
        arm = self._arms_of(source.topic)[0]
        why = "not obeyed: a later command stopped the arm" if arm.is_ready else why_not_obeyed(arm.state)
        dropped = source.forget()
        self.commands += dropped
        self._refuse(source.topic, why, now, times=dropped)

    def _refuse(self, topic: CrtkTopic, why: str, now: int, times: int = 1) -> None:
        """Say why a command is not obeyed, of each move and of streamed commands now and then."""
        to = tuple(self.arms) if topic.arm is None else (topic.arm,)
        self.reports.say(f"{topic.name}: refused", why, now, to=to, each="move" in topic.verb, times=times)

    def _stop_beside_another(self, now: int) -> None:
        """Pause all arms, and let none be enabled, while another robot of this name is there."""
        other = another_robot(self.transport, self._joints)
        for arm in self.arms.values():
            arm.machine.held_by = other
            if other and arm.state.state == "ENABLED":
                arm.hold()
                arm.machine.command("pause")
        if other:
            self.reports.say("robot: paused", other, now, to=tuple(self.arms))

    def _pause_abandoned(self, arm: ServedArm, commander: Commander, now: int) -> None:
        if not arm.is_ready:
            commander.forget(now)
            return
        gone = commander.left(now, is_moving=arm.state.is_busy)
        if gone is not None:
            arm.hold()
            arm.machine.command("pause")
            text = f"{gone} was moving it and has disconnected"
            self.reports.say(f"{arm.arm}: paused", text, now, to=(arm.arm,), each=True)

    def _state_command(self, topic: CrtkTopic, text: str, now: int) -> None:
        if topic.arm is None or self._dialect.is_one_robot:
            arms = [arm for arm in self.arms.values() if arm.machine.can_change]
        else:
            arms = [self.arms[topic.arm]]
        for arm in arms:
            self._dialect.answer(arm, self._stamps.next(self._due))
            ignored = arm.machine.command(text)
            if ignored is not None:
                self.reports.say(f"{topic.name}: ignored", ignored, now, to=(arm.arm,))
            if not arm.is_ready:
                arm.hold()
                self._forget_others(arm, now)
