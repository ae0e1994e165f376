"""Record a robot's topics on arrival, with the robot's own stamps, into the journal that everything else reads.

Unlike `Recorder`, which makes messages from a simulator's telemetry, this one keeps what was published: headers, stamps
and bytes. Topics that come faster than they are wanted are thinned, by their own stamps: one that comes at the wanted
rate is kept whole, also where a busy machine lets it in by bursts.

A recording of a robot that is driven along a motion goes on where it was cut off, killed too: nothing that is on disk
is driven again. Where that is, the setpoints in it tell, not what was sent: on a busy machine or network messages come
late, now by a millisecond and in the next run by a third of a second. So the stretch that a run leaves off with is the
one that the next begins with, whatever the delays of the two. What ended a run, this program, the robot or the network,
stands in the recording.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.client import CrtkClient
from catenary.crtk.message import Message, codec
from catenary.crtk.message_queues import Subscription
from catenary.crtk.transport import Transport
from catenary.errors import CatenaryError, FileFormatError, InputError, NotReadyError, RecordingError, TransportError
from catenary.parallel import Progress, silent
from catenary.plant import JointState
from catenary.raven2.topics import RAVENSTATE, RAVENSTATE_100HZ
from catenary.recording.bag_reader import JournalReader, is_journal
from catenary.recording.journal import About, JournalTopic, JournalWriter, LeftOff
from catenary.topics import SECOND, Topic
from catenary.trajectories.reference import GoneOn, Reference, Trajectory
from catenary.workflows.robot.motion import arrive, move_to, run_trajectory

QUEUE_DEPTH = 5000  # messages that wait between two `collect`: 5 s of a robot's topic
PERIOD_S = 0.02  # [s] between two `collect` of a recording without a motion of ours
_CLOCK_SET_S = 0.1  # [s] by which the machine's clock has to be set to be noted
SILENCE_S = 0.5  # [s] between two messages of a topic, or two looks at what has come, that is noted


@dataclass
class TopicCount:
    """Counts of one topic: messages that arrived, were kept, were lost."""

    name: str
    came: int = 0
    kept: int = 0
    thinned: int = 0  # came faster than the topic is recorded
    lost: int = 0  # came faster than they were collected
    longest_gap: float = 0.0  # [s] between two that came

    def note(self) -> str | None:
        """Return the fault of a topic, or None; thinning to less than half is what was asked for."""
        if self.came == 0:
            return f"topic {self.name}: nothing came"
        if self.lost:
            return f"topic {self.name}: {self.lost} messages came faster than they were collected"
        if 0 < self.thinned < self.kept:
            return f"topic {self.name}: {self.thinned} of {self.came} messages came faster than it is recorded"
        return None


@dataclass
class _Kept:
    topic: Topic
    subscription: Subscription
    count: TopicCount
    due: int = 0  # [ns] stamp of the next message that is kept, or half a period earlier
    stamp: int = 0  # [ns] of the newest message
    last: int = 0  # [ns] arrival of the newest message

    def takes(self, stamp: int) -> bool:
        """Return True if a message of a stamp [ns] is kept, on a grid of the topic's rate; never two to catch up."""
        period = round(SECOND / self.topic.rate)
        if stamp < self.stamp:  # the publisher's clock was set back, or it is another one
            self.due = stamp
        self.stamp = stamp
        if stamp < self.due - period // 2:
            self.count.thinned += 1
            return False
        self.due = (self.due if stamp - self.due <= period else stamp) + period
        return True


