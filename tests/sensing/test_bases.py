import math
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.sensing.bases import BASES, BaseSpectrum, rules_for
from catenary.sensing.checks import SensorRules
from catenary.sensing.imu import SensedGravity
from catenary.sensing.vector import Mailbox
from catenary.simulation.base_motion import FixedBase, SwayingBase, Wave
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


def test_a_table_has_the_default_rules():
    assert rules_for("table") == SensorRules()


@pytest.mark.parametrize(("number", "base"), list(enumerate(BASES)))
def test_every_rule_is_documented_with_its_value(number, base):
    lines = Path("docs/gravity-vector.md").read_text().splitlines()
    rows = {line.split("`")[1]: [c.strip() for c in line.split("|")] for line in lines if line.startswith("| `")}
    for name, value in vars(rules_for(base)).items():
        # as printed there
        assert float(rows[name][4 + number]) == pytest.approx(value, abs=0.005), name


@pytest.mark.parametrize("base", BASES)
def test_rules_of_every_base_and_of_a_noisier_sensor_can_be_had(base):
    cheap, noisy = rules_for(base), rules_for(base, noise=0.2)
    assert noisy.max_step > cheap.max_step
    assert noisy.rest_spread > cheap.rest_spread
    assert rules_for(base, changes={"max_push": 3.0}).max_push == 3.0


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"base": "boat"}, 'mounted on "boat": expected one of table, cart, vehicle, ship'),
        ({"base": "ship", "changes": {"max_pull": 1.0}}, "no rule max_pull; there are max_step"),
        ({"base": "ship", "noise": -1.0}, "sensor noise"),
        ({"base": "ship", "changes": {"max_step": 0.0}}, "max_step"),
    ],
)
def test_bases_and_rules_that_there_are_not_are_refused(wrong, said):
    with pytest.raises(InputError, match=said):
        rules_for(**wrong)


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


def test_surge_and_sway_are_passed_on_and_rules_of_a_table_fall_back():
    deck = SwayingBase(ROLL_AND_PITCH, (Wave(2.0, 0.12, UP), Wave(2.0, 0.1, X), Wave(1.5, 0.08, Y, 1.0)))
    for mounted_on, always_live in (("ship", True), ("table", False)):
        _, readings, _ = sensed(deck, 5.0, mounted_on)
        assert all(r.status.value == "live" for r in readings[100:]) is always_live


def test_braking_for_seconds_is_passed_on_in_a_vehicle():
    braking = SwayingBase((), (Wave(4.0, 0.15, X), Wave(1.0, 1.5, UP)), FixedBase(0.05, 0.0))
    _, readings, true = sensed(braking, 5.0, "vehicle")
    assert not any(r.faults for r in readings[100:])
    assert_allclose([r.gravity for r in readings[100:]], true[100:], atol=0.25)  # five times its noise


def test_a_wrong_scale_from_the_start_is_found_in_the_mean_of_a_sea():
    deck = SwayingBase((), (Wave(2.0, 0.12, UP),))
    fault = InjectedFault("wrong_scale", 0.0)
    rules = rules_for("ship", changes={"mean_time": 20.0, "rest_lower": 8.6})
    _, readings, _ = sensed(deck, 25.0, "ship", fault, rate_hz=25.0, reads_hz=25.0, rules=rules, cutoff_hz=4.0)
    assert any("magnitude" in r.faults.names for r in readings[-50:])


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
    well = [(t, r) for t, r in zip(times, readings, strict=True) if t > begin + lasts + 1.0]
    assert all(r.status.value == "live" and not r.faults for _, r in well)
    assert_allclose(readings[-1].gravity, true[-1], atol=0.15)
