"""Stuck encoders and slack, over every container that a recording may come in."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from catenary.arrays import Floats
from catenary.calibration.dataset import calibration_data
from catenary.calibration.evaluate import evaluate
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.fit_recordings import fit_logs
from catenary.plant import MotionLog
from catenary.recording.import_formats.mapping import Quantity, RecordingMapping
from catenary.recording.logs import Reading, read_recording
from catenary.verdict.check import findings_of
from catenary.verdict.corrections import Mend
from catenary.verdict.sensor_faults import filled_findings
from hysteretic_arm import play
from hysteretic_arm import recording as hysteretic
from tests.lab_bags import JOINT_STATE, joint_state, write_bag
from tests.truth.spoilings import filled

NAMES = ("a", "b")
STEP = 0.02  # [s]
COUNT = 2.0 * np.pi / 16384.0  # [rad] of an encoder of 14 bits
CONTAINERS = ["ros1", "mcap", "csv", "npz", "mapped npz"]


def motor(rows: int, seed: int = 0) -> Floats:
    """Two joints that go to and fro, each stroke as long and as fast as chance will have it, (rows, 2) [rad]."""
    rng, columns = np.random.default_rng(seed), []
    for _ in NAMES:
        turning = np.cumsum(rng.uniform(0.5, 5.0, rows))
        side = np.where(np.arange(rows) % 2, 1.0, -1.0) * rng.uniform(0.02, 0.5, rows)
        columns.append(np.interp(STEP * np.arange(rows), turning, side))
    return np.column_stack(columns)


def behind_slack(q: Floats, half_width: float = 0.1) -> Floats:
    """Where joints are behind slack, in whole counts of their encoders, (N, n) [rad]."""
    joints = np.column_stack([play(column, half_width) for column in q.T])
    counted: Floats = np.round(joints / COUNT) * COUNT
    return counted


def recorded(folder: Path, container: str, q: Floats, measured: Floats) -> MotionLog:
    """Write motors and encoders as a container has them, and read it as a user does."""
    time = STEP * np.arange(len(q))
    if container in ("ros1", "mcap"):
        topics = {"/motors": JOINT_STATE, "/encoders": JOINT_STATE}
        messages = [
            (t, topic, joint_state(NAMES, row))
            for topic, rows in zip(topics, (q, measured), strict=True)
            for t, row in zip(time, rows, strict=True)
        ]
        path = write_bag(folder / "bag", "ros1" if container == "ros1" else "mcap", topics, messages)
        columns = ("/motors.position", "/encoders.position")
    elif container == "csv":
        path = folder / "run.csv"
        table = np.column_stack([time, q, measured])
        np.savetxt(path, table, delimiter=",", header="time,q_a,q_b,e_a,e_b", comments="", fmt="%.17g")
        columns = ("q_*", "e_*")
    else:
        path = folder / "run.npz"
        np.savez(path, q_des=q, q_act=measured, ok=np.ones(len(q), dtype=bool), t=time)
        if container == "npz":
            return read_recording(path, Reading(units=("rad", "rad"), joint_names=NAMES))
        columns = ("q_des", "q_act")
    mapping = RecordingMapping(
        q_nominal=Quantity(columns=(columns[0],), units=("rad", "rad")),
        q_encoder=Quantity(columns=(columns[1],), units=("rad", "rad")),
        joint_names=NAMES,
    )
    return read_recording(path, Reading(mapping=mapping))


@pytest.mark.alike
@pytest.mark.parametrize("container", CONTAINERS)
def test_slack_is_no_stuck_encoder_in_any_container(tmp_path: Path, container: str) -> None:
    q = motor(3000)
    log = recorded(tmp_path, container, q, behind_slack(q))
    assert (len(log), int(log.ok.sum())) == (3000, 3000)
    assert [each for each in findings_of(log) if each.name == "stuck"] == []


@pytest.mark.parametrize("container", CONTAINERS)
def test_an_encoder_stuck_in_the_middle_of_a_stroke_is_found_in_every_container(tmp_path: Path, container: str) -> None:
    q = motor(3000)
    measured = behind_slack(q, 0.05)
    measured[1000:1100, 1] = measured[1000, 1]
    assert np.ptp(q[1000:1100, 1]) > 3 * 0.1
    log = recorded(tmp_path, container, q, measured)
    assert log.ok.all()
    (found,) = [each for each in findings_of(log) if each.name == "stuck"]
    assert found.joints == (log.joint_names[1],)
    assert found.refuses
    assert "3.3% of them" in found.says
    assert found.remedy == "--leave-out 1000:1100"


@pytest.mark.parametrize("joints", [[0], [0, 1]])
def test_encoders_that_stop_for_ever_are_found(joints: list[int]) -> None:
    q = motor(3000)
    measured = behind_slack(q, 0.03)
    measured[2000:, joints] = measured[2000, joints]
    log = MotionLog("run", NAMES, ("rad", "rad"), q, np.ones(3000, dtype=bool), q_encoder=measured)
    (found,) = [each for each in findings_of(log) if each.name == "stuck"]
    assert found.joints == tuple(NAMES[j] for j in joints)
    assert found.remedy.endswith(":3000")


def test_a_drop_of_messages_repeated_for_all_joints_is_found_though_one_has_much_slack() -> None:
    q = motor(3000)
    measured = np.column_stack([behind_slack(q, 0.2)[:, 0], behind_slack(q, 0.01)[:, 1]])
    measured[1000:1100] = measured[1000]
    log = MotionLog("run", NAMES, ("rad", "rad"), q, np.ones(3000, dtype=bool), q_encoder=measured)
    (found,) = [each for each in findings_of(log) if each.name == "stuck"]
    assert "b" in found.joints


@pytest.mark.parametrize("container", ["ros1", "csv"])
def test_the_error_claimed_behind_slack_is_the_error_on_motion_to_come(tmp_path: Path, container: str) -> None:
    rows = 6000
    q, later = motor(rows), motor(5 * rows, seed=1)
    log = recorded(tmp_path, container, q, behind_slack(q))
    found = fit_logs([log], FitOptions(kind="linear"))
    assert len(found.data) == rows
    test = MotionLog(
        "later", log.joint_names, log.joint_units, later, np.ones(len(later), dtype=bool),
        q_encoder=behind_slack(later), time=STEP * np.arange(len(later)),
    )  # fmt: skip
    seen = evaluate(found.model, calibration_data([test], found.model.features))
    for claimed, joint in zip(found.spread, seen.joints, strict=True):
        assert claimed.rmse_mean == pytest.approx(joint.rmse, rel=0.15)
        assert joint.coverage > 0.85


def way_points(rng: np.random.Generator, rows: int = 3000) -> MotionLog:
    """Three joints at way-points that have nothing to do with each other, so that motion says nothing of errors."""
    q = rng.uniform(-1.0, 1.0, size=(rows, 3))
    return MotionLog(
        "w", ("a", "b", "c"), ("rad",) * 3, q, np.ones(rows, dtype=bool), q + 0.01 * rng.normal(size=q.shape)
    )


@pytest.mark.parametrize(
    ("lost", "named"),
    [
        (lambda away, rng: (away > np.quantile(away, 0.85, axis=0)).any(axis=1), True),
        (lambda away, rng: rng.uniform(size=len(away)) < 0.4, False),
        (lambda away, rng: np.zeros(len(away), dtype=bool), False),
    ],
    ids=["cut out by their errors", "lost by chance", "none"],
)
def test_rows_that_were_cut_out_by_their_errors_are_told_by_how_sharply_the_others_end(lost, named) -> None:
    rng = np.random.default_rng(8)
    log = way_points(rng)
    assert log.q_encoder is not None
    away = np.abs(log.q_encoder - log.q_nominal)
    found = [each for each in findings_of(replace(log, ok=~lost(away, rng))) if each.name == "missing"]
    assert bool(found) is named
    assert all("errors of the others end sharply" in each.says for each in found)


@pytest.mark.parametrize("way", ["worst", "chance", "worst of way-points"])
def test_single_rows_that_somebody_took_out_are_told_by_stamps_and_motion(way: str) -> None:
    rng, t = np.random.default_rng(4), STEP * np.arange(4000)
    q = np.column_stack([0.5 * np.sin(2.0 * np.pi * f * t) for f in (0.2, 0.31, 0.43)])
    q = rng.uniform(-1.0, 1.0, q.shape) if "points" in way else q
    error = 0.1 * q[:, [1, 2, 0]] + 1e-3 * rng.normal(size=q.shape)
    size = np.linalg.norm(error, axis=1)
    worst = size > np.quantile(size, 0.8)
    kept = rng.uniform(size=len(t)) > 0.1 if way == "chance" else ~worst | (np.cumsum(worst) % 2 == 0)
    log = MotionLog(
        "w", ("a", "b", "c"), ("rad",) * 3, q[kept], np.ones(kept.sum(), dtype=bool), (q + error)[kept], time=t[kept]
    )
    assert any(each.name == "missing" for each in findings_of(log)) is (way == "worst")


@pytest.mark.parametrize(("by_commands", "says"), [(False, "straight lines"), (True, "commands themselves")])
def test_gaps_that_somebody_filled_are_told_and_left_out_by_the_remedy(by_commands: bool, says: str) -> None:
    log = filled(hysteretic(), 0.1, by_commands)
    (told,) = [each for each in findings_of(log) if each.name == "filled"]
    assert (says in told.says, told.refuses) == (True, False)
    mended = Mend(leave_out=(told.remedy.split()[1],))(log)
    touched = (log.q_encoder != hysteretic().q_encoder).all(axis=1)
    assert (touched & mended.ok).sum() <= 0.1 * touched.sum()
    assert not any(each.name == "filled" for each in findings_of(mended))


@pytest.mark.parametrize("seen", [lambda q: q, lambda q: np.round(q / COUNT) * COUNT, np.sin, behind_slack])
def test_smooth_motion_without_noise_is_not_taken_for_filled_gaps(seen: Callable[[Floats], Floats]) -> None:
    t = 1e-3 * np.arange(20_000)[:, None]
    q = np.sin(t * [0.3, 0.5])  # hardly bent from row to row
    commands = np.round(q / 1e-4) * 1e-4
    log = MotionLog("smooth", NAMES, ("rad", "rad"), commands, np.ones(len(t), dtype=bool), 0.9 * seen(q), t[:, 0])
    assert filled_findings(log) == []
