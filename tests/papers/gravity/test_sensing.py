import pytest

from papers.gravity import sensing
from papers.gravity.sensing import Residual, residuals


@pytest.fixture(scope="module")
def table():
    return {row.source: row.whole for row in residuals()}


@pytest.mark.slow
def test_an_ideal_imu_at_200_hz_leaves_less_than_one_per_cent_of_the_holding_torque(table):
    assert table["IMU, 200 Hz"] < 0.01
    assert table["IMU, 100 Hz"] < 0.01


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


def test_the_table_is_printed_in_per_cent(capsys, monkeypatch):
    monkeypatch.setattr(sensing, "residuals", lambda: [Residual("a source", (0.1, 0.2, 0.3), 0.25)])
    sensing.main()
    assert "a source" in capsys.readouterr().out.split("\n")[1]
