import numpy as np
import pytest

from catenary import MotionLog
from papers.calibration.peer_hours import PEERS, at_rows, peer_cases, peer_hours
from papers.calibration.sessions import recorded
from papers.experiment import Scope


def test_some_rows_of_a_recording_keep_every_column() -> None:
    q = np.arange(12.0).reshape(4, 3)
    log = MotionLog(
        "log",
        ("a", "b", "c"),
        ("rad", "rad", "m"),
        q,
        np.array([True, False, True, True]),
        q_encoder=q + 1.0,
        time=np.arange(4.0),
        tau=2.0 * q,
        signals={"more": np.arange(4.0)},
    )
    few = at_rows(log, np.array([1, 3]))
    np.testing.assert_array_equal(few.q_nominal, q[[1, 3]])
    np.testing.assert_array_equal(few.tau, 2.0 * q[[1, 3]])
    np.testing.assert_array_equal(few.signals["more"], [1.0, 3.0])
    assert few.ok.tolist() == [False, True]


def test_every_robot_has_a_case_and_the_quick_one_little_of_everything() -> None:
    assert len(peer_cases(Scope(robots=(None, 1, 2)))) == 3
    (quick,) = peer_cases(Scope(robots=(None,), networks=1, quick=True))
    assert quick.arguments["effort"] < 0.1


@pytest.mark.slow
def test_the_motion_does_not_depend_on_how_often_it_is_sampled() -> None:
    often, seldom = (
        recorded(None, "unloaded", zigzags=[2], hour_seconds=20.0, test_rate=rate).test[5]
        for rate in (1000.0, 2.0)
    )
    for j in range(3):
        told = np.interp(seldom.time, often.time, often.q_nominal[:, j])
        # linear between samples of 1 ms
        np.testing.assert_allclose(told, seldom.q_nominal[:, j], atol=1e-5)


@pytest.mark.slow
def test_all_peers_are_tested_in_every_hour() -> None:
    found = peer_hours(None, [0], "1/2", 0.02, [2], 60.0)
    assert set(found) == {*PEERS, "identified"}
    for peer in PEERS:
        assert len(found[peer]) == 6
        x, y, z, distance = found[peer][0]["tip"]
        assert distance == pytest.approx(np.sqrt(x**2 + y**2 + z**2), abs=1e-5)
        assert found[peer][0]["errors"][1] < 7.5  # what homing leaves of joint 2's offset is learned [deg]
