"""Watch a gravity sensor, live, simulated or recorded, and report what it measured and what was wrong."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.control.loop_report import GravityReport, GravityTally
from catenary.devices.accelerometer import SerialAccelerometer
from catenary.errors import InputError, SensorError
from catenary.recording.import_formats.imu_recording import ImuRecording
from catenary.sensing.imu import SensedGravity
from catenary.sensing.vector import GravityReading, Kind, Mailbox, ReadingStatus, SensorSample, tilt_angle, tilt_of
from catenary.simulation.sensors import SimulatedSensor

_READ_EVERY = 0.005  # [s]
SETTLE = 0.1  # [s] for the first samples
STILL = 0.15  # [m/s2] standard deviation of an axis at rest: three times a cheap sensor's noise


@dataclass
class Feed:
    """Source of samples, and the clock that stamps them [s]: this machine's, or that of what delivers them."""

    mailbox: Mailbox  # where samples arrive
    has_gyroscope: bool = False  # angular rates are among them
    link: Callable[[], dict[str, Any]] = dict  # counts them on their line
    deliver: Callable[[float], None] | None = None  # brings those up to a time [s]; None: they come by themselves
    paced: bool = False  # what is delivered comes in real time
    taken: list[SensorSample] = field(default_factory=list)  # by `read_still`, also between its readings
    delivered: float = 0.0  # [s]

    def now(self) -> float:
        """Return the time [s]."""
        return time.monotonic() if self.deliver is None else self.delivered

    def wait(self, seconds: float) -> None:
        """Let time pass, and samples come."""
        if self.deliver is not None:
            self.delivered += seconds
            self.deliver(self.delivered)
        if self.deliver is None or self.paced:
            time.sleep(seconds)


def simulated_feed(sensor: SimulatedSensor, *, paced: bool = False) -> Feed:
    """Return the samples of a simulated sensor, in its own time or, when paced, in real time."""
    return Feed(sensor.mailbox, sensor.model.has_gyroscope, deliver=sensor.advance, paced=paced)


def replay_feed(recording: ImuRecording) -> Feed:
    """Return a recording's samples, which come at the times of their stamps, as fast as they are asked for."""
    mailbox, rate = Mailbox(), recording.rate
    # a stamp that goes back arrives when it was recorded, behind those before it
    arrival = np.maximum.accumulate(recording.time)
    left = deque(range(len(arrival)))

    def deliver(now: float) -> None:
        while left and arrival[left[0]] <= now:
            k = left.popleft()
            stamp = float(recording.time[k])
            if rate is not None:
                mailbox.put(stamp, rate[k], Kind.ANGULAR_RATE)
            mailbox.put(stamp, recording.force[k], Kind.SPECIFIC_FORCE)

    return Feed(mailbox, rate is not None, deliver=deliver)


def serial_feed(device: SerialAccelerometer) -> Feed:
    """Return the samples of a board on a serial line that has said what it is."""
    angular = device.hello is not None and device.hello.has_gyroscope
    return Feed(device.mailbox, angular, link=lambda: asdict(device.counts))


