"""Sensors of gravity that break: alone, on a base that tips, in a robot's control loop, as a board on a serial line.

Held is what docs/reliability.md and docs/gravity-vector.md promise: the vector is finite and never leaps; a fault is named
in its time; where the vector is called live it is gravity, and elsewhere the fallback acts; within a second after the
cause has gone all is well again.
"""

import functools
import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.campaign.part import Fell, Part

if TYPE_CHECKING:
    from catenary.sensing.vector import GravityReading

FALLBACKS = ("hold", "fade", "static", "stop")
# the latest that a fault is named by one of these names [s]; ten samples for what repeats, a second for what only the
# mean shows; rates in deg/s are noise on a base that stands still, and so is what is not named then
NAMED: dict[str, tuple[float, set[str]]] = {
    "drop_out": (0.1, {"interrupted"}),
    "not_finite": (0.05, {"not_finite"}),
    "stuck": (0.15, {"stuck"}),
    "wrong_sign": (0.05, {"wrong_sign"}),
    "axes_swapped": (0.1, {"axes_swapped", "jump", "spike"}),
    "saturated": (0.05, {"saturated", "spike", "magnitude"}),
    "spikes": (0.15, {"spike", "magnitude"}),
    "jump": (0.1, {"jump", "spike", "axes_swapped", "magnitude"}),
    "unit_g": (0.05, {"unit_g"}),
    "unit_cm": (0.05, {"unit_cm"}),
    "gravity_stripped": (0.05, {"gravity_stripped"}),
    "wrong_scale": (0.1, {"magnitude", "jump", "spike"}),
    "stamp_backwards": (0.05, {"stamp_backwards"}),
    "stamp_repeated": (0.05, {"stamp_repeated"}),
    "stamp_future": (0.05, {"stamp_future"}),
    "rates_drop_out": (0.1, {"rates_interrupted"}),
    "rates_not_finite": (0.05, {"rate_not_finite"}),
    "rates_stuck": (0.15, {"rate_stuck"}),
    "rates_in_deg": (1.0, {"rate_too_fast", "rate_contradicts", "rate_spike", "rate_saturated"}),
}
KINDS = tuple(NAMED)
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
    latest, expected = NAMED[kind]
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


@functools.cache
def _arm(base_deg: float) -> Any:
    from papers.gravity.faults import follow, ready

    start = ready(base_deg=base_deg)
    return start, follow(start, None, "fade")[0]


def loop(seed: int, folder: Path) -> None:
    """Break the sensor of a simulated RAVEN-II in motion; no joint moves by half a degree because of it."""
    from papers.gravity.faults import LIMIT_DEG, outcome

    kind, fallback = KINDS[seed % len(KINDS)], FALLBACKS[seed // len(KINDS) % len(FALLBACKS)]
    start, healthy = _arm((20.0, 10.0, -15.0)[seed // (len(KINDS) * len(FALLBACKS)) % 3])
    found = outcome(start, kind, fallback, healthy)
    if not max(found.moved[:2]) <= LIMIT_DEG:
        raise Fell(f"{kind}, {fallback}: joints moved by {found.moved} [deg, deg, mm], expected {LIMIT_DEG} deg")
    if fallback == "stop" and kind == "drop_out" and not found.stopped:
        raise Fell("the robot was not stopped")


def board(seed: int, folder: Path) -> None:
    """Let a board on a serial line send garbage, pieces of lines, wrong sums or nothing; then it is well again."""
    from catenary.devices.accelerometer import SerialAccelerometer
    from catenary.sensing.imu import SensedGravity
    from catenary.sensing.vector import Mailbox
    from oracles.simulated_board import SimulatedBoard
    from patience import until

    rng = np.random.default_rng(seed)
    ways = ("garbage", "pieces", "sums", "silence", "unplugged", "restart", "endless", "numbers")
    way = ways[seed % len(ways)]
    mailbox, link = Mailbox(), SimulatedBoard(folder / "board")
    link.began = round(1e6 * time.monotonic())  # type: ignore[attr-defined]
    source = SensedGravity(mailbox, fallback=FALLBACKS[seed % 3])
    seen: list[GravityReading] = []

    def send(seconds: float) -> None:
        """Good lines, a hundred a second."""
        begin = time.monotonic()
        link.hello()
        for k in range(round(100 * seconds)):
            link.write(_good(link, rng))
            seen.append(source.read(time.monotonic()))
            time.sleep(max(0.0, begin + 0.01 * (k + 1) - time.monotonic()))

    def well() -> bool:
        send(0.1)
        return seen[-1].status.value == "live" and not seen[-1].faults

    try:
        with SerialAccelerometer(str(link.link), mailbox) as device:
            until(well)
            samples = device.counts.samples
            _misbehave(link, way, rng, lambda: seen.append(source.read(time.monotonic())))
            begin = time.monotonic()
            try:
                until(well, seconds=20.0)
            except AssertionError as error:
                raise Fell(f"{way}: not well again: {seen[-1]}, {device.counts}") from error
            took = time.monotonic() - begin
            if device.counts.samples <= samples or not device.is_connected:
                raise Fell(f"{way}: the board was not heard again")
        if way not in ("silence", "unplugged") and took > 10.0:  # by itself a second, on a busy machine more
            raise Fell(f"{way}: well again after {took:.1f} s")
    finally:
        link.close()
    if not all(np.isfinite(reading.gravity).all() for reading in seen):
        raise Fell(f"{way}: a vector that is not finite")


def _good(link: Any, rng: np.random.Generator) -> bytes:
    link.micros = round(1e6 * time.monotonic()) - link.began
    force, rate = rng.normal((0.5, 0.0, 9.78), 0.02), rng.normal(0.0, 0.002, 3)
    line: bytes = link.line(tuple(force), tuple(rate))
    return line


def _misbehave(link: Any, way: str, rng: np.random.Generator, read: Any) -> None:
    """Half a second of a board that is out of order."""
    from oracles.simulated_board import framed

    if way == "unplugged":
        link.unplug()
    if way == "restart":
        link.count, link.began = 0, round(1e6 * time.monotonic())
    for _ in range(50):
        line = _good(link, rng)
        if way == "garbage":
            link.write(rng.bytes(int(rng.integers(1, 300))))
        elif way == "pieces":
            link.write(line[int(rng.integers(0, len(line))) : int(rng.integers(0, len(line)))])
        elif way == "sums":
            link.write(line[:-4] + b"%02X\r\n" % rng.integers(0, 256))
        elif way == "endless":
            link.write(b"$CATAC," + b"9" * 2000)
        elif way == "numbers":
            values = rng.choice(["nan", "inf", "-inf", "1e400", "", "0x1", "9" * 100, "1_0", "٣", "-1"], 8)
            link.write(framed("CATAC," + ",".join(values)))
        read()
        time.sleep(0.01)
    if way == "unplugged":
        link.plug()
    link.write(b"\r\n")


PARTS = (
    Part("sensors.unit", 76, unit, processor_time=30.0),
    Part("sensors.tips", 40, tips, processor_time=30.0),
    Part("sensors.loop", 76, loop, processor_time=120.0, patience=600.0, memory=4 * 10**9),
    Part("sensors.board", 32, board, processor_time=60.0),
)
