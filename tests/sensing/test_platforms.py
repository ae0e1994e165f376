import math
import os
from itertools import cycle

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.sensing.gravity_vector import Kind, Mailbox
from catenary.sensing.imu import SensedGravity
from catenary.sensing.mounting import Mounting
from catenary.sensing.platforms import BaseSpectrum, base_spectrum
from catenary.simulation.base_motion import BaseSamples, SwayingBase, Wave
from catenary.simulation.sensors import FAULT_KINDS, InjectedFault, SensorModel, SimulatedSensor
from oracles.sensor_faults import NAMED

UP, X, Y = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
ROLL_AND_PITCH = (Wave(math.radians(8.0), 0.1, X), Wave(math.radians(4.0), 0.14, Y, 0.7))


def sensed(base, seconds, mounted_on, *faults, rate_hz=100.0, reads_hz=100.0, **options):
    """Times, readings, and gravity less acceleration as it truly was."""
    mailbox, model = Mailbox(), SensorModel(rate_hz)
    sensor = SimulatedSensor(base, mailbox, model, faults=faults, seed=3)
    source = SensedGravity(mailbox, model.mounting, mounted_on=mounted_on, feed=sensor.advance, **options)
    times = np.arange(round(seconds * reads_hz)) / reads_hz
    readings = [source.read(float(t)) for t in times]
    samples = base.sample(times)
    return times, readings, samples.gravity - samples.motion[:, 2]


@pytest.mark.parametrize("base", ["boat", None, 3])
def test_bases_that_there_are_not_are_refused(base):
    with pytest.raises(InputError, match="expected one of table, cart, vehicle, ship"):
        base_spectrum(base)


@pytest.mark.parametrize(
    "wrong", [{"slowest_hz": 2.0}, {"slowest_hz": 0.0}, {"push": -1.0}, {"jolt": math.nan}, {"fastest_hz": math.inf}]
)
def test_motions_that_make_no_sense_are_refused(wrong):
    with pytest.raises(InputError, match="base spectrum"):
        BaseSpectrum(**wrong)


@pytest.mark.parametrize(("heave", "frequency"), [(3.0, 0.05), (3.0, 0.3)])
def test_what_a_sea_does_to_a_deck_is_passed_on(heave, frequency):
    deck = SwayingBase(ROLL_AND_PITCH, (Wave(heave, frequency, UP, 2.0),))
    times, readings, true = sensed(deck, 7.0, "ship")
    begun = times > 1.0
    assert {r.status.value for r, b in zip(readings, begun, strict=True) if b} == {"live"}
    assert not any(r.faults for r, b in zip(readings, begun, strict=True) if b)
    off = np.array([r.gravity for r in readings]) - true
    assert np.sqrt(np.mean(np.sum(off[begun] ** 2, axis=1))) < 0.05


@pytest.mark.parametrize("mounted_on", ["ship", "table"])
def test_surge_and_sway_are_passed_on_whatever_is_said_of_the_base(mounted_on):
    deck = SwayingBase(ROLL_AND_PITCH, (Wave(2.0, 0.12, UP), Wave(2.0, 0.1, X), Wave(1.5, 0.08, Y, 1.0)))
    _, readings, true = sensed(deck, 5.0, mounted_on)
    assert all(r.status.value == "live" for r in readings[100:])
    assert np.linalg.norm(np.array([r.gravity for r in readings]) - true, axis=1)[100:].max() < 0.3


def test_a_wrong_scale_is_named_and_after_a_minute_no_base_explains_it():
    fault = InjectedFault("wrong_scale", 0.0)
    _, readings, _ = sensed(SwayingBase((), (Wave(2.0, 0.12, UP),)), 70.0, "ship", fault, rate_hz=25.0, reads_hz=25.0)
    assert {(r.status.value, r.faults.names) for r in readings[-50:]} == {("degraded", ("magnitude",))}


class Turntable:
    """Turns about the vertical, back and forth, with its sensor 0.2 m off the axis."""

    def sample(self, times):
        """Return gravity, and the accelerations of turning."""
        rate = 0.7 * np.sin(0.07 * times) + 0.5 * np.sin(0.31 * times + 1.0)
        change = 0.049 * np.cos(0.07 * times) + 0.155 * np.cos(0.31 * times + 1.0)
        omega, alpha = (np.outer(v, UP) for v in (rate, change))
        lever = np.array([0.2, 0.1, 0.0])
        linear = np.cross(alpha, lever) + np.cross(omega, np.cross(omega, lever))
        return BaseSamples(np.tile([0.0, 0.0, -9.81], (len(times), 1)), np.stack([omega, alpha, linear], axis=1))