class TopicRecorder:
    """Subscribes to topics and writes what comes, in the order of arrival; `collect` has to be called often."""

    def __init__(
        self,
        transport: Transport,
        folder: Path,
        topics: Sequence[Topic],
        *,
        about: About | None = None,
        after: LeftOff | None = None,
        ready: Callable[[Self], None] = lambda _: None,
    ) -> None:
        """Begin a recording, or go on `after` where one was cut off: what is missing since is noted in it.

        `ready` is called when all are listened to, before a file is made; an error of its ends it.
        """
        self._after = after
        self._kept: list[_Kept] = []
        self._transport, self._begin = transport, transport.steady()
        self._set = transport.clock.set_by()  # [ns]
        self._collected: int | None = None  # [ns] when last
        self.remarks: list[str] = []  # on the machine's clock, and stalls of this program
        try:
            for topic in topics:
                source = RAVENSTATE.name if topic.name == RAVENSTATE_100HZ.name else topic.name
                subscription = transport.subscribe(source, topic.type, depth=QUEUE_DEPTH)
                self._kept.append(_Kept(topic, subscription, TopicCount(topic.name)))
            ready(self)
            named = [JournalTopic(t.name, t.type) for t in topics]
            self.journal = JournalWriter(folder, named, about, after=after)
        except BaseException:
            self._end_subscriptions()
            raise

    def silent(self, names: Sequence[str]) -> str:
        """Return the names of these topics that are still missing, as text; empty if all have come."""
        there = {kept.topic.name for kept in self._kept if kept.count.came or len(kept.subscription)}
        return ", ".join(name for name in names if name not in there)

    def require(self, names: Sequence[str]) -> None:
        """Refuse a recording of which one of these topics never came."""
        if silent := self.silent(names):
            counts = ", ".join(f"{count.name}: {count.came}" for count in self.counts)
            raise RecordingError(f"recording: nothing came of {silent}; {counts}")

    def pass_over(self) -> None:
        """Drop what has arrived since the last call: a robot on its way to where a recording goes on."""
        for kept in self._kept:
            kept.subscription.forget()

    def collect(self) -> int:
        """Write what has arrived since the last call; return how many messages were kept."""
        self._note_clock()
        stood_still = self._note_stall()
        chosen: list[tuple[int, _Kept, Message]] = []
        for kept in self._kept:
            count = kept.count
            for message, arrival in kept.subscription.take():
                if count.came:
                    gap = (arrival - kept.last) / SECOND
                    count.longest_gap = max(count.longest_gap, gap)
                    if gap > max(SILENCE_S, 5.0 / kept.topic.rate) and not stood_still:
                        at = (kept.last - self._begin) / SECOND
                        self._note(f"topic {count.name}: no message for {gap:.1f} s, {at:.1f} s after the start")
                count.came += 1
                kept.last = arrival
                if kept.takes(getattr(message, kept.topic.header).stamp or arrival):
                    chosen.append((arrival, kept, message))
            count.lost = kept.subscription.overflowed + kept.subscription.damaged
        chosen.sort(key=lambda one: one[0])
        if self._after is not None and chosen:
            self.journal.note(self._after.gap(chosen[0][0]))
            self._after = None
        for arrival, kept, message in chosen:
            seq = getattr(message, kept.topic.header).seq
            self.journal.append(kept.topic.name, arrival, codec(kept.topic.type).encode(message, seq))
            kept.count.kept += 1
        return len(chosen)

    @property
    def counts(self) -> tuple[TopicCount, ...]:
        """Counts of each topic."""
        return tuple(kept.count for kept in self._kept)

    def problems(self) -> list[str]:
        """Return the topics of which nothing came, or not all was collected, and remarks on clock and stalls."""
        return [note for count in self.counts if (note := count.note()) is not None] + self.remarks

    def note_end(self, error: BaseException, place: float) -> None:
        """Note who ended the recording `place` [s] into its motion: this program, the robot or the network."""
        who = "this program"
        if isinstance(error, NotReadyError):
            who = "the robot"
        elif isinstance(error, TransportError):
            is_there = any(self._transport.connections(kept.topic.name).publishers for kept in self._kept)
            is_gone = self._transport.is_up() and not is_there
            who = "a robot that is gone" if is_gone else "the network, or a stalled robot,"
        self._note(f"{who} ended it, {place:.1f} s into the motion: {str(error) or 'Ctrl-C'}")

    def close(self) -> None:
        """Finish the recording; a second time does nothing."""
        self._end_subscriptions()
        self.journal.close()

    def _note_clock(self) -> None:
        """Note in the recording that the machine's clock was set; messages come in by a clock that was not."""
        by = self._transport.clock.set_by()
        step = (by - self._set) / SECOND
        if abs(step) < _CLOCK_SET_S:
            return
        at, self._set = (self._transport.steady() - self._begin) / SECOND, by
        self._note(
            f"the machine's clock was set by {step:+.3f} s, {at:.1f} s after the start; arrival times continue on "
            "the old clock, and nothing is lost"
        )

    def _note_stall(self) -> bool:
        """Note that this program stood still, and return it: peers lose what does not wait for it in their queues."""
        now, last = self._transport.steady(), self._collected
        self._collected = now
        if last is None or (stood := (now - last) / SECOND) <= SILENCE_S:
            return False
        at = (last - self._begin) / SECOND
        self._note(f"the recorder stalled for {stood:.1f} s, {at:.1f} s after the start; messages may be missing")
        return True

    def _note(self, remark: str) -> None:
        self.remarks.append(remark)
        self.journal.note(remark)

    def _end_subscriptions(self) -> None:
        for kept in self._kept:
            kept.subscription.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self.collect()
        finally:
            self._end_subscriptions()
            self.journal.__exit__(kind, error, trace)


class RecordedTopics(NamedTuple):
    """A recording that has ended."""

    counts: tuple[TopicCount, ...]
    seconds: float
    ended_by: str  # Ctrl-C or a signal's name, before its time was over; else empty


def record_topics(
    transport: Transport,
    folder: Path,
    topics: Sequence[Topic],
    seconds: float,
    *,
    about: About | None = None,
    after: LeftOff | None = None,
    required: Sequence[str] = (),
    progress: Progress = silent,
) -> RecordedTopics:
    """Record topics of a robot into a journal.

    Args:
        seconds: Duration [s].
        after: Where an interrupted recording was cut, to continue it.
        required: Names of topics that must deliver messages.
    """
    if not seconds > 0.0:
        raise InputError(f"recording: expected more than 0 s, got {seconds}")
    begin, ended_by = transport.steady(), ""
    with TopicRecorder(transport, folder, topics, about=about, after=after) as recorder:
        try:
            while (elapsed := (transport.steady() - begin) / SECOND) < seconds:
                transport.sleep(min(PERIOD_S, seconds - elapsed))
                recorder.collect()
                progress(elapsed / seconds)
        except KeyboardInterrupt as stop:  # of a signal it is the name
            ended_by = str(stop) or "Ctrl-C"
        took = (transport.steady() - begin) / SECOND
        recorder.collect()
        recorder.require(required)
    progress(1.0)
    return RecordedTopics(recorder.counts, took, ended_by)


