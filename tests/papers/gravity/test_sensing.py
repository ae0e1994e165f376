import pytest

from papers.experiment import Outcomes, Scope
from papers.gravity.sensing import (
    ACCELEROMETER,
    ATTITUDE,
    CLAIMS,
    JOINTS_OFF,
    LEVEL_BASE,
    cases,
    lacking_torque,
    report,
    residuals,
)


@pytest.fixture(scope="module")
def table():
    return {row.source: row.whole for row in residuals(quick=True)}


@pytest.mark.slow
def test_an_ideal_imu_at_200_hz_leaves_less_than_one_per_cent_of_the_holding_torque():
    found = lacking_torque(noise_seed=0)
    assert found["IMU, 200 Hz"][0] < 1.0
    assert found["IMU, 100 Hz"][0] < 1.0


def test_each_step_towards_the_whole_truth_leaves_less(table):
    steps = (
        "level base",
        "true attitude, no accelerations",
        "accelerometer at the origin, 100 Hz",
        "IMU, 200 Hz",
    )
    values = [table[name] for name in steps]
    assert values == sorted(values, reverse=True)
    assert values[0] > 2.0 * values[2]


def test_noise_of_a_cheap_imu_costs_little_beside_what_a_tilted_mounting_does(table):
    assert table["IMU, 200 Hz, noise"] < 0.02
    # one degree turns gravity by 1.7 % of its length, which is more of the smaller torques
    assert 0.01 < table["IMU, 200 Hz, mounted 1 deg askew"] < 0.06


def test_errors_of_joint_positions_are_those_of_the_calibration_paper():
    # table I, J2-J3, raw: 2.103 deg, 7.963 deg, 11.715 mm
    assert JOINTS_OFF["as reported"] == pytest.approx((0.036704, 0.138981, 0.011715), rel=1e-4)


def made_up(accelerometer: float) -> Outcomes:
    rows = {LEVEL_BASE: 40.0, ATTITUDE: 20.0, ACCELEROMETER: accelerometer}
    (case,) = cases(Scope())
    return Outcomes({case: {name: [value] * 4 for name, value in rows.items()}})


def test_claims_hold_where_each_sensor_leaves_less_than_the_one_before():
    assert [claim.judge(made_up(10.0)).verdict for claim in CLAIMS] == ["reproduced"] * 2
    # three of six steps, and none of three
    assert [claim.judge(made_up(30.0)).verdict for claim in CLAIMS] == ["not reproduced"] * 2
    assert {claim.judge(Outcomes({})).verdict for claim in CLAIMS} == {"not measured"}


def test_the_table_is_in_per_cent():
    found = {cases(Scope())[0]: {"a source": [25.0, 10.0, 20.0, 30.0]}}
    assert list(report(Outcomes(found)).tables[0].table.rows[0]) == [
        "a source",
        "25.00",
        "10.00",
        "20.00",
        "30.00",
    ]
