"""Watch a gravity sensor, live, simulated or recorded, and report what it measured and what was wrong; calibrate it.

The calibration is the tumble, by hand and then on the robot, or it is from a recording of a sensor's rests.
"""

import itertools
import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats
from catenary.control.loop_report import GravityReport, GravityTally
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError, SensorError
from catenary.recording.import_formats.imu_recording import ImuRecording
from catenary.recording.import_formats.table_files import read_rows
from catenary.robots.model import RobotModel
from catenary.sensing.gravity_vector import (
    GravityReading,
    Kind,
    Mailbox,
    ReadingStatus,
    SensorSample,
    tilt_angle,
    tilt_of,
    tilted_gravity,
)
from catenary.sensing.gyro_hypotheses import compare, evidence
from catenary.sensing.gyro_prediction import RestRate
from catenary.sensing.imu import SensedGravity
from catenary.sensing.imu_faults import Fault
from catenary.sensing.mounting import Mounting, TumbleSection
from catenary.sensing.tumble import SensorFit, align, fit_orientations, fit_tumble, level_and_tilts
from catenary.simulation.base_motion import FixedBase
from catenary.simulation.sensors import SensorModel, SimulatedSensor
from catenary.spatial import STANDARD_GRAVITY

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
    """Return the samples of a simulated sensor.

    Args:
        paced: Whether they come in real time; otherwise in the sensor's own.
    """
    return Feed(sensor.mailbox, sensor.model.has_gyroscope, deliver=sensor.advance, paced=paced)


def replay_feed(recording: ImuRecording) -> Feed:
    """Return a recording's samples, which come at the times of their stamps, as fast as they are asked for."""
    mailbox, rate = Mailbox(), recording.rate
    # a stamp that goes back arrives when it was recorded, behind those before it
    arrival = np.maximum.accumulate(recording.time)
    pending = deque(range(len(arrival)))

    def deliver(now: float) -> None:
        while pending and arrival[pending[0]] <= now:
            k = pending.popleft()
            stamp = float(recording.time[k])
            if rate is not None:
                mailbox.put(stamp, rate[k], Kind.ANGULAR_RATE)
            mailbox.put(stamp, recording.force[k], Kind.SPECIFIC_FORCE)

    return Feed(mailbox, rate is not None, deliver=deliver)


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
    """Read a gravity source every 5 ms, and summarise.

    Args:
        duration: Time [s]; infinity runs until Ctrl-C.
        show: Called with each reading and the time since the start [s].
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
    """Wait until a sensor is still, and return its mean readings.

    Args:
        seconds: Time that it must be still [s].
        patience: Longest wait [s], then SensorError.
    """
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


BLOCK_S = 0.25  # [s] over which a recorded sensor is still or not
MIN_REST_S = 1.0  # [s] of a rest
_SHAKEN_M_S2 = 0.2  # [m/s2] that hands leave which turn a sensor
_UNKNOWN = Mounting()


class Attitude(NamedTuple):
    """How a person holds or mounts the sensor for a reading."""

    name: str
    instruction: str
    # the vertical in the sensor's printed axes, or, when mounted, where a simulated base has it
    up: tuple[float, float, float]
    mounted: bool = False


_HALF = 0.57735  # 1 / sqrt(3)
_SIDES = (
    Attitude("+x up", "hold the sensor still with its x axis up", (1, 0, 0)),
    Attitude("-x up", "turn it over: x axis down", (-1, 0, 0)),
    Attitude("+y up", "its y axis up", (0, 1, 0)),
    Attitude("-y up", "its y axis down", (0, -1, 0)),
    Attitude("+z up", "its z axis up", (0, 0, 1)),
    Attitude("-z up", "its z axis down", (0, 0, -1)),
)
_SLANTED_ATTITUDES = (
    Attitude("slanted 1", "slanted, any way you like", (_HALF, _HALF, _HALF)),
    Attitude("slanted 2", "slanted another way", (-_HALF, _HALF, -_HALF)),
    Attitude("slanted 3", "slanted a third way", (_HALF, -_HALF, -_HALF)),
)
_TILT = "by 10 degrees or more"
_MOUNTED_ATTITUDES = (
    Attitude("level", "mount it on the robot's base; base level", (0, 0, 1), mounted=True),
    Attitude("rolled", f"tilt the base about its x axis {_TILT}, y side up", (0, 0.34202, 0.93969), mounted=True),
    Attitude(
        "pitched", f"level again, then tilt it about its y axis {_TILT}, x side down", (-0.34202, 0, 0.93969),
        mounted=True,
    ),
)  # fmt: skip
ATTITUDES = (*_SIDES, *_SLANTED_ATTITUDES, *_MOUNTED_ATTITUDES)


@dataclass(frozen=True)
class TumbleOutcome:
    """Result of a tumble: a mounting, and the faults that forbid its use."""

    mounting: Mounting
    section: TumbleSection
    faults: tuple[str, ...]


def run_tumble(
    read: Callable[[Attitude], StillReading], *, start: Mounting = _UNKNOWN, taken: Sequence[SensorSample] = ()
) -> TumbleOutcome:
    """Calibrate a sensor by a sequence of attitudes: bias, scale, rotation and the gyroscope's bias.

    The sides show a wrong sign or order of axes against those printed on the sensor; the slanted attitudes leave a
    residual; the mounted ones give the rotation, from the base's level and two tilts that need no measurement.

    Args:
        read: Returns the readings in an attitude.
        start: What is known beforehand: position, ranges, name.
        taken: All samples, also between the attitudes, whose turns check the gyroscope.
    """
    readings = {attitude.name: read(attitude) for attitude in ATTITUDES}
    by_hand = np.array([readings[s.name].force for s in (*_SIDES, *_SLANTED_ATTITUDES)])
    sides = np.array([s.up for s in _SIDES], dtype=float)
    fit = fit_tumble(by_hand)
    faults = list(fit.faults)
    # a unit that is wrong says nothing about axes; sides that are missing may
    if not fit.faults or fit.missing:
        faults += [f"on its sides: {f}" for f in align(by_hand[:6], sides, expected=np.eye(3)).faults]
    mounted = [readings[s.name].force for s in _MOUNTED_ATTITUDES]
    corrected = [(y - fit.bias) / fit.scale for y in mounted]
    rows, up = level_and_tilts(*corrected)
    rough = align(rows[:2], up[:2]).rotation  # two directions never show a mirror; the third then does
    alignment = align(rows, up, expected=rough)
    if not faults and alignment.faults:  # the sensor is right, so the base was tilted otherwise
        faults += [f"on the base: was it tilted as asked, y side up, then x side down? {f}" for f in alignment.faults]
    checked = False
    if not faults and taken:
        faults, checked = check_gyroscope(_as_recording(taken))
    fit = replace(fit, rotation=alignment.rotation, faults=tuple(faults))
    return _outcome(start, list(readings.values()), fit, alignment.residual_deg, checked=checked)


def _outcome(
    start: Mounting, still: list[StillReading], fit: SensorFit, degrees: float | None = None, *, checked: bool = False
) -> TumbleOutcome:
    """Return a mounting as it was fitted, with the rates at rest as the gyroscope's bias, and how well it is known."""
    rates = [s.rate for s in still if s.rate is not None]
    known = replace(start, rotation=fit.rotation, bias=fit.bias, scale=fit.scale, checked=checked)
    section = TumbleSection(
        readings=len(still), residual_m_s2=None if np.isnan(fit.residual) else fit.residual,
        rotation_residual_deg=degrees,
    )  # fmt: skip
    return TumbleOutcome(replace(known, rate_bias=np.mean(rates, axis=0)) if rates else known, section, fit.faults)


