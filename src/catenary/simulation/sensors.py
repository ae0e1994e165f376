"""Simulated sensors on an arm's base: what an accelerometer or inertial unit reads there, and what goes wrong."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.plant import Plant
from catenary.sensing.mailbox import Kind, Mailbox
from catenary.sensing.mounting import Mounting
from catenary.simulation.base_motion import BaseSamples, BaseTimeline, MovingBase
from catenary.spatial import STANDARD_GRAVITY, rotation_about_x, rotation_about_z

FaultKind = Literal[
    "drop_out",
    "not_finite",
    "stuck",
    "wrong_sign",
    "axes_swapped",
    "saturated",
    "spikes",
    "jump",
    "unit_g",
    "unit_cm",
    "gravity_stripped",
    "wrong_scale",
    "stamp_backwards",
    "stamp_repeated",
    "stamp_future",
    "rates_drop_out",
    "rates_not_finite",
    "rates_stuck",
    "rates_in_deg",
]
FAULT_KINDS: tuple[str, ...] = get_args(FaultKind)
_KNOCKED = rotation_about_z(0.5) @ rotation_about_x(
    0.4
)  # of a sensor that came loose: no order of axes explains it


@dataclass(frozen=True)
class InjectedFault:
    """A fault of a sensor, for a while."""

    kind: FaultKind
    start: float  # [s]
    duration: float = math.inf  # [s]

    def __post_init__(self) -> None:
        if self.kind not in FAULT_KINDS:
            raise InputError(f'fault "{self.kind}": expected one of {", ".join(FAULT_KINDS)}')

    def holds(self, stamp: float) -> bool:
        """Return whether a sample taken at this time [s] is wrong."""
        return self.start <= stamp < self.start + self.duration


@dataclass(frozen=True)
class SensorModel:
    """How a sensor's readings differ from the truth; by default as of an MPU-6050 at 2 g and 250 deg/s."""

    rate_hz: float = 200.0
    # MPU-6000/6050 product specification rev. 3.4, tables 6.1 and 6.2
    noise: float = 400e-6 * 9.80665  # [m/s2/sqrt(Hz)]
    rate_noise: float = math.radians(0.005)  # [rad/s/sqrt(Hz)]
    resolution: float = 9.80665 / 16384.0  # [m/s2] of a count; 0 for none
    rate_resolution: float = math.radians(1.0 / 131.0)  # [rad/s]
    latency: float = 0.002  # [s] from the sample to its arrival
    has_gyroscope: bool = True
    # what it truly is like; what is told to the estimator may differ
    mounting: Mounting = field(
        default_factory=lambda: Mounting(acceleration_range=2.0 * 9.80665, rate_range=math.radians(250.0))
    )

    def __post_init__(self) -> None:
        if not 0.0 < self.rate_hz < math.inf:
            raise InputError(f"rate_hz: expected a positive rate, got {self.rate_hz}")
        for name in ("noise", "rate_noise", "resolution", "rate_resolution", "latency"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise InputError(f"{name}: expected zero or more, got {getattr(self, name)}")


def ideal_sensor(
    rate_hz: float, mounting: Mounting | None = None, *, has_gyroscope: bool = True
) -> SensorModel:
    """Return a sensor without noise, resolution, latency or end of range.

    Its samples repeat bit for bit on a base that stands still: give the estimator SensorRules(stuck_samples=0).
    """
    return SensorModel(rate_hz, 0.0, 0.0, 0.0, 0.0, 0.0, has_gyroscope, mounting or Mounting())


class SimulatedSensor:
    """Puts into a mailbox what a sensor on a moving base would send; `advance` delivers what is due.

    The base is anything with `sample`, such as the one that a plant stands on, or `TelemetryBase(plant)`.
    """

    def __init__(
        self,
        base: MovingBase,
        mailbox: Mailbox,
        model: SensorModel | None = None,
        *,
        faults: Sequence[InjectedFault] = (),
        seed: int = 0,
        start: float = 0.0,
    ) -> None:
        """Mount a sensor on a base.

        Args:
            base: What it is fixed to.
            mailbox: Where its samples go.
            model: What it is like; an MPU-6050 at the base's origin when None.
            faults: What goes wrong, and when.
            seed: Of its noise.
            start: Its first sample is taken then, or just after [s]; the plant's time, where that has gone by.
        """
        self.model = SensorModel() if model is None else model
        self.mailbox, self.faults = mailbox, tuple(faults)
        self._base = base
        self._timeline = (
            None if isinstance(base, TelemetryBase) else BaseTimeline(base, 1.0 / self.model.rate_hz)
        )
        self._rng = np.random.default_rng(seed)
        self._next = max(0, math.ceil(start * self.model.rate_hz - 1e-6))  # number of the next sample
        self._under_way: deque[tuple[float, float, Floats, Kind]] = deque()  # arrival, stamp, vector
        self._sent: dict[
            Kind, tuple[float, Floats]
        ] = {}  # the last sample of each kind, for faults that repeat it

    def advance(self, now: float) -> None:
        """Take all samples that are due at a time [s], and deliver those that have arrived by then."""
        model = self.model
        while self._next / model.rate_hz <= now + 1e-9:  # rounding of ticks
            self._sample(self._next / model.rate_hz)
            self._next += 1
        while self._under_way and self._under_way[0][0] <= now + 1e-9:
            _, stamp, vector, kind = self._under_way.popleft()
            self.mailbox.put(stamp, vector, kind)

    def _sample(self, stamp: float) -> None:
        model, mounting = self.model, self.model.mounting
        base = (
            self._base.sample(np.array([stamp]))
            if self._timeline is None
            else self._timeline.rows(self._next, 1)[0]
        )
        gravity, (omega, alpha, linear) = base.gravity[0], base.motion[0]
        p = mounting.position
        force = linear + np.cross(alpha, p) + np.cross(omega, np.cross(omega, p)) - gravity
        readings = [
            (
                Kind.SPECIFIC_FORCE,
                mounting.scale * (mounting.rotation.T @ force) + mounting.bias,
                (model.noise, model.resolution, mounting.acceleration_range),
            )
        ]
        if model.has_gyroscope:
            rate = mounting.rotation.T @ omega + mounting.rate_bias
            readings.append(
                (Kind.ANGULAR_RATE, rate, (model.rate_noise, model.rate_resolution, mounting.rate_range))
            )
        for kind, true, (noise, resolution, end) in readings:
            # white noise of that density, up to half the sampling rate
            vector = true + noise * math.sqrt(0.5 * model.rate_hz) * self._rng.standard_normal(3)
            self._send(stamp, vector, kind, resolution, end)

    def _send(self, stamp: float, vector: Floats, kind: Kind, resolution: float, end: float) -> None:
        arrival = stamp + self.model.latency
        before = self._sent.get(kind, (stamp, vector))
        vector = np.clip(vector, -end, end)
        if resolution > 0.0:
            vector = resolution * np.round(vector / resolution)
        for fault in self.faults:
            if fault.holds(stamp):
                spoilt = _spoil(fault, kind, stamp, vector, before, self._next, end)
                if spoilt is None:
                    return
                stamp, vector = spoilt
        self._sent[kind] = stamp, vector
        self._under_way.append((arrival, stamp, vector, kind))


def _spoil(
    fault: InjectedFault,
    kind: Kind,
    stamp: float,
    vector: Floats,
    before: tuple[float, Floats],
    number: int,
    end: float,
) -> tuple[float, Floats] | None:
    """Return a sample as a fault changes it; None when it is lost."""
    name = fault.kind
    if name == "drop_out":
        return None
    if name.startswith("stamp_"):
        shift = {"stamp_backwards": -0.5, "stamp_future": 0.5}.get(name)
        return (before[0] if shift is None else stamp + shift), vector
    if name.startswith("rates_") is not (kind is Kind.ANGULAR_RATE):
        return stamp, vector
    if name == "rates_drop_out":
        return None
    if name in ("stuck", "rates_stuck"):
        return stamp, before[1]
    if name in ("not_finite", "rates_not_finite"):
        return stamp, np.where([True, False, False], np.nan, vector)
    if name == "rates_in_deg":
        return stamp, np.degrees(vector)
    if name == "wrong_sign":
        return stamp, -vector
    if name == "axes_swapped":
        return stamp, vector[[2, 0, 1]]
    if name == "saturated":
        return stamp, np.where([False, False, True], min(end, 1e3) * np.sign(vector), vector)
    if name == "spikes":  # every tenth sample
        return stamp, vector + (25.0 if number % 10 == 0 else 0.0)
    if name == "jump":
        return stamp, _KNOCKED @ vector
    factor = {"unit_g": 1.0 / 9.80665, "unit_cm": 100.0, "wrong_scale": 0.85}
    return stamp, vector * factor[name] if name in factor else vector - vector * (
        STANDARD_GRAVITY / np.linalg.norm(vector)
    )


class TelemetryBase:
    """The base of a plant that reports an ideal accelerometer and gyroscope, as it is at the plant's present time.

    The angular acceleration, which only a sensor away from the base's origin feels, is the difference of rates
    between samples.
    """

    def __init__(self, plant: Plant) -> None:
        """Take a plant.

        Raises:
            InputError: Its telemetry has no accelerometer or no gyroscope.
        """
        names = {column.name for column in plant.columns}
        missing = {"accelerometer", "gyroscope"} - names
        if missing:
            raise InputError(
                f"the plant's telemetry has no {' and no '.join(sorted(missing))}; it has {sorted(names)}"
            )
        self._plant = plant
        self._last: tuple[float, Floats] | None = None

    def sample(self, times: Floats) -> BaseSamples:
        """Return the motion now, for every one of times (N,)."""
        stamps = as_array("times", times, (None,))
        telemetry = self._plant.telemetry()
        force, rate = telemetry["accelerometer"], np.asarray(telemetry["gyroscope"], dtype=float)
        time, alpha = float(stamps[-1]), np.zeros(3)
        if self._last is not None and time > self._last[0]:
            alpha = (rate - self._last[1]) / (time - self._last[0])
        self._last = time, rate
        n = len(stamps)
        # only their difference is known, and only it counts
        motion = np.stack([rate, alpha, np.zeros(3)])
        return BaseSamples(np.tile(-np.asarray(force, dtype=float), (n, 1)), np.tile(motion, (n, 1, 1)))