LONG = {
    "ship": SwayingBase(
        (*ROLL_AND_PITCH, Wave(0.05, 0.21, X, 1.0)),
        (Wave(1.5, 0.11, UP), Wave(1.0, 0.17, UP, 2.0), Wave(0.8, 0.08, X), Wave(1.0, 0.09, Y, 1.0)),
    ),
    "vehicle": SwayingBase(
        (Wave(0.07, 0.23, X), Wave(0.05, 0.4, Y, 0.4), Wave(0.017, 1.7, Y)),
        (Wave(2.5, 0.12, X), Wave(1.0, 0.31, Y), Wave(1.0, 1.5, UP), Wave(0.5, 4.0, UP)),
    ),
    "table": SwayingBase((Wave(0.14, 0.21, X), Wave(0.1, 0.37, Y, 0.5), Wave(0.03, 1.1, X, 1.0))),
    "turntable": Turntable(),
}


# for the whole hour: CATENARY_BASE_MINUTES=60 python -m pytest --timeout 0 -m slow -k minutes tests/sensing/test_platforms.py
MINUTES = float(os.environ.get("CATENARY_BASE_MINUTES", "1"))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "place"), [*((name, np.zeros(3)) for name in LONG), ("table", np.array([0, 0, 0.4]))])
def test_no_fault_is_named_in_minutes_of_a_base_that_moves(name, place, rng):
    times = np.arange(round(3000.0 * MINUTES)) / 50.0
    samples = LONG[name].sample(times)
    true = samples.gravity - samples.motion[:, 2]
    omega, alpha = samples.motion[:, 0], samples.motion[:, 1]
    readings = true - np.cross(alpha, place) - np.cross(omega, np.cross(omega, place))
    readings += 0.02 + 0.04 * rng.normal(size=true.shape)
    rates = samples.motion[:, 0] + 0.01 * np.array([1.0, -1.0, 0.5]) + 9e-4 * rng.normal(size=true.shape)
    mailbox = Mailbox()
    mounting = Mounting(position=place)
    source = SensedGravity(mailbox, mounting, mounted_on="table" if name == "turntable" else name)
    off, said = np.empty(len(times)), set()
    for k, now in enumerate(times.tolist()):
        mailbox.put(now, rates[k], Kind.ANGULAR_RATE)
        mailbox.put(now, readings[k], Kind.FREE_FALL)
        reading = source.read(now)
        off[k] = np.linalg.norm(reading.gravity - true[k]) * (reading.status.value == "live")
        if now > 1.0:
            said.add((reading.status.value, reading.faults.names))
    # off the axis its rates wait for a turn that shows them right
    allowed = (
        {("degraded", (why,)) for why in ("unchecked_turn", "recovering", "not_followed")} if place.any() else set()
    )
    assert said - allowed == {("live", ())}
    assert off[50:].max() < 0.5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "mounted_on"), list(zip(FAULT_KINDS, cycle(["ship", "vehicle", "cart"]), strict=False))
)
def test_every_fault_is_found_on_a_deck_that_heaves(kind, mounted_on):
    heave = {"ship": 2.0, "vehicle": 2.0, "cart": 0.5}[mounted_on]
    # at 3 s it reads 11.4 m/s2; at 10.9 gravity taken away leaves what numbers in g say
    deck = SwayingBase(ROLL_AND_PITCH, (Wave(heave, 0.12, UP),))
    begin, lasts = 3.0, 1.0
    times, readings, true = sensed(deck, 6.5, mounted_on, InjectedFault(kind, begin, lasts))
    latest, expected = NAMED[kind]
    before = [r.faults.names for t, r in zip(times, readings, strict=True) if 1.0 < t < begin]
    assert not any(before)
    names = [set(r.faults.names) for r in readings]
    found = [t for t, n in zip(times, names, strict=True) if t >= begin and n & expected]
    assert found, sorted(set().union(*names))
    assert found[0] <= begin + latest
    well = [
        (t, r)
        for t, r in zip(times, readings, strict=True)
        if t > begin + lasts + (2.0 if kind == "rates_in_deg" else 1.0)
    ]
    slowly = kind == "rates_in_deg" and mounted_on == "ship"  # it turns too slowly to show its gyroscope right
    assert all(r.status.value == "live" and (slowly or not r.faults) for _, r in well)
    assert_allclose(readings[-1].gravity, true[-1], atol=0.15)