def _as_recording(taken: Sequence[SensorSample]) -> ImuRecording:
    """Return samples as a recording, the rates as of the accelerometer's stamps."""
    turning, force = (
        np.array([(s.stamp, *s.vector) for s in taken if (s.kind is Kind.ANGULAR_RATE) is angular]).reshape(-1, 4)
        for angular in (True, False)
    )
    sign = -1.0 if any(s.kind is Kind.FREE_FALL for s in taken) else 1.0
    rate = [np.interp(force[:, 0], turning[:, 0], turning[:, k]) for k in (1, 2, 3)] if len(turning) else None
    return ImuRecording(force[:, 0] - force[0, 0], sign * force[:, 1:], None if rate is None else np.column_stack(rate))


def simulated_reader(model: SensorModel, *, seed: int = 0) -> Callable[[Attitude], StillReading]:
    """Return a function that reads a simulated sensor in an attitude, as if held by hand.

    Args:
        model: Errors and noise of the sensor.
    """

    def read(attitude: Attitude) -> StillReading:
        up = np.array(attitude.up, dtype=float)
        gravity = -STANDARD_GRAVITY * up / np.linalg.norm(up)
        if not attitude.mounted:
            gravity = model.mounting.rotation @ gravity
        number = [s.name for s in ATTITUDES].index(attitude.name)
        sensor = SimulatedSensor(FixedBase(*tilt_of(gravity)), Mailbox(), model, seed=seed + number)
        return read_still(simulated_feed(sensor))

    return read


def rests(recording: ImuRecording) -> list[StillReading]:
    """Return the means of all pieces of a second or more in which a sensor stood still, in order.

    A rest's first and last quarter of a second are left out of the means: a turn that begins or ends there slowly does
    not show in gravity, and does in the rates.
    """
    readings: list[StillReading] = []
    for rows in rest_rows(recording):
        time = recording.time[rows]
        inner = rows[(time >= time[0] + BLOCK_S) & (time <= time[-1] - BLOCK_S)]
        rate = None if recording.rate is None else np.median(recording.rate[inner], axis=0)
        readings.append(StillReading(recording.force[inner].mean(axis=0), rate))
    return readings


