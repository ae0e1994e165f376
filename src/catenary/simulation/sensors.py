"""Simulated IMU on a robot's base: noise, resolution, latency, mounting errors, and injected faults."""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from catenary.arrays import Floats, as_not_negative, as_positive
from catenary.errors import InputError
from catenary.sensing.gravity_vector import Kind, Mailbox
from catenary.sensing.mounting import Mounting
from catenary.simulation.base_motion import MovingBase
from catenary.spatial import STANDARD_GRAVITY, cross, rotation_about_x, rotation_about_z

_G = 9.80665  # [m/s2] of a datasheet
# rotation of a sensor that came loose, unlike any permutation of axes
_KNOCKED = rotation_about_z(0.5) @ rotation_about_x(0.4)
_SPIKE_SAMPLES = 10  # samples
Sample = tuple[float, Floats]  # stamp [s], vector (3,)
# effect of a fault on a sample: (stamp, vector, previous sample, end of the range); None for a lost sample
_EFFECTS: dict[str, Callable[[float, Floats, Sample, float], Sample | None]] = {
    "drop_out": lambda t, v, before, end: None,
    "not_finite": lambda t, v, before, end: (t, np.append(np.nan, v[1:])),
    "stuck": lambda t, v, before, end: (t, before[1]),
    "wrong_sign": lambda t, v, before, end: (t, -v),
    "axes_swapped": lambda t, v, before, end: (t, v[[2, 0, 1]]),
    "saturated": lambda t, v, before, end: (t, np.append(v[:2], min(end, 1e3) * np.sign(v[2]))),
    "spikes": lambda t, v, before, end: (t, v + 25.0),
    "jump": lambda t, v, before, end: (t, _KNOCKED @ v),
    "unit_g": lambda t, v, before, end: (t, v / _G),
    "unit_cm": lambda t, v, before, end: (t, 100.0 * v),
    "gravity_stripped": lambda t, v, before, end: (t, v - v * (STANDARD_GRAVITY / np.linalg.norm(v))),
    "wrong_scale": lambda t, v, before, end: (t, 0.85 * v),
    "stamp_backwards": lambda t, v, before, end: (t - 0.5, v),
    "stamp_repeated": lambda t, v, before, end: (before[0], v),
    "stamp_future": lambda t, v, before, end: (t + 0.5, v),
    "rates_drop_out": lambda t, v, before, end: None,
    "rates_not_finite": lambda t, v, before, end: (t, np.append(np.nan, v[1:])),
    "rates_stuck": lambda t, v, before, end: (t, before[1]),
    "rates_in_deg": lambda t, v, before, end: (t, np.degrees(v)),
}
FAULT_KINDS = tuple(_EFFECTS)


@dataclass(frozen=True)
class InjectedFault:
    """Fault of a simulated sensor in an interval of time."""

    kind: str  # one of FAULT_KINDS; names that begin with rates_ concern the gyroscope
    start: float  # [s]
    duration: float = math.inf  # [s]

    def __post_init__(self) -> None:
        if self.kind not in FAULT_KINDS:
            raise InputError(f'fault "{self.kind}": expected one of {", ".join(FAULT_KINDS)}')

    def holds(self, stamp: float, kind: Kind, number: int) -> bool:
        """Return true if the fault affects sample `number` of a kind at `stamp` [s]."""
        of_both = self.kind == "drop_out" or self.kind.startswith("stamp_")
        concerned = of_both or self.kind.startswith("rates_") is (kind is Kind.ANGULAR_RATE)
        skipped = self.kind == "spikes" and number % _SPIKE_SAMPLES != 0
        return concerned and not skipped and self.start <= stamp < self.start + self.duration


@dataclass(frozen=True)
class SensorModel:
    """Errors of a simulated IMU; by default an MPU-6050 at 2 g and 250 deg/s."""

    rate_hz: float = 200.0
    # MPU-6000/6050 product specification rev. 3.4, tables 6.1 and 6.2
    noise: float = 400e-6 * _G  # [m/s2/sqrt(Hz)]
    rate_noise: float = math.radians(0.005)  # [rad/s/sqrt(Hz)]
    resolution: float = _G / 16384.0  # [m/s2] of a count; 0 for no quantisation
    rate_resolution: float = math.radians(1.0 / 131.0)  # [rad/s]
    latency: float = 0.002  # [s] from the sample to its arrival
    has_gyroscope: bool = True
    # true mounting and errors, which the estimator's may differ from
    mounting: Mounting = field(
        default_factory=lambda: Mounting(acceleration_range=2.0 * _G, rate_range=math.radians(250.0), checked=True)
    )

    def __post_init__(self) -> None:
        as_positive("rate_hz", self.rate_hz)
        for name in ("noise", "rate_noise", "resolution", "rate_resolution", "latency"):
            as_not_negative(name, getattr(self, name))


class SimulatedSensor:
    """Deliver samples of a simulated sensor on a moving base to a mailbox, at each call of `advance`."""

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
            base: Motion of the base, such as a plant's `base`.
            model: Errors of the sensor; an MPU-6050 at the base's origin when None.
            start: Time of the first sample, or just before it [s]; the plant's present time.
        """
        self.model = SensorModel() if model is None else model
        self.mailbox, self.faults = mailbox, tuple(faults)
        self._base = base
        self._rng = np.random.default_rng(seed)
        self._next = max(0, math.ceil(start * self.model.rate_hz - 1e-6))  # number of the next sample
        self._under_way: deque[tuple[float, float, Floats, Kind]] = deque()  # arrival, stamp, vector
        self._sent: dict[Kind, Sample] = {}  # the last of each kind, for faults that repeat it

    def advance(self, now: float) -> None:
        """Take all samples that are due by a time [s], and deliver those that have arrived."""
        model = self.model
        while self._next / model.rate_hz <= now + 1e-9:  # rounding of ticks
            self._sample(self._next / model.rate_hz)
            self._next += 1
        while self._under_way and self._under_way[0][0] <= now + 1e-9:
            _, stamp, vector, kind = self._under_way.popleft()
            self.mailbox.put(stamp, vector, kind)

    def _sample(self, stamp: float) -> None:
        model, mounting = self.model, self.model.mounting
        base = self._base.sample(np.array([stamp]))
        gravity, (omega, alpha, linear) = base.gravity[0], base.motion[0]
        p = mounting.position
        force = linear + cross(alpha, p) + cross(omega, cross(omega, p)) - gravity
        read = mounting.scale * (mounting.rotation.T @ force) + mounting.bias
        readings = [(Kind.SPECIFIC_FORCE, read, model.noise, model.resolution, mounting.acceleration_range)]
        if model.has_gyroscope:
            rate = mounting.rotation.T @ omega + mounting.rate_bias
            readings.append((Kind.ANGULAR_RATE, rate, model.rate_noise, model.rate_resolution, mounting.rate_range))
        for kind, true, noise, resolution, end in readings:
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
            if fault.holds(stamp, kind, self._next):
                faulty = _EFFECTS[fault.kind](stamp, vector, before, end)
                if faulty is None:
                    return
                stamp, vector = faulty
        self._sent[kind] = stamp, vector
        self._under_way.append((arrival, stamp, vector, kind))
