import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.identification.options import IdentifyOptions
from catenary.identification.samples import alternate_blocks, prepare
from catenary.robots.catalog import load_robot
from moving_arm import recorded

ARM = load_robot("raven2")
FULL = IdentifyOptions()


def log(**changes):
    return recorded(ARM, 0, **changes)


RUN = log()


@pytest.fixture(scope="module")
def samples():
    return prepare(RUN, ARM, FULL)


def test_filtered_signals_are_those_of_the_motion_and_accelerations_derivatives_of_the_velocity(samples):
    assert_allclose(samples.q, RUN.q_nominal[100:-100], atol=1e-4)
    assert_allclose(samples.qd, RUN.qd[100:-100], atol=1e-3)
    assert_allclose(samples.qdd[1:-1], (samples.qd[2:] - samples.qd[:-2]) * 100.0, atol=1e-9)


def test_velocities_come_from_positions_where_none_are_recorded(samples):
    without = prepare(log(qd=None), ARM, FULL)
    assert_allclose(without.qd, samples.qd, atol=2e-3)  # central differences at 200 Hz of 7 rad/s


def test_the_filter_has_no_delay(samples):
    raw = RUN.tau[100:-100]
    for axis in range(3):
        lags = [
            np.corrcoef(samples.tau[5:-5, axis], np.roll(raw, k, axis=0)[5:-5, axis])[0, 1]
            for k in (-2, 0, 2)
        ]
        assert lags[1] == max(lags)


def test_uneven_time_steps_are_evened_out():
    run = log()
    kept = np.sort(np.random.default_rng(1).permutation(len(run))[: 9 * len(run) // 10])
    uneven = log(
        q_nominal=run.q_nominal[kept],
        qd=run.qd[kept],
        tau=run.tau[kept],
        ok=run.ok[kept],
        time=run.time[kept],
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


def test_poses_at_rest_are_taken_as_they_are():
    run = log(time=None, qd=None)
    samples = prepare(run, ARM, IdentifyOptions(terms="static"))
    assert_allclose(samples.tau, run.tau)
    assert not samples.qd.any()


def test_noise_about_a_joint_at_rest_is_no_wrong_velocity(rng):
    q, qd = RUN.q_nominal.copy(), RUN.qd.copy()
    q[:, 1] = 1.2 + 1e-4 * rng.normal(size=len(q))
    qd[:, 1] = 1e-3 * rng.normal(size=len(q))
    assert len(prepare(log(q_nominal=q, qd=qd), ARM, FULL)) == 5800


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


@pytest.mark.parametrize(("changes", "said"), [
    ({"tau": None}, "has no torques"),
    ({"time": None}, "has no time: full dynamics need `fs` [Hz] or `t` [s]"),
    ({"seconds": 1.0}, "200 rows from row 0: shorter than the filter, which needs 229"),
    ({"q_nominal": degrees(RUN.q_nominal)}, "joint elbow goes from"),
    ({"q_nominal": 1000.0 * RUN.q_nominal, "qd": 1000.0 * RUN.qd}, "is it in degrees, or another joint's?"),
    (
        {"qd": degrees(RUN.qd)},
        "velocity of joint elbow is 57.3 times the derivative of its position: degrees per second?",
    ),
    ({"qd": swapped(RUN.qd)}, "velocity of joint shoulder is not the derivative of its position"),
    ({"qd": swapped(RUN.qd)}, "it follows joint elbow: swapped axes?"),
    ({"time": 2.0 * RUN.time}, "another sampling rate than stated?"),
    ({"time": np.zeros(len(RUN))}, "time stands still"),
    ({"rate": 15.0}, "recorded at 15 Hz: the cut-off 10 Hz must be below half of it"),
    ({"joint_units": ("rad", "rad", "rad")}, 'has joint "insertion" in rad, not m'),
])  # fmt: skip
def test_a_recording_that_cannot_be_of_the_robot_is_refused(changes, said):
    with pytest.raises(InputError) as caught:
        prepare(log(**changes), ARM, FULL)
    assert said in str(caught.value)


def test_another_number_of_joints_is_refused():
    with pytest.raises(InputError, match=r'has joints shoulder \[rad\], .*; robot "panda" has q1 \[rad\], q2'):
        prepare(log(), load_robot("panda"), FULL)


def test_one_block_is_no_split(samples):
    with pytest.raises(InputError, match="less than two blocks of 100"):
        alternate_blocks(samples, 100.0)
