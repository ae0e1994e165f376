"""How far gravity is off on bases that shake, beside three baselines: python -m tests.benchmarks.shaken_base [SEED]."""

import math
import sys
from collections import Counter

import numpy as np

from catenary.sensing.gravity_vector import Kind, Mailbox
from catenary.sensing.imu import SensedGravity
from catenary.sensing.mounting import Mounting
from oracles.shaken_imu import BASELINES, Shaken, X, Y, Z, begun, rock, spin

SECONDS, FROM = 15.0, 1.0  # [s]


def _hand(t):
    return 0.4 * np.sin(0.7 * t) + 0.2 * np.sin(2.9 * t + 1.0)


def _braking(t):
    return 3.0 * (begun(t, 8.0, 0.1) - begun(t, 10.0, 0.1)) - 3.0 * (begun(t, 18.0, 0.1) - begun(t, 20.0, 0.1))


def _lift(t):
    return 1.2 * (begun(t, 6.0, 0.5) - begun(t, 8.0, 0.5) - begun(t, 16.0, 0.5) + begun(t, 18.0, 0.5))


def _wave(a, hz, phase=0.0):
    return lambda t: a * np.sin(2.0 * np.pi * hz * t + phase)


SHIP = ((X, _wave(math.radians(15.0), 0.125)),)
HEAVE = ((Z, _wave(1.5, 0.11)), (X, _wave(1.0, 0.08, 1.0)))
UP3, UP1 = (0.0, 0.0, 3.0), (0.0, 0.0, 1.0)
TILTED = (X, lambda t: math.radians(3.0) + 0.0 * t)
SWAP, FLIP = np.eye(3)[[1, 0, 2]] * [1, 1, -1], -np.eye(3)
# name: base, how it is mounted as told, options
ROWS = {
    "still": (Shaken(), {}, {}),
    "ship roll": (Shaken(SHIP), {}, {}),
    "slow turn of 120 deg": (Shaken(((X, lambda t: math.radians(120.0) * begun(t, 3.0, 12.0)),)), {}, {"hanging": True}),
    "table 1 Hz": (Shaken(((X, rock(10.0, 1.0)),)), {}, {}),
    "by hand": (Shaken(((X, _hand), (Y, lambda t: _hand(t + 3.0)))), {}, {}),
    "gyroscope off by 3 deg/s": (Shaken(((X, rock(10.0, 0.3)),), rate_bias=np.full(3, 0.052)), {}, {}),
    "shake .2": (Shaken(shake=0.2), {}, {}),
    "shake .5": (Shaken(shake=0.5), {}, {}),
    "shake .5 vehicle": (Shaken(shake=0.5), {}, {"mounted_on": "vehicle"}),
    "shake 1": (Shaken(shake=1.0), {}, {}),
    "shake 2": (Shaken(shake=2.0), {}, {}),
    "shake 2 vehicle": (Shaken(shake=2.0), {}, {"mounted_on": "vehicle"}),
    "shake 5": (Shaken(shake=5.0), {}, {}),
    "shake 2 at 15 Hz": (Shaken(shake=2.0, shake_hz=15.0), {}, {}),
    "shake 2 at 90 Hz": (Shaken(shake=2.0, shake_hz=90.0), {}, {}),
    "shake 2 at 187 Hz, aliased": (Shaken(shake=2.0, shake_hz=187.0), {}, {}),
    "shake 1 at 73 Hz, 1000 Hz": (Shaken(shake=1.0, shake_hz=73.0, hz=1000.0), {}, {}),
    "shake 1 at 37 Hz, 50 Hz": (Shaken(shake=1.0, shake_hz=37.0, hz=50.0), {}, {}),
    "shake 5, clipped at 12": (Shaken(shake=5.0, end=12.0), {"acceleration_range": 12.0}, {}),
    "shake 1, table 1 Hz": (Shaken(((X, rock(5.0, 1.0)),), shake=1.0), {}, {}),
    "shake 1, ship": (Shaken(SHIP, HEAVE, shake=1.0), {}, {"mounted_on": "ship"}),
    "ship, 1 m told": (Shaken(SHIP, place=UP1), {"position": UP1}, {}),
    "ship, 3 m told": (Shaken(SHIP, place=UP3), {"position": UP3}, {}),
    "ship, 3 m told, as ship": (Shaken(SHIP, place=UP3), {"position": UP3}, {"mounted_on": "ship"}),
    "ship that heaves, default": (Shaken(SHIP, HEAVE), {}, {}),
    "ship that heaves, as ship": (Shaken(SHIP, HEAVE), {}, {"mounted_on": "ship"}),
    "cart brakes, vehicle": (Shaken(pushes=((X, _braking),)), {}, {"mounted_on": "vehicle"}),
    "cart brakes, default": (Shaken(pushes=((X, _braking),)), {}, {}),
    "lift, vehicle": (Shaken(pushes=((Z, _lift),)), {}, {"mounted_on": "vehicle"}),
    "lift, default": (Shaken(pushes=((Z, _lift),)), {}, {}),
    "scale 3 % off": (Shaken(scale=1.03), {}, {}),
    **{
        f"turntable {rate} deg/s, .3 m, checked": (
            Shaken((TILTED, (Z, spin(rate))), place=(0.3, 0.0, 0.0)),
            {"position": (0.3, 0.0, 0.0), "checked": True}, {},
        )
        for rate in (30, 90, 120, 180, 360)
    },
    **{
        f"rocking {deg} deg {hz} Hz, {place} m{' checked' * checked}": (
            Shaken(((X, rock(deg, hz)),), place=(0.0, 0.0, place)),
            {"position": (0.0, 0.0, place), "checked": checked}, {},
        )
        for deg, hz, place, checked in (
            (5, 1, -0.2, 1), (5, 1, -0.3, 1), (5, 1, -0.3, 0), (20, 0.5, 0.5, 0), (2, 3, 0.3, 0), (5, 1, 1.0, 0),
        )
    },
    **{
        f"rocking, gyroscope {name}": (Shaken(((X, rock(15.0, 0.4)),), rate_as=wrong, late=late), {}, {})
        for name, wrong, late in (("negated", FLIP, 0.0), ("swapped", SWAP, 0.0), ("deg/s", np.degrees(np.eye(3)), 0.0),
                                  ("half", 0.5 * np.eye(3), 0.0), ("late", np.eye(3), 0.15))
    },
    **{
        f"spin 60 deg/s .3 m, gyroscope {name}": (
            Shaken((TILTED, (X, rock(8.0, 0.2)), (Z, spin(60.0))), place=(0.3, 0.0, 0.0), rate_as=wrong),
            {"position": (0.3, 0.0, 0.0)}, {},
        )
        for name, wrong in (("negated", FLIP), ("swapped", SWAP), ("right", np.eye(3)))
    },
    "shake 1 at 10 Hz": (Shaken(shake=1.0, shake_hz=10.0), {}, {}),
    "shake 2 at 25 Hz": (Shaken(shake=2.0, shake_hz=25.0), {}, {}),
    "shake 2 at 60 Hz, 100 Hz, aliased": (Shaken(shake=2.0, shake_hz=60.0, hz=100.0), {}, {}),
    "shake 3 at 120 Hz, 1000 Hz": (Shaken(shake=3.0, shake_hz=120.0, hz=1000.0), {}, {}),
    "shake 2 at 15 Hz, table 1 Hz": (Shaken(((X, rock(5.0, 1.0)),), shake=2.0, shake_hz=15.0), {}, {}),
    "shake 1 at 15 Hz, ship, 1 m told": (Shaken(SHIP, shake=1.0, shake_hz=15.0, place=UP1), {"position": UP1}, {}),
    "shake 2, clipped at 11": (Shaken(shake=2.0, end=11.0), {"acceleration_range": 11.0}, {}),
    "shake 2, rocking, gyroscope negated": (Shaken(((X, rock(15.0, 0.4)),), shake=2.0, rate_as=FLIP), {}, {}),
    **{
        f"spin {rate} deg/s, {place[0]:g} m told": (
            Shaken((TILTED, (Z, spin(rate))), place=place), {"position": place}, {}
        )
        for rate, place in ((10, (3.0, 0.0, 0.0)), (60, (3.0, 0.0, 0.0)), (180, (1.0, 0.0, 0.0)))
    },
    "rocking 1 deg 0.1 Hz, 3 m": (Shaken(((X, rock(1.0, 0.1)),), place=UP3), {"position": UP3}, {}),
    "rocking 20 deg 0.1 Hz, 3 m": (Shaken(((X, rock(20.0, 0.1)),), place=UP3), {"position": UP3}, {}),
    **{
        f"rocking, bias leaps by {leap} rad/s": (
            Shaken(((X, rock(15.0, 0.4)),), bias_leap=(10.0, leap)), {}, {}
        )
        for leap in (0.05, 0.2)
    },
    "rocking .3 m, bias leaps by 0.2 rad/s": (
        Shaken(((X, rock(15.0, 0.4)),), place=(0.0, 0.0, 0.3), bias_leap=(10.0, 0.2)), {"position": (0.0, 0.0, 0.3)}, {},
    ),
    "rocking, gyroscope 60 ms late": (Shaken(((X, rock(15.0, 0.4)),), late=0.06), {}, {}),
    "rocking .3 m, gyroscope 150 ms late": (
        Shaken(((X, rock(15.0, 0.4)),), place=(0.0, 0.0, 0.3), late=0.15), {"position": (0.0, 0.0, 0.3)}, {},
    ),
    "rocking at 50 Hz": (Shaken(((X, rock(10.0, 1.0)),), hz=50.0), {}, {}),
    "noise of 0.2 m/s2": (Shaken(((X, rock(10.0, 0.3)),), noise=(0.2, 0.01)), {}, {}),
    "creeps by 15 deg in 10 s": (Shaken(creep=((Y, lambda t: math.radians(15.0) * begun(t, 4.0, 10.0)),)), {}, {}),
}  # fmt: skip


