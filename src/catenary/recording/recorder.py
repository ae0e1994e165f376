"""Turns a robot's telemetry into the messages it would publish, at each topic's rate, and writes the journal.

Telemetry is a mapping from the names of the topics' columns to numbers in SI: of a RAVEN-II raven_state's fields (jpos
and tau at least; others are zero where missing), `ext_jpos` (3,), `joint_enc` (3,) and `measured_js` (7,), with
`_velocity` and `_effort` where known. A topic whose columns a robot lacks altogether is left out (`left_out`).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from catenary.arrays import Floats, Integers, as_array
from catenary.errors import InputError
from catenary.recording.journal import MAX_FILE_BYTES, About, JournalTopic, JournalWriter
from catenary.recording.layout import encode
from catenary.topics import SECOND, Topic

_JITTER_PERIODS = 0.05  # of a topic's period, standard deviation; simulated recordings only
_MIN_PERIODS = 0.25  # of a topic's period between two messages
_BLOCK_TICKS = 16384  # ticks that are made into messages at once


class Throttle:
    """Chooses the ticks at which a topic's messages are due: about one a period, with jitter as over ROS.

    Intervals are period (1 + 0.05 N(0, 1)), a quarter of it at least, drawn in blocks: in ticks or at once the same.
    """

    def __init__(self, rate: float, rng: np.random.Generator) -> None:
        """Begin at time 0."""
        self._period, self._rng = 1.0 / rate, rng
        self._due: Floats = np.zeros(0)  # instants to come, ascending
        self._last: float | None = None

    def pick(self, time: Floats) -> Integers:
        """Return the ticks at which a message goes out: the first at or after each instant; times (N,) [s] ascend."""
        if self._last is None:
            self._last = float(time[0])  # the first tick is recorded
            self._due = np.array([self._last])
        while self._last <= time[-1]:
            steps = np.maximum(_MIN_PERIODS, 1.0 + _JITTER_PERIODS * self._rng.standard_normal(256)) * self._period
            instants = self._last + np.cumsum(steps)
            self._due = np.concatenate([self._due, instants])
            self._last = float(instants[-1])
        passed = int(np.searchsorted(self._due, time[-1], side="right"))
        ticks = np.searchsorted(time, self._due[:passed], side="left")
        self._due = self._due[passed:]
        return np.unique(ticks)


class Recorder:
    """Records telemetry, stamped `start_ns` plus its time, tick by tick or whole; the disk is not written in a tick."""

    def __init__(
        self,
        folder: Path,
        topics: Sequence[Topic],
        available: Iterable[str],
        rng: np.random.Generator,
        *,
        about: About | None = None,
        start_ns: int = 0,
        max_bytes: int = MAX_FILE_BYTES,
    ) -> None:
        """Begin a journal of topics whose columns are `available`; `rng` draws the instants of their messages."""
        have = frozenset(available)
        self.topics = tuple(topic for topic in topics if _required(topic) <= have)
        lacks = {t.name: sorted(_required(t) - have) for t in topics if t not in self.topics}
        self.left_out = tuple(f"{name}: telemetry lacks {', '.join(columns)}" for name, columns in lacks.items())
        if not self.topics:
            raise InputError(f"recording: telemetry has no topic's columns: {'; '.join(self.left_out)}")
        missing = {t.name: [c.name for c in t.columns if c.name not in have] for t in self.topics}
        zero = {name: columns for name, columns in missing.items() if columns}
        about = about or About()
        about = replace(about, configuration={**about.configuration, "not_in_telemetry": zero})
        streams = rng.spawn(len(topics))  # a topic's instants do not depend on which others are recorded
        pairs = zip(topics, streams, strict=True)
        self._throttles = [Throttle(topic.rate, stream) for topic, stream in pairs if topic in self.topics]
        self._sent = [0] * len(self.topics)
        self._start = start_ns
        self._last_time = -np.inf
        self.journal = JournalWriter(
            folder, [JournalTopic(t.name, t.type) for t in self.topics], about, max_bytes=max_bytes
        )

    def observe_many(self, time: Floats, telemetry: Mapping[str, Floats]) -> None:
        """Take N ticks' telemetry, each column (N, width) or (N,), in one go; may be called again with what follows."""
        time = as_array("time", time, (None,))
        if len(time) == 0:
            return
        if time[0] <= self._last_time or (np.diff(time) <= 0.0).any():
            raise InputError("recording: time must advance from tick to tick")
        for name, values in telemetry.items():
            if len(values) != len(time):
                raise InputError(f'telemetry "{name}": {len(values)} rows, but {len(time)} ticks')
        self._last_time = float(time[-1])
        picked = [throttle.pick(time) for throttle in self._throttles]
        for first in range(0, len(time), _BLOCK_TICKS):
            self._write(time, telemetry, picked, first)

    def _write(self, time: Floats, telemetry: Mapping[str, Floats], picked: list[Integers], first: int) -> None:
        """Write the messages of the ticks from `first` on, in the order of ticks, within one of topics."""
        ticks, owners, parts = [], [], []
        for i, (topic, all_ticks) in enumerate(zip(self.topics, picked, strict=True)):
            chosen = all_ticks[slice(*np.searchsorted(all_ticks, (first, first + _BLOCK_TICKS)))]
            if len(chosen) == 0:
                continue
            columns = {c.name: telemetry[c.name][chosen] for c in topic.columns if c.name in telemetry}
            messages = encode(topic, self._stamps(time[chosen]), columns, first_seq=self._sent[i])
            self._sent[i] += len(chosen)
            size, block = messages.dtype.itemsize, messages.tobytes()
            parts += [block[at : at + size] for at in range(0, len(block), size)]
            ticks.append(chosen)
            owners.append(np.full(len(chosen), i))
        if not parts:
            return
        tick, owner = np.concatenate(ticks), np.concatenate(owners)
        stamps = self._stamps(time[tick])
        for message in np.lexsort((owner, tick)).tolist():
            self.journal.append(self.topics[owner[message]].name, int(stamps[message]), parts[message])

    def _stamps(self, time: Floats) -> Integers:
        return self._start + np.rint(time * SECOND).astype(np.int64)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: Any) -> None:
        self.journal.__exit__(*error)


def _required(topic: Topic) -> frozenset[str]:
    return frozenset(column.name for column in topic.columns if column.required)
