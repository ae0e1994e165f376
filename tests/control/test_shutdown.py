"""A loop whose torques or positions stop being numbers gives up, and leaves the robot holding and paused."""

import re

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.arrays import Floats
from catenary.control.loop import run_loop
from catenary.control.pd import JointPD
from catenary.control.shutdown import attempt
from catenary.errors import NotFiniteError
from catenary.plant import JointState
from catenary.trajectories.reference import Reference, Rest
from catenary.workflows.robot.motion import move_to
from oracles.ideal_plant import MassPlant

PD = JointPD([400.0, 400.0], [40.0, 40.0])
AT = np.array([0.3, -0.3])


class Gaps:
    """Asks for no torque of its second joint, and for NaN in the ticks that it is told."""

    def __init__(self, *ticks: int) -> None:
        self._ticks, self._tick = frozenset(ticks), 0

    def torque(self, state: JointState, reference: Reference) -> Floats:
        self._tick += 1
        return np.array([np.nan if self._tick in self._ticks else 0.0, 0.0])


class BlindPlant(MassPlant):
    """Its second joint is not measured any more from its tenth tick on."""

    def measured_js(self) -> JointState:
        state = super().measured_js()
        if self.ticks >= 10:
            state.q[1] = np.nan
        return state


@pytest.mark.parametrize("limit", [20, 3])
def test_a_loop_without_finite_torques_gives_up(limit: int) -> None:
    plant = MassPlant(AT)
    with pytest.raises(NotFiniteError) as caught:
        run_loop(plant, Gaps(*range(6, 100)), Rest(AT, 0.2), give_up_after=limit)
    assert re.match(rf'not finite within {limit} ticks: torque of "j0" \({limit} ticks\);', str(caught.value))
    report = caught.value.loop_report  # type: ignore[attr-defined]
    assert (report.ticks, report.not_finite_ticks, report.finished) == (5 + limit - 1, limit, False)
    verbs = [verb for verb, _ in plant.log]
    assert verbs == ["servo_jf"] * (5 + limit - 1) + ["servo_jp", "state_command"]
    assert_array_equal(plant.log[-2][1], AT)
    assert plant.state.state == "PAUSED"


def test_gaps_that_are_shorter_are_zero_torque_and_counted() -> None:
    plant = MassPlant(AT)
    report = run_loop(plant, Gaps(*range(1, 20), *range(101, 120)), Rest(AT, 0.2))
    assert (report.finished, report.not_finite_ticks) == (True, 38)
    assert not np.any([values for verb, values in plant.log if verb == "servo_jf"])


@pytest.mark.parametrize(("lost", "of"), [(19, 20), (1, 2), (2, 5)])
def test_a_loop_that_lacks_torques_in_a_share_of_ticks_for_ever_ends(lost: int, of: int) -> None:
    plant = MassPlant(AT)
    gaps = Gaps(*(k for k in range(3000) if k % of < lost))
    with pytest.raises(NotFiniteError, match=r'torque of "j0" \(\d+ ticks\); .* and in four of five'):
        run_loop(plant, gaps, Rest(AT, 3.0))
    assert plant.time < 0.2
    assert plant.state.state == "PAUSED"


def test_a_tenth_of_ticks_without_torque_does_not_end_a_loop() -> None:
    report = run_loop(MassPlant(AT), Gaps(*range(1, 3000, 10)), Rest(AT, 3.0))
    assert (report.finished, report.not_finite_ticks) == (True, 300)


@pytest.mark.parametrize("controller", [PD, None])
def test_a_loop_without_finite_positions_holds_at_the_last_ones(controller: JointPD | None) -> None:
    plant = BlindPlant(AT)
    with pytest.raises(NotFiniteError, match=r'measured position of "j1" \(20 ticks\)'):
        run_loop(plant, controller, Rest(AT, 0.2))
    assert_array_equal(plant.log[-2][1], AT)
    assert [verb for verb, _ in plant.log[-2:]] == ["servo_jp", "state_command"]
    assert plant.state.state == "PAUSED"


def test_a_robot_without_position_control_is_left_without_torque() -> None:
    plant = BlindPlant(AT)
    plant.supports = frozenset({"servo_jf"})
    with pytest.raises(NotFiniteError):
        run_loop(plant, PD, Rest(AT + 0.09, 0.2))
    assert_array_equal(plant.tau, np.zeros(2))
    assert plant.state.state == "PAUSED"


def test_at_a_motions_end_a_robot_holds_where_it_was_measured_last() -> None:
    plant = BlindPlant(AT)
    assert run_loop(plant, PD, Rest(AT, 0.02)).finished
    assert_array_equal(plant.log[-1][1], AT)


def test_setpoints_are_not_streamed_to_a_robot_that_is_not_measured() -> None:
    plant = BlindPlant(AT)
    with pytest.raises(NotFiniteError, match=r'measured position of "j1" \(20 ticks\)'):
        move_to(plant, AT + 0.1)
    sent = [values for verb, values in plant.log if verb == "servo_jp"]
    assert len(sent) == 9 + 20 + 1
    assert sent[-1][1] == sent[8][1]  # where it was set when it was measured last
    assert plant.state.state == "PAUSED"


@pytest.mark.parametrize("error", [NotFiniteError("x"), KeyboardInterrupt()])
def test_a_first_ctrl_c_while_a_robot_is_left_safe_is_raised_when_it_is(error: BaseException) -> None:
    done: list[str] = []

    def interrupted() -> None:
        raise KeyboardInterrupt

    def leave() -> None:
        attempt(error, holding=interrupted, pausing=lambda: done.append("paused"))

    if isinstance(error, KeyboardInterrupt):
        leave()
    else:
        with pytest.raises(KeyboardInterrupt):
            leave()
    assert done == ["paused"]
