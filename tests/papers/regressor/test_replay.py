from pathlib import Path

import numpy as np
from numpy.testing import assert_allclose

from catenary import gravity_torque, load_robot
from catenary.identification.samples import Samples
from catenary.spatial import LEVEL
from papers.experiment import Outcomes, Scope
from papers.regressor import replay
from papers.regressor.recorded_arms import law, least_squares, replayed

ARM = load_robot("planar_3r")


def held(count: int) -> Samples:
    """Poses of an arm without friction, held at rest."""
    q = np.random.default_rng(0).uniform(-1.0, 1.0, size=(count, 3))
    zero = np.zeros_like(q)
    tau = gravity_torque(ARM, q, LEVEL)
    return Samples("made", q, zero, zero, tau, zero, np.arange(float(count)), 1.0)


def test_an_estimator_hears_the_first_rows_alone_and_foretells_the_others() -> None:
    samples = held(30)
    ahead, learnt = replayed(least_squares(ARM, samples.tau), samples, static=True, until=20)
    assert_allclose(ahead[0], 0.0)
    assert_allclose(ahead[20:], learnt[20:])
    assert np.abs(learnt[20:] - samples.tau[20:]).max() < 0.15 * np.abs(samples.tau).max()


def test_the_law_knows_the_pose_that_it_heard_last() -> None:
    samples = held(6)
    _, learnt = replayed(law(ARM), samples, static=True, until=4)
    # 2 s at 4 / s, and the damping of Z^+
    assert_allclose(learnt[3], samples.tau[3], atol=0.02 * np.abs(samples.tau).max())


def outcomes(left: float) -> Outcomes:
    result = {
        "axes": [f"q{k}" for k in range(1, 8)],
        "units": ["rad"] * 7,
        "rows": [100, 60],
        "rms_Nm_or_N": {"none": [1.0] * 7, "law": [left] * 7, "least squares": [0.1] * 7},
        "row": [0, 50, 99],
        "torque_Nm_or_N": {name: [[0.0, 1.0, 0.5]] * 7 for name in replay.COLORS},
    }
    return Outcomes({replay.replay.case(recording=name, rows=None): result for name in replay.RECORDINGS})


def test_report_and_verdicts() -> None:
    report = replay.report(outcomes(0.2))
    assert [len(one.table.rows) for one in report.tables] == [3] * 5
    assert len(report.pictures) == 2
    assert [claim.judge(outcomes(0.2)).verdict for claim in replay.CLAIMS] == ["reproduced", "not reproduced"]
    assert [claim.judge(outcomes(0.8)).verdict for claim in replay.CLAIMS] == ["not reproduced", "reproduced"]
    assert len(replay.report(Outcomes({})).remarks) == 5


def test_recordings_that_are_not_there_are_left_out(tmp_path: Path) -> None:
    assert replay.cases(Scope(data=tmp_path)) == []
    assert replay.cases(Scope(data=None)) == []
