from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

import catenary
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError
from catenary.reports.robot_plot import PARTS, draw_torque_bars, link_segments, middle_pose
from catenary.robots.catalog import load_robot, robot_names
from catenary.spatial import STANDARD_GRAVITY


def told(figure: Figure) -> list[str]:
    legends = [axes.get_legend() for axes in figure.axes]
    return [text.get_text() for legend in legends if legend is not None for text in legend.get_texts()]


@pytest.mark.alike
@pytest.mark.parametrize("name", robot_names())
def test_every_robot_of_the_catalogue_is_drawn_with_bars_where_it_has_masses(name: str) -> None:
    robot = load_robot(name)
    figure = catenary.plot(robot)
    units = {"Nm" if unit == "rad" else "N" for unit in robot.joint_units}
    assert len(figure.axes) == 1 + (0 if robot.missing_inertia else len(units))
    assert ("no masses in its description" in told(figure)) == (not robot.tree.mass.any())


def test_bars_hold_a_two_link_arm_as_its_closed_form_says() -> None:
    # uniform rods of 1 kg, 1 and 0.5 m, angles from the horizontal upwards
    a, b = 0.4, 0.7
    second = STANDARD_GRAVITY * 0.25 * np.cos(a + b)
    first = STANDARD_GRAVITY * (0.5 + 1.0) * np.cos(a) + second
    arm, bars = catenary.plot(load_robot("two_link"), [a, b]).axes
    assert arm.name == "3d"
    # the arm's angles are upwards, so the torques that hold it are too
    assert_allclose(np.abs([bar.get_width() for bar in bars.patches]), [first, second], rtol=1e-12)


def test_spheres_have_volumes_as_the_masses() -> None:
    panda = load_robot("panda")
    (spheres,) = (c for c in catenary.plot(panda, hide=["torques"]).axes[0].collections if "mass" in c.get_label())
    volumes = np.sqrt(spheres.get_sizes()) ** 3
    assert_allclose(volumes / volumes.max(), panda.tree.mass / panda.tree.mass.max(), rtol=1e-9)


def test_gravity_is_an_arrow_along_itself_of_the_same_length_in_every_direction(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from mpl_toolkits.mplot3d.axes3d import Axes3D

    drawn: list[np.ndarray] = []
    monkeypatch.setattr(Axes3D, "quiver", lambda self, *numbers, **style: drawn.append(np.array(numbers)))
    for gravity in ([0.0, 0.0, -9.81], [3.0, -2.0, -9.0]):
        catenary.plot(load_robot("raven2"), gravity=gravity)
    for (_, along), gravity in zip((d.reshape(2, 3) for d in drawn), ([0, 0, -9.81], [3, -2, -9]), strict=True):
        assert_allclose(np.cross(along, gravity), 0.0, atol=1e-9 * np.linalg.norm(along))
        assert along @ np.array(gravity) > 0.0
    lengths = [np.linalg.norm(d[3:]) for d in drawn]
    assert_allclose(lengths[0], lengths[1], rtol=1e-9)


def test_without_gravity_there_is_no_arrow_and_it_is_said() -> None:
    assert "gravity, 0 m/s2" in told(catenary.plot(load_robot("raven2"), gravity=[0, 0, 0]))


def test_parts_are_left_out_on_request() -> None:
    figure = catenary.plot(load_robot("raven2"), hide=PARTS)
    assert len(figure.axes) == 1
    assert told(figure) == []
    with pytest.raises(InputError, match="hide: shadows: expected some of frames, masses, gravity, torques"):
        catenary.plot(load_robot("raven2"), hide=["shadows"])  # type: ignore[list-item]


def test_it_draws_on_axes_and_on_figures_of_others() -> None:
    figure = Figure()
    axes = figure.add_subplot(2, 2, 3, projection="3d")
    assert catenary.plot(load_robot("raven2"), on=axes) is figure
    assert figure.axes == [axes]
    whole = Figure()
    assert catenary.plot(load_robot("raven2"), on=whole) is whole
    assert len(whole.axes) == 3
    with pytest.raises(InputError, match="axes of two dimensions"):
        catenary.plot(load_robot("raven2"), on=Figure().add_subplot())


def test_several_poses_are_drawn() -> None:
    figure = catenary.plot(load_robot("two_link"), np.linspace([0.0, 0.0], [1.0, 2.0], 40))
    assert "over all 40 poses" in figure.axes[1].get_title(loc="left")


@pytest.mark.parametrize(
    ("q", "message"), [([0.0], "expected shape"), ([0.0, np.nan], "q"), (np.zeros((0, 2)), "no pose")]
)
def test_poses_that_are_none_are_refused(q: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        catenary.plot(load_robot("two_link"), q)


def test_without_joints_it_stands_in_the_middle_of_their_ranges() -> None:
    raven = load_robot("raven2")
    assert_allclose(middle_pose(raven), (raven.lower + raven.upper) / 2.0)
    assert_allclose(middle_pose(load_robot("two_link")), 0.0)


@pytest.mark.parametrize("name", robot_names())
def test_every_line_begins_at_the_base_or_where_another_ends_and_one_leads_to_the_tip(name: str) -> None:
    robot = load_robot(name)
    q = np.linspace(-0.4, 0.7, robot.n)
    lines = link_segments(robot, q)
    ends = np.vstack([np.zeros((1, 3)), lines[:, 1]])
    for start in lines[:, 0]:
        assert np.linalg.norm(ends - start, axis=1).min() < 1e-12
    assert_allclose(lines[len(robot.link_names), 1], forward_kinematics(robot, q).position, atol=1e-12)


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