def sensed(base, told, options, seconds=SECONDS, seed=0):
    """Return times, truth, readings by the source, and what the baselines make of the samples."""
    t, true, force, rates = base.samples(seconds, seed)
    mailbox = Mailbox()
    source = SensedGravity(
        mailbox, Mounting(**{k: np.array(v) if k == "position" else v for k, v in told.items()}), **options
    )
    readings = []
    for now, f, w in zip(t.tolist(), force, rates, strict=True):
        mailbox.put(now, w, Kind.ANGULAR_RATE)
        mailbox.put(now, f, Kind.SPECIFIC_FORCE)
        readings.append(source.read(now))
    return t, true, readings, {name: by(t, force, rates) for name, by in BASELINES.items()}, source


def row(name, seed):
    """Return errors RMS of all and of ours [m/s2], shares of time and what was said."""
    base, told, options = ROWS[name]
    t, true, readings, baselines, source = sensed(base, told, options, seed=seed)
    late = t > FROM
    off = lambda g: np.linalg.norm(np.array(g) - true, axis=1)[late]  # noqa: E731
    rms = lambda e: float(np.sqrt(np.mean(e**2)))  # noqa: E731
    ours = off([r.gravity for r in readings])
    status = Counter(r.status.value for r, k in zip(readings, late, strict=True) if k)
    live = np.array([r.status.value == "live" for r in readings])[late]
    names = Counter(n for r, k in zip(readings, late, strict=True) if k for n in r.faults.names)
    wrong = float(np.sum(live & (ours > 0.3))) / base.hz
    return (
        {n: rms(off(g)) for n, g in baselines.items()},
        rms(ours),
        float(ours.max()),
        live.mean(),
        wrong,
        names,
        status,
        source.remedy,
    )


if __name__ == "__main__":
    seeds = [int(a) for a in sys.argv[1:2]] or [0]
    only = sys.argv[2:] or list(ROWS)
    for name in only if only[0] in ROWS else [n for n in ROWS if any(o in n for o in only)]:
        base, ours, most, live, wrong, names, status, remedy = row(name, seeds[0])
        said = ", ".join(f"{n} {c / sum(status.values()):.2f}" for n, c in names.most_common(4))
        print(
            f"{name:44s} "
            + " ".join(f"{v:5.2f}" for v in base.values())
            + f" | {ours:5.2f} max {most:5.2f} live {100 * live:5.1f} % wrong {wrong:5.2f} s | {said} {remedy}",
            flush=True,
        )