def rest_rows(recording: ImuRecording) -> list[NDArray[np.intp]]:
    """Return the rows of each piece of a second or more in which a sensor stood still."""
    time, numbers = recording.time, np.floor(recording.time / BLOCK_S).astype(int)
    pieces: list[list[int]] = [[]]
    for number in np.unique(numbers):
        here = np.flatnonzero(numbers == number).tolist()
        force, rows = recording.force[here], pieces[-1]
        still = len(here) >= 3 and np.isfinite(force).all() and (np.std(force, axis=0) <= STILL).all()
        if rows and (
            not still
            or numbers[rows[-1]] < number - 1
            or np.abs(force.mean(axis=0) - recording.force[rows].mean(axis=0)).max() > STILL
        ):
            pieces.append([])
        if still:
            pieces[-1] += here
    return [np.array(rows) for rows in pieces if rows and time[rows[-1]] - time[rows[0]] >= MIN_REST_S - BLOCK_S]


def up_of_tilts(tilts_deg: ArrayLike) -> Floats:
    """Return the direction of up in base axes (N, 3) of a robot turned by roll, then pitch, (N, 2) [deg]."""
    return np.array([-tilted_gravity(*tilt) / STANDARD_GRAVITY for tilt in np.deg2rad(tilts_deg).tolist()])


def read_orientations(path: Path, model: RobotModel | None = None, frame: str | None = None) -> Floats:
    """Read a resting sensor's orientations from a table: direction of up in the sensor's base (N, 3).

    It has columns roll_deg and pitch_deg of the whole robot, or the joints [rad|m] by name of the arm, on a level base,
    that carries the sensor.

    Args:
        frame: Frame that carries the sensor; the tip when None.
    """
    if model is None:
        return up_of_tilts(read_rows(path, ("roll_deg", "pitch_deg")))
    return forward_kinematics(model, read_rows(path, model.joint_names), frame).rotation[:, 2, :]  # R^T z


def calibrate_replay(recording: ImuRecording, up: Floats, *, start: Mounting = _UNKNOWN) -> TumbleOutcome:
    """Calibrate mounting and bias of a recorded sensor that rested, a second or more each, in known orientations.

    Args:
        up: Direction of up in each orientation, in order (N, 3).
        start: What is known beforehand: position, ranges, name.
    """
    still = rests(recording)
    if len(still) != len(up):
        raise InputError(
            f"the recording has {len(still)} rests of {MIN_REST_S:g} s or more, the orientations are {len(up)}: "
            "expected as many, in the same order"
        )
    fit = fit_orientations([s.force for s in still], up)
    if np.isnan(fit.residual):
        return _outcome(start, still, replace(fit, rotation=start.rotation, bias=start.bias, scale=start.scale))
    wrong, checked = check_gyroscope(recording)
    return _outcome(start, still, replace(fit, faults=(*fit.faults, *wrong)), checked=checked)


def check_gyroscope(recording: ImuRecording) -> tuple[list[str], bool]:
    """Return the faults of a recorded gyroscope by the turns between rests, and whether they determine it."""
    if recording.rate is None:
        return [], False
    rows, sums = rest_rows(recording), evidence(np.zeros(3), [math.inf])
    for before, after in itertools.pairwise(rows):
        # from within one rest into the next, as gravity of that place is known there
        part = slice(before[-1] - len(before) // 4, after[0] + len(after) // 4)
        time, rate = recording.time[part], recording.rate[part]
        good = np.isfinite(recording.force[part]).all(axis=1) & np.isfinite(rate).all(axis=1)
        good &= np.diff(time, prepend=-np.inf) > 0.0
        time, rate = time[good], rate[good]
        if len(time) > 2 and np.diff(time).max() < BLOCK_S:
            sums.interrupt()
            for stamp, turning, force in zip(time.tolist(), rate, recording.force[part][good], strict=True):
                sums.add_rate(stamp, turning)
                sums.add_gravity(stamp, -force)
    comparison = compare(sums, drift=_SHAKEN_M_S2)
    if comparison.fault is not Fault.NONE:
        return [f"{comparison.fault.message}; {comparison.remedy}".rstrip("; ")], False
    noise = np.median([np.std(np.diff(recording.rate[r], axis=0), axis=0) for r in rows], axis=0) / np.sqrt(2.0)
    if float(np.linalg.norm(noise)) > RestRate.MAX_NOISE:
        return [f"{Fault.RATE_UNIT.message}: its noise at rest is {np.linalg.norm(noise):.2g}"], False
    return [], comparison.is_right
