"""Sensors of gravity that break, alone and on a base that tips.

Held is what docs/reliability.md and docs/gravity-vector.md promise: the vector is finite and never leaps; a fault is named
in its time; where the vector is called live it is gravity, and elsewhere the fallback acts; within a second after the
cause has gone all is well again.
"""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.campaign.part import Fell, Part
from tests.oracles.sensor_faults import NAMED

if TYPE_CHECKING:
    from catenary.sensing.vector import GravityReading

FALLBACKS = ("hold", "fade", "static", "stop")
# also by what the two sensors say of each other
IN_TIME = {**NAMED, "rates_in_deg": (1.0, NAMED["rates_in_deg"][1] | {"rate_unit"})}
KINDS = tuple(IN_TIME)
LATEST = 1.0  # [s] after its cause that a fault may be named, or the vector be anything but live
BACK = 10.0  # [m/s3] at which a vector that is live again comes back
EASED = 0.7  # [s] after which it has
BEGIN = 2.0  # [s] of samples before the fault


def unit(seed: int, folder: Path) -> None:
    """Break a simulated inertial unit in one of its ways for a while, under each fallback, on bases of all kinds."""
    from catenary.sensing.imu import SensedGravity
    from catenary.sensing.vector import Mailbox
    from catenary.simulation.base_motion import FixedBase, RockingBase
    from catenary.simulation.sensors import InjectedFault, SensorModel, SimulatedSensor

    rng = np.random.default_rng(seed)
    kind, fallback = KINDS[seed % len(KINDS)], FALLBACKS[seed // len(KINDS) % len(FALLBACKS)]
    lasts = float(rng.uniform(0.25, 1.5)) if kind != "rates_in_deg" else 1.5
    rocks = kind == "rates_in_deg" or bool(rng.integers(2))
    tilt = float(rng.uniform(0.15, 0.35))
    if rocks:
        base: Any = RockingBase(tilt, float(rng.uniform(0.03, 0.09)), float(rng.uniform(0.5, 1.0)))
    else:
        base = FixedBase(tilt, float(rng.uniform(-0.2, 0.2)))
    mailbox = Mailbox()
    fault = InjectedFault(kind, BEGIN, lasts)
    sensor = SimulatedSensor(
        base, mailbox, SensorModel(rate_hz=float(rng.choice([100.0, 200.0]))), faults=[fault], seed=seed
    )
    source = SensedGravity(mailbox, sensor.model.mounting, fallback=fallback, feed=sensor.advance)
    times = np.arange(round(1000.0 * (BEGIN + lasts + 2.0))) / 1000.0
    readings = [source.read(float(t)) for t in times]
    true = np.broadcast_to(base.sample(times).gravity, (len(times), 3))
    settled = times > BEGIN - 1.0
    _check_always(readings)
    _check_live(times, readings, true, settled)
    names = [set(reading.faults.names) for reading in readings]
    before = set().union(*(n for n, t in zip(names, times, strict=True) if BEGIN - 1.0 < t < BEGIN))
    if before:
        raise Fell(f"{kind}: faults before there was one: {sorted(before)}")
    latest, expected = IN_TIME[kind]
    named = [t for t, n in zip(times, names, strict=True) if t >= BEGIN and n & expected]
    if not named or named[0] > BEGIN + latest:
        said = sorted(set().union(*names))
        raise Fell(f"{kind}: expected {sorted(expected)} within {latest} s, got {named[:1]}, and in all {said}")
    _check_return(times, readings, true, BEGIN + lasts)


def tips(seed: int, folder: Path) -> None:
    """Tip a table by 25 degrees or more within a second while its gyroscope says that it stands still."""
    from catenary.sensing.checks import Fault, SensorRules
    from catenary.sensing.imu import SensedGravity
    from catenary.sensing.vector import Kind, Mailbox, ReadingStatus, tilted_gravity

    rng = np.random.default_rng(seed)
    fallback = FALLBACKS[seed % len(FALLBACKS)]
    angle, lasts = math.radians(rng.uniform(25.0, 40.0)), float(rng.uniform(0.6, 1.0))
    bias = rng.uniform(-0.05, 0.05, 3)  # 3 deg/s
    start = float(rng.uniform(-0.1, 0.1))
    hz = int(rng.choice([100, 200]))
    gentle = bool(rng.integers(2))
    mailbox = Mailbox()
    source = SensedGravity(mailbox, fallback=fallback, rules=SensorRules())

    def roll(t: float) -> float:
        share = min(max((t - BEGIN) / lasts, 0.0), 1.0)
        return start + angle * (0.5 - 0.5 * math.cos(math.pi * share) if gentle else share)

    times = np.arange(round(1000.0 * (BEGIN + lasts + 2.0))) / 1000.0
    readings: list[GravityReading] = []
    for tick, t in enumerate(times.tolist()):
        if tick % (1000 // hz) == 0:
            mailbox.put(t, tilted_gravity(roll(t), 0.0) + 0.03 * rng.normal(size=3), Kind.FREE_FALL)
            mailbox.put(t, bias + 0.001 * rng.normal(size=3), Kind.ANGULAR_RATE)
        readings.append(source.read(t))
    _check_always(readings)
    found = [t for t, r in zip(times, readings, strict=True) if t > BEGIN and Fault.DISAGREEMENT in r.faults]
    if not found or found[0] > BEGIN + 0.5:
        raise Fell(f"disagreement after {found[0] - BEGIN if found else math.inf:.3f} s, expected within 0.5 s")
    fallen = ReadingStatus.STOP if fallback == "stop" else ReadingStatus.FALLBACK
    if not any(r.status is fallen for r in readings):
        raise Fell("the fallback never acted")
    true = np.array([tilted_gravity(roll(t), 0.0) for t in times])
    _check_return(times, readings, true, BEGIN + lasts)


def _check_always(readings: "list[GravityReading]") -> None:
    gravity = np.array([reading.gravity for reading in readings])
    rates = np.array([reading.base_rates for reading in readings])
    if not (np.isfinite(gravity).all() and np.isfinite(rates).all()):
        raise Fell("the vector or the rates are not finite")
    leap = float(np.linalg.norm(np.diff(gravity, axis=0), axis=1).max())
    if leap > 0.11 + 1e-9:
        raise Fell(f"the vector leapt by {leap:.3f} m/s2 in a millisecond, expected 0.11 at most")


def _check_live(times: Any, readings: "list[GravityReading]", true: Any, settled: Any) -> None:
    """What is called live is gravity, within what a sample may differ from what those before it foretell."""
    since = times[0]
    for t, reading, gravity, counts in zip(times, readings, true, settled, strict=True):
        if reading.status.value != "live":
            since = t
        elif counts and t - since > EASED:
            off = float(np.linalg.norm(reading.gravity - gravity))
            if off > 1.2:
                raise Fell(f"live at {t:.3f} s and {off:.2f} m/s2 off gravity")


def _check_return(times: Any, readings: "list[GravityReading]", true: Any, gone: float) -> None:
    """Live without a fault from LATEST on; and gravity once it has come back from where it was then."""
    off = [float(np.linalg.norm(r.gravity - g)) for r, g in zip(readings, true, strict=True)]
    (first, *_) = (k for k, t in enumerate(times) if t >= gone + LATEST)
    back = times[first] + off[first] / BACK + 0.05
    for t, reading, distance in zip(times[first:], readings[first:], off[first:], strict=True):
        if reading.status.value != "live" or reading.faults:
            raise Fell(f"{t - gone:.3f} s after the cause: {reading.status.value}, {reading.faults.names}")
        if t > back and distance > 0.3:
            raise Fell(f"{t - gone:.3f} s after the cause: {distance:.2f} m/s2 off gravity")


PARTS = (Part("sensors.unit", 76, unit, processor_time=30.0), Part("sensors.tips", 40, tips, processor_time=30.0))
