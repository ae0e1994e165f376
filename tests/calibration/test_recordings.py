from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.calibration.recordings import Recordings, sampling_rate
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.verdict import check
from recordings import recording
from tests.verdict.test_delay import cable_arm

OTHERS = r'"run2" has .*recording "run1" has'


def run(seed: int = 0, **changes: object) -> MotionLog:
    return recording(np.random.default_rng(seed), rows=50, name=f"run{seed}", **changes)


@pytest.mark.parametrize(
    ("logs", "message"),
    [
        ([run(1, robot="raven2"), run(2, robot="dvrk")], "are of two robots: raven2 and dvrk"),
        ([run(1), run(2, joint_names=("a", "b", "c"))], OTHERS),
        ([run(1), run(2, joint_units=("rad", "m", "m"))], OTHERS),
        ([], "at least one recording"),
    ],
)
def test_recordings_that_do_not_go_together_are_refused(logs: list[MotionLog], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Recordings.of(logs)


def test_joints_stand_in_the_first_ones_order_and_limits_are_in_si() -> None:
    first, second = run(1), run(2)
    turned = replace(
        second, joint_names=second.joint_names[::-1], joint_units=second.joint_units[::-1],
        q_nominal=second.q_nominal[:, ::-1], q_encoder=second.q_encoder[:, ::-1],
    )  # fmt: skip
    found = Recordings.of([first, turned], max_error=(1.0, 2.0, 3.0))
    assert_array_equal(found.logs[1].q_nominal, second.q_nominal)
    assert_allclose(found.max_error, [np.pi / 180.0, np.pi / 90.0, 3e-3])


def test_a_delay_is_found_once_however_many_models_ask(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, find = list[object](), check.delay_findings
    monkeypatch.setattr(check, "delay_findings", lambda *of: asked.append(of) or find(*of))
    recordings = Recordings.of([cable_arm(seconds=30.0)])
    first = recordings.judged(testing=True)
    again = recordings.judged(testing=True, trained=(np.full(3, -9.0), np.full(3, 9.0)))
    assert first.delays == again.delays != [None]
    assert len(asked) == 1


def test_rate_is_that_of_most_steps() -> None:
    time = np.arange(50) / 30.0
    time[20:] += 7.0  # a pause
    time[40:] -= 9.0  # another recording begins
    assert sampling_rate(replace(run(), time=time)) == pytest.approx(30.0)
