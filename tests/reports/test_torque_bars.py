import numpy as np
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

from catenary.reports.torque_bars import draw_torque_bars, joints_by_unit
from catenary.robots.catalog import load_robot


def test_joints_that_turn_and_that_slide_have_axes_of_their_own() -> None:
    assert joints_by_unit(load_robot("raven2")) == {"Nm": [0, 1], "N": [2]}
    assert joints_by_unit(load_robot("panda")) == {"Nm": list(range(7))}


def test_bars_are_as_long_as_the_torques_and_limits_stand_where_they_are() -> None:
    panda = load_robot("panda")
    tau = np.array([[0.0, -30.0, 1.0, 20.0, 0.5, -2.0, 0.1], [0.0, 10.0, 1.0, 25.0, 0.5, -2.0, 0.1]])
    axes = Figure().subplots()
    draw_torque_bars([axes], panda, np.zeros(7), tau)
    assert_allclose([bar.get_width() for bar in axes.patches], tau[0])
    told = [text.get_text() for text in axes.texts]
    assert told[0] == "0"
    assert told[1] == "-30 (34 % of 87)"
    low, high = axes.get_xlim()
    assert low < -87.0  # three times the bar: drawn
    assert high > 87.0
    ranges = axes.collections[0].get_paths()
    assert_allclose(ranges[1].vertices[:, 0], [-30.0, 10.0])  # over both poses


def test_limits_far_beyond_the_bars_are_told_and_not_drawn() -> None:
    axes = Figure().subplots()
    draw_torque_bars([axes], load_robot("panda"), np.zeros(7), np.full((1, 7), 0.2))
    assert "0.2 (0 % of 87)" in [text.get_text() for text in axes.texts]
    assert max(axes.get_xlim()) < 1.0


def test_an_arm_without_any_torque_has_bars_all_the_same() -> None:
    axes = Figure().subplots()
    draw_torque_bars([axes], load_robot("two_link"), np.zeros(2), np.zeros((1, 2)))
    assert [text.get_text() for text in axes.texts] == ["0", "0"]
