"""Recordings as identification takes them: filtered, cut, checked, with the gravity and turning of their base."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics
from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque
from catenary.identification.identification import identify, identify_samples
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import FrictionHistory, alternate_blocks, path_load, prepare
from catenary.plant import MotionLog
from catenary.robots.actuation import SignalFilter, default_actuation
from catenary.robots.catalog import load_robot
from catenary.robots.friction_terms import FRICTION_TERMS, dahl_path
from catenary.sensing.gravity_vector import tilted_gravity
from catenary.spatial import LEVEL
from moving_arm import recorded, sinusoids

ARM = load_robot("raven2")
FULL = IdentifyOptions()


def log(**changes):
    return recorded(ARM, 0, **changes)


RUN = log()
CUT = 42  # rows at 200 Hz: five time constants, 5 / (2 pi 10 Hz sin(pi / 8)) = 208 ms


@pytest.fixture(scope="module")
def samples():
    return prepare(RUN, ARM, FULL)


def test_filtered_signals_are_those_of_the_motion_and_accelerations_derivatives_of_the_velocity(samples):
    assert_allclose(samples.q, RUN.q_nominal[CUT:-CUT], atol=1e-3)
    assert_allclose(samples.qd, RUN.qd[CUT:-CUT], atol=2e-2)  # of 7 rad/s, and less within
    assert_allclose(samples.qd[CUT:-CUT], RUN.qd[2 * CUT : -2 * CUT], atol=1e-3)
    assert_allclose(samples.qdd[1:-1], (samples.qd[2:] - samples.qd[:-2]) * 100.0, atol=1e-9)


@pytest.mark.parametrize("rate", [50.0, 200.0, 8000.0])
def test_as_much_time_is_cut_at_any_rate_and_what_is_left_is_as_true(rate):
    run = log(rate=rate, seconds=5.0)
    samples = prepare(run, ARM, FULL)
    assert samples.time[0] == pytest.approx(0.208, abs=1.0 / rate)
    assert run.time[-1] - samples.time[-1] == pytest.approx(0.208, abs=1.0 / rate)
    true = np.column_stack([np.interp(samples.time, run.time, column) for column in run.q_nominal.T])
    assert np.abs(samples.q - true).max() < 1e-3  # of 1 rad


@pytest.mark.parametrize("order", [1, 2, 4, 8])
@pytest.mark.parametrize("rate", [100.0, 5000.0])
def test_what_is_left_of_a_recording_hardly_knows_what_came_before_it(order, rate):
    filtered = replace(default_actuation(ARM.joint_names), filter=SignalFilter(order=order, cutoff_hz=10.0))
    arm, long = replace(ARM, actuation=filtered), log(rate=rate, seconds=12.0)
    whole, part = (prepare(long, arm, FULL), prepare(thinned(long, (long.time > 4.0) & (long.time < 8.0)), arm, FULL))
    same = np.searchsorted(whole.time, part.time - 1e-6)
    for key in ("q", "qd", "tau"):
        off = getattr(whole, key)[same] - getattr(part, key)
        assert np.abs(off).max() < 0.01 * np.ptp(getattr(whole, key), axis=0).max()  # exp(-5)


def test_uneven_time_steps_are_evened_out():
    run = log()
    kept = np.sort(np.random.default_rng(1).permutation(len(run))[: 9 * len(run) // 10])
    uneven = log(
        q_nominal=run.q_nominal[kept], qd=run.qd[kept], tau=run.tau[kept], ok=run.ok[kept], time=run.time[kept]
    )
    samples = prepare(uneven, ARM, FULL)
    assert_allclose(np.diff(samples.time), 0.005, atol=1e-9)
    expected = np.column_stack([np.interp(samples.time, run.time, column) for column in run.q_nominal.T])
    assert_allclose(samples.q, expected, atol=2e-3)


def test_a_jump_back_in_time_parts_the_recording():
    run = log(seconds=10.0)
    twice = {key: np.concatenate([getattr(run, key)] * 2) for key in ("q_nominal", "qd", "tau", "ok", "time")}
    one, both = prepare(run, ARM, FULL), prepare(log(**twice), ARM, FULL)
    assert_allclose(both.tau, np.concatenate([one.tau, one.tau]), atol=1e-9)


def thinned(run, kept):
    columns = ("q_nominal", "qd", "tau", "ok", "time")
    return replace(run, **{key: getattr(run, key)[kept] for key in columns})


def without(run, *spans):
    """A recording that dropped out between these times [s]."""
    lost = [(run.time >= first) & (run.time < last) for first, last in spans]
    return thinned(run, ~np.logical_or.reduce(lost))


DROPPED_OUT = ((5.0, 7.5), (11.5, 14.0), (17.0, 19.5), (23.5, 26.0))


@pytest.mark.parametrize("name", ["raven2", "ur10e"])
def test_drop_outs_leave_identified_gravity_nearly_as_true_as_without(name):
    arm, options = load_robot(name), IdentifyOptions(friction=(), consistent=False)
    run = recorded(arm, 0, rate=100.0, noise=0.01)
    q = np.random.default_rng(1).uniform(np.maximum(arm.lower, -2.0), np.minimum(arm.upper, 2.0), (200, arm.n))
    true = gravity_torque(arm, q, LEVEL)

    def wrong(log):
        result = identify_samples([prepare(log, arm, options)], arm, options)
        return np.abs(result.predict(q) - true).max()

    # two thirds of the rows, less what the filter takes at ten more ends
    assert wrong(without(run, *DROPPED_OUT)) < 5.0 * wrong(run)


def test_no_row_is_made_where_none_was_recorded():
    run = without(log(), *DROPPED_OUT)
    samples = prepare(run, ARM, FULL)
    assert np.abs(samples.time[:, None] - run.time).min(axis=1).max() < 1e-9
    assert len(samples) == len(run) - 5 * 2 * CUT  # at either end of each stretch
    assert samples.notes == (
        "4 gap(s) in time, the longest 2.51 s: rows between were filtered, and cut at both ends, by itself; "
        "3580 rows are used of 4000",
    )


def test_a_slow_recording_of_a_panda_has_no_row_made_of_it():
    arm = load_robot("panda")
    run = recorded(arm, 0, rate=100.0)
    samples = prepare(run, arm, FULL)
    assert len(samples) < len(run)
    assert samples.notes == ()


def test_stamps_in_another_unit_are_asked_about():
    panda, t = load_robot("panda"), np.arange(3000) * 10.0
    q = 0.5 * (panda.lower + panda.upper) + 0.3 * np.sin(0.01 * t[:, None] + np.arange(7))
    slow = MotionLog("log", panda.joint_names, panda.joint_units, q, np.ones(3000, dtype=bool), tau=np.cos(q), time=t)
    with pytest.raises(InputError, match="is time in ms, us or ns"):
        prepare(slow, panda, FULL)


def test_a_stretch_between_gaps_that_is_shorter_than_the_filter_needs_is_left_out_and_told():
    run = without(log(), (5.0, 8.0), (8.5, 12.0))
    samples = prepare(run, ARM, FULL)
    assert not ((samples.time > 5.0) & (samples.time < 12.0)).any()
    assert "1 stretch(es) of time shorter than the filter needs, 100 rows, were left out" in samples.notes[1]


def test_a_recording_of_short_stretches_alone_is_refused_with_its_gaps():
    run = without(log(), *((second + 0.5, second + 1.0) for second in range(30)))
    with pytest.raises(InputError, match=r"100 rows from row 0, between 29 gap\(s\) in time: shorter than the filter"):
        prepare(run, ARM, FULL)


def jittery(time, rng):
    return time + rng.uniform(-0.002, 0.002, len(time))


def in_bursts(time, rng):
    """Ten messages that a busy network delivers at once."""
    return time[9::10].repeat(10)[: len(time)] + np.tile(np.arange(10) * 1e-5, len(time) // 10)


def with_hiccups(time, rng):
    """A program that stands still for 90 ms once a second, and misses 18 rows."""
    return time[np.arange(len(time)) % 200 >= 18]


@pytest.mark.parametrize("spoil", [jittery, in_bursts, with_hiccups])
def test_jitter_bursts_and_hiccups_are_no_gaps(spoil):
    run = log()
    time = spoil(run.time, np.random.default_rng(2))
    q, qd, tau = (
        np.column_stack([np.interp(time, run.time, column) for column in values.T])
        for values in (run.q_nominal, run.qd, run.tau)
    )
    samples = prepare(replace(run, q_nominal=q, qd=qd, tau=tau, ok=np.ones(len(q), bool), time=time), ARM, FULL)
    assert not [note for note in samples.notes if "gap" in note]
    assert len(samples) > 0.9 * len(time)
    assert len(samples) < 2.1 * len(time)


def test_noise_about_a_joint_at_rest_is_no_wrong_velocity(rng):
    q, qd = RUN.q_nominal.copy(), RUN.qd.copy()
    q[:, 1] = 1.2 + 1e-4 * rng.normal(size=len(q))
    qd[:, 1] = 1e-3 * rng.normal(size=len(q))
    assert len(prepare(log(q_nominal=q, qd=qd), ARM, FULL)) == len(q) - 2 * CUT


def test_blocks_alternate_and_lose_no_row(samples):
    one, other = alternate_blocks(samples, 2.0)
    assert len(one) + len(other) == len(samples)
    assert_allclose(other.time[0] - one.time[0], 2.0)
    assert other.name == "run0 (held-out blocks)"


def degrees(values):
    turned = values.copy()
    turned[:, 1] = np.rad2deg(turned[:, 1])
    return turned


def swapped(values):
    return values[:, [1, 0, 2]]


@pytest.mark.parametrize(("changes", "message"), [
    ({"tau": None}, "has no torques"),
    ({"time": None}, "has no time: full dynamics need `fs` [Hz] or `t` [s]"),
    ({"seconds": 0.5}, "100 rows from row 0: shorter than the filter, which needs 114"),
    ({"q_nominal": degrees(RUN.q_nominal)}, "joint elbow goes from"),
    ({"q_nominal": 1000.0 * RUN.q_nominal, "qd": 1000.0 * RUN.qd}, "is it in degrees, or another joint's?"),
    (
        {"qd": degrees(RUN.qd)},
        "velocities of elbow are 57.3 times the derivatives of positions; fix: --scale qd:elbow=0.01745",
    ),
    ({"qd": swapped(RUN.qd)}, "velocities of shoulder are those of elbow"),
    ({"qd": swapped(RUN.qd)}, "fix: --swap qd:shoulder,elbow"),
    ({"qd": -RUN.qd}, "fix: --sign qd:shoulder --sign qd:elbow --sign qd:insertion"),
    ({"qd": RUN.qd[::-1]}, "fix: --leave-out qd"),
    ({"time": 2.0 * RUN.time}, "2 times the derivatives of positions: is the time or the rate wrong?"),
    ({"time": np.zeros(len(RUN))}, "time stamp does not change"),
    ({"rate": 15.0}, "recorded at 15 Hz: the cut-off 10 Hz must be below half of it"),
    ({"joint_units": ("rad", "rad", "rad")}, 'has joint "insertion" in rad, not m'),
])  # fmt: skip
def test_a_recording_that_cannot_be_of_the_robot_is_refused(changes, message):
    with pytest.raises(InputError) as caught:
        prepare(log(**changes), ARM, FULL)
    assert message in str(caught.value)


PANDA = load_robot("panda")
PLAIN = IdentifyOptions(friction=(), prior=False)


def on_base(seed, gravity, rate=None, acceleration=None, **signals):
    """Recording of a Panda on a base whose gravity, angular rate and acceleration are given row by row."""
    rng = np.random.default_rng(seed)
    time = np.arange(len(gravity)) / 200.0
    q, qd, qdd = sinusoids(rng, PANDA, time)
    base = None if rate is None else BaseMotion(rate, acceleration)
    tau = inverse_dynamics(PANDA, q, qd, qdd, gravity, base) + 0.3 * qd
    columns = {f"gravity:{axis}": gravity[:, k] for k, axis in enumerate("xyz")}
    if rate is not None:
        columns |= {f"base_rate:{axis}": rate[:, k] for k, axis in enumerate("xyz")}
    log = recorded(PANDA, 0, seconds=len(gravity) / 200.0, q_nominal=q, qd=qd, tau=tau)
    return replace(log, name=f"base{seed}", signals=columns | signals)


def rocking(rows):
    """Gravity, rate and acceleration of a base that rocks about its x axis by 0.4 rad at 0.2 Hz."""
    t, w = np.arange(rows) / 200.0, 2.0 * np.pi * 0.2
    roll = 0.4 * np.sin(w * t)
    gravity = 9.81 * np.column_stack([np.zeros(rows), -np.sin(roll), -np.cos(roll)])
    rate, acceleration = np.zeros((rows, 3)), np.zeros((rows, 3))
    rate[:, 0], acceleration[:, 0] = 0.4 * w * np.cos(w * t), -0.4 * w**2 * np.sin(w * t)
    return gravity, rate, acceleration


def test_a_rocking_base_is_not_taken_for_friction_or_masses():
    result = identify([on_base(0, *rocking(2500))], PANDA, PLAIN, tests=[on_base(1, *rocking(2500))])
    still = identify([replace(on_base(0, *rocking(2500)), signals={})], PANDA, PLAIN)
    assert (result.tests[0].relative_rms < 0.03).all()
    assert still.training[0].relative_rms[0] > 5.0 * result.training[0].relative_rms[0]


def test_tilts_show_what_a_level_base_hides():
    level = np.tile([0.0, 0.0, -9.81], (2000, 1))
    tilts = [np.tile(tilted_gravity(*angles), (2000, 1)) for angles in ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5))]
    one = identify([on_base(0, level)], PANDA, PLAIN)
    three = identify([on_base(k, g) for k, g in enumerate(tilts)], PANDA, PLAIN)
    assert three.base.count == one.base.count + 2  # first moments about joint 1's axis, which stands upright
    q, tilt = np.full((1, 7), 0.3), tilted_gravity(0.3, 0.2)
    true = gravity_torque(PANDA, q, tilt)
    assert_allclose(gravity_torque(three.robot(), q, tilt), true, atol=0.05)


@pytest.mark.parametrize(
    ("signals", "message"),
    [
        ({"gravity:x": 0.0, "gravity:y": 0.0}, "gravity:z is missing"),
        ({"gravity:x": 0.0, "gravity:y": 0.0, "gravity:z": -1.0 / 9.81}, "is it in g?"),
        ({"gravity:x": 0.0, "gravity:y": np.nan, "gravity:z": -9.81}, "gravity is not finite at row 0"),
        (
            {f"base_rate:{axis}": 0.0 for axis in "xyz"},
            "has base_rate and no gravity: expected gravity:x, :y and :z too",
        ),
    ],
)
def test_signals_that_cannot_be_are_refused(signals, message):
    log = recorded(PANDA, 0)
    columns = {name: np.full(len(log), value) for name, value in signals.items()}
    with pytest.raises(InputError, match=message.replace("?", r"\?")):
        identify([replace(log, signals=columns)], PANDA, PLAIN)


DISTANCE = 0.02


def test_presliding_friction_rises_as_dahls_law_from_rest():
    s = np.linspace(0.0, 0.1, 500)
    assert_allclose(path_load(dahl_path, s, DISTANCE), 1.0 - np.exp(-s / DISTANCE), atol=1e-12)


def test_presliding_friction_after_a_reversal_starts_where_it_was():
    there, back = np.linspace(0.0, 0.3, 400), np.linspace(0.3, 0.25, 300)
    z = path_load(dahl_path, np.concatenate([there, back[1:]]), DISTANCE)
    top = 1.0 - np.exp(-0.3 / DISTANCE)
    assert_allclose(z[400:], -1.0 + (top + 1.0) * np.exp(-(0.3 - back[1:]) / DISTANCE), atol=1e-12)


@pytest.mark.parametrize("slower", [1.0, 7.0])
def test_presliding_friction_depends_on_the_path_and_not_on_time(slower):
    # a path sampled ten times as finely: Dahl's law is in ds alone
    t = np.linspace(0.0, 6.0, 601)
    fine = np.linspace(0.0, 6.0, round(6000 * slower) + 1)
    turns = 0.3 * np.sin(t)
    z = path_load(dahl_path, 0.3 * np.sin(fine), DISTANCE)
    coarse = path_load(dahl_path, turns, DISTANCE)
    # where it turns between two samples, the coarse path misses a little of the way
    assert_allclose(np.interp(t, fine, z), coarse, atol=0.01)


def test_a_step_passes_the_filter_that_the_torque_passed():
    arm = load_robot("raven2")
    log = recorded(arm, 0)
    c = np.eye(3)[0]
    stepped = np.array(log.tau)
    stepped[:, 0] = np.sign(np.array(log.qd) @ c)  # a torque that is Coulomb friction alone
    samples = prepare(recorded(arm, 0, tau=stepped), arm, IdentifyOptions())
    assert samples.history is not None
    load = samples.history.load(FRICTION_TERMS["coulomb"], c, 0.0, 0.0)
    # the direction is told from the filtered rate, which passes zero within a sample of the raw one
    assert_allclose(load, samples.tau[:, 0], atol=0.12)
    assert np.abs(np.sign(samples.qd @ c) - samples.tau[:, 0]).max() > 0.5


def test_rows_that_are_left_remember_all_of_the_course():
    s = np.sin(np.linspace(0.0, 10.0, 300))[:, None]
    history = FrictionHistory(((s, s, 10),), np.empty((0, 6)), np.arange(280))
    term = FRICTION_TERMS["presliding"], np.ones(1), DISTANCE
    every_third = np.arange(280) % 3 == 0
    left = replace(history, kept=history.kept[every_third])
    assert_allclose(left.load(*term, 0.0), history.load(*term, 0.0)[every_third])