def left_off(
    folder: Path, about: About, topics: Sequence[Topic], now: int, along: "Along | None" = None
) -> LeftOff | None:
    """Return the point at which a recording of the same kind was interrupted; None if none can be continued.

    Args:
        now: Present time [ns].
        along: Motion in which the recorded part is located.
    """
    if not is_journal(folder):
        return None
    try:
        reader = JournalReader(folder)
    except FileFormatError:  # killed at its very begin
        return None
    # as it comes back from a file
    ours = About.from_json(about.as_json().encode(), str(folder))
    if reader.about != ours or {t.name for t in reader.topics} != {t.name for t in topics}:
        return None
    interrupted = reader.left_off()
    if interrupted is None or interrupted.last >= now:
        return None
    return interrupted if along is None else interrupted._replace(begins=along.reached(reader))


class Along(NamedTuple):
    """A motion, and how a recording tells how far along it the robot is."""

    motion: Trajectory
    topic: Topic  # that has the setpoint
    setpoint: Callable[[Message], Floats]  # of its messages, (k,) [rad|m] of the motion's joints

    def reached(self, reader: JournalReader) -> float:
        """Return the length of the recorded part of the motion [s], by its setpoints since the last resumption."""
        run, decode = reader.last_run(), codec(self.topic.type).decode
        looks, newest, last = list[tuple[int, bytes]](), None, 0
        for name, arrival, data in chain.from_iterable(part.messages() for part in run):
            last = arrival
            if name == self.topic.name:
                newest = arrival, data
                if not looks or arrival - looks[-1][0] > _LOOK_NS:
                    looks.append(newest)
        place = _ReportedPlace(self.motion, _STEP_S, run[0].begins or 0.0)
        if newest is None:
            return place.time
        before = looks[0][0]
        for arrival, data in [*looks, newest]:
            place.update(self.setpoint(decode(data)), place.time + (arrival - before) / SECOND + _SLACK_S)
            before = arrival
        # other topics have come since
        behind = min((last - before) / SECOND, 1.0 / self.topic.rate) if place.is_moving else 0.0
        return min(place.time + behind, self.motion.duration)


_COLLECT_TICKS = 20  # ticks between two looks at what has come
_STEP_S, _SLACK_S = 0.002, 1.0  # [s] of a motion between places that are compared, and a robot may catch up by at once
_LOOK_NS = SECOND // 5  # [ns] between setpoints that are looked at


def record_motion(
    client: CrtkClient, recorder: TopicRecorder, motion: GoneOn, *, joints: Sequence[str], progress: Progress
) -> None:
    """Drive joints of a homed, enabled robot along what is left of a motion, and record; note what ends it early."""
    start, moved = motion(0.0).q, [client.joint_names.index(name) for name in joints]
    move_to(client, start, joints=joints)
    sent = np.array(client.setpoint_js().q)
    sent[moved] = start
    arrive(client, sent)
    place = _ReportedPlace(motion, client.period)
    tick, begun, at = 0, False, motion.begin
    remaining = motion.duration / (motion.duration + motion.begin)

    def observe(_: JointState, reference: Reference, time: float) -> None:
        nonlocal tick, begun, at, sent
        tick, sent = tick + 1, reference.q
        if tick % _COLLECT_TICKS and (begun or time < motion.lead):
            return
        at = motion.begin - motion.lead + place.update(client.setpoint_js().q[moved], time)
        if not begun:
            recorder.pass_over()
            begun = at >= motion.begin and time > 0.0
            return
        recorder.collect()

    def share(done: float) -> None:
        progress(1.0 - (1.0 - done) * remaining)

    try:
        run_trajectory(client, motion, joints=joints, observe=observe, progress=share)
    except (KeyboardInterrupt, CatenaryError) as error:
        if begun:
            recorder.collect()
        recorder.note_end(error, max(at, motion.begin))
        raise
    arrive(client, sent)
    recorder.collect()


class _ReportedPlace:
    """How far along a motion a robot is by the setpoints that it reports: what was sent may still be on its way."""

    def __init__(self, motion: Trajectory, step: float, time: float = 0.0) -> None:
        self._motion, self._step, self.time = motion, step, time
        self.is_moving = False  # since the last look

    def update(self, setpoint: Floats, sent: float) -> float:
        """Return the time [s] of the motion at which the setpoint (k,) is nearest, `sent` at most; it only grows."""
        times = np.arange(self.time, sent + 0.5 * self._step, self._step)
        if len(times):
            away = np.abs(self._motion.sample(times)[0] - setpoint).max(axis=1)
            nearest = float(times[np.argmin(away)])
            self.is_moving, self.time = nearest > self.time, nearest
        return self.time