@dataclass(frozen=True)
class SenseSummary:
    """Measurements of a sensor over some time, in base axes."""

    duration: float  # [s]
    reading: GravityReading  # the last
    mean: Floats  # (3,) [m/s2] while it was live; NaN when it never was
    spread: Floats  # (3,) [m/s2] standard deviation
    gravity: GravityReport  # readings by status, faults, messages
    link: dict[str, Any]
    base: str  # the frame whose axes these are
    remedy: str = ""  # what mends a gyroscope that does not turn as gravity does

    @property
    def was_live(self) -> bool:
        """Gravity was measured, and the reading trusted, at least once."""
        return "live" in self.gravity.ticks

    def as_data(self) -> dict[str, Any]:
        """Return plain data, in SI and degrees where the name says so."""
        angles = np.degrees([*tilt_of(self.reading.gravity), tilt_angle(self.reading.gravity)]).tolist()
        return {
            "duration_s": self.duration,
            "status": self.reading.status.value,
            "base": self.base,
            "gravity": self.reading.gravity,
            "magnitude": float(np.linalg.norm(self.reading.gravity)),
            "age_s": self.reading.age,
            "tilt_deg": dict(zip(("roll", "pitch", "from_level"), angles, strict=True)),
            "angular_velocity": self.reading.base_rates[0],
            "angular_acceleration": self.reading.base_rates[1],
            "mean": self.mean,
            "standard_deviation": self.spread,
            "readings": dict(self.gravity.ticks),
            "faults": dict(self.gravity.faults),
            "messages": list(self.gravity.messages),
            "remedy": self.remedy,
            "largest_age_s": self.gravity.largest_age,
            "link": self.link,
        }


def watch(
    feed: Feed,
    source: SensedGravity,
    duration: float,
    *,
    show: Callable[[GravityReading, float], None] = lambda reading, time: None,
) -> SenseSummary:
    """Read a source every 5 ms for a duration [s]; infinity goes on until Ctrl-C, and then sums up.

    `show` is called with each reading and the time since the start [s].
    """
    if not duration > 0.0:
        raise InputError(f"duration: expected more than 0 s, got {duration}")
    tally = GravityTally()
    sums, count = np.zeros((2, 3)), 0
    feed.wait(SETTLE)
    begin = feed.now()
    reading = source.read(begin)
    try:
        while feed.now() - begin < duration:
            feed.wait(_READ_EVERY)
            reading = source.read(feed.now())
            tally.add(reading)
            if reading.status is ReadingStatus.LIVE:
                sums += [reading.gravity, reading.gravity**2]
                count += 1
            show(reading, feed.now() - begin)
    except KeyboardInterrupt:
        pass  # the person has seen enough
    mean, square = sums / count if count else np.full((2, 3), np.nan)
    return SenseSummary(
        duration=feed.now() - begin,
        reading=reading,
        mean=mean,
        spread=np.sqrt(np.maximum(square - mean**2, 0.0)),
        gravity=tally.report(),
        link=feed.link(),
        base=source.mounting.base,
        remedy=source.remedy,
    )


def _take_all(feed: Feed) -> list[SensorSample]:
    samples = list(iter(feed.mailbox.take, None))
    feed.taken += samples
    return samples


@dataclass(frozen=True)
class StillReading:
    """Means of a sensor at rest, in its own axes."""

    force: Floats  # (3,) [m/s2]
    rate: Floats | None  # (3,) [rad/s]


def read_still(feed: Feed, *, seconds: float = 1.0, patience: float = 20.0) -> StillReading:
    """Wait until the sensor is still for a while, and return its means."""
    _take_all(feed)  # from before
    begin, noise = feed.now(), np.full(3, np.nan)
    forces, rates, start = list[Floats](), list[Floats](), begin
    while feed.now() - begin < patience:
        feed.wait(0.02)
        for sample in _take_all(feed):
            vector = np.array(sample.vector)
            if sample.kind is Kind.ANGULAR_RATE:
                rates.append(vector)
            elif np.isfinite(vector).all():
                forces.append(vector if sample.kind is Kind.SPECIFIC_FORCE else -vector)
        if feed.now() - start < seconds:
            continue
        if forces:
            noise = np.std(forces, axis=0)
            if len(forces) >= 10 and (noise <= STILL).all():
                return StillReading(np.mean(forces, axis=0), np.mean(rates, axis=0) if rates else None)
        forces, rates, start = [], [], feed.now()
    if not np.isfinite(noise).all():
        raise SensorError(f"no samples within {patience:g} s")
    raise SensorError(
        f"the sensor did not stand still within {patience:g} s: its readings vary by {noise.max():.2f} m/s2, "
        f"expected below {STILL:g}"
    )
