from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import simulated_arm
from catenary.plant import MotionLog
from catenary.robots.catalog import load_robot
from catenary.workflows.check import check_file, check_robot
from catenary.workflows.recording_screen import check_recording
from command_line import catenary
from moving_arm import recorded, write_npz

ARRAYS = simulated_arm.arrays()
LOG = MotionLog(
    "run", ("J1", "J2", "J3"), ("rad", "rad", "m"), ARRAYS["q_des"], ARRAYS["ok"],
    q_encoder=ARRAYS["q_act"], time=ARRAYS["t"],
)  # fmt: skip
AT_2 = (slice(None), 1)
STAMPS = np.arange(400) / 30.0


def changed(values: np.ndarray, rows: Any, value: float) -> np.ndarray:
    values = values.copy()
    values[rows] = value
    return values


@pytest.mark.alike
@pytest.mark.parametrize(
    ("changes", "faults", "remarks"),
    [
        ({}, [], []),
        ({"time": np.random.default_rng(0).permutation(STAMPS)}, ["stamps: time goes back 199 times"], None),
        ({"time": STAMPS + 60.0 * (STAMPS > 6.0)}, [], []),
        ({"q_encoder": changed(ARRAYS["q_act"], (7, 0), 2.0)}, [], ["outliers: J1: 1 of 400 errors lie beyond 10 robust"]),
        ({"q_encoder": None}, ["no measured joint positions (q_encoder): it cannot be calibrated from"], []),
        ({"ok": np.zeros(400, dtype=bool)}, ["short: ok is set on no row"], []),
        (
            {"q_nominal": changed(ARRAYS["q_des"], AT_2, 0.3), "q_encoder": changed(ARRAYS["q_act"], AT_2, 0.31)},
            [], ["constant: J2: never moved"],
        ),
        (
            {"q_nominal": changed(ARRAYS["q_des"], AT_2, 0.3)},
            ["constant: J2: every command is the same"], ["constant: J2: never moved"],
        ),
    ],
)  # fmt: skip
def test_findings_of_a_recording(changes: dict[str, Any], faults: list[str], remarks: Any) -> None:
    finding = check_recording(replace(LOG, **changes))
    further = [remark for remark in finding.remarks if not remark.startswith(("delay: ", "few reversals"))]
    for said, expected in ((finding.faults, faults), (further, remarks)):
        assert expected is None or len(said) == len(expected)
        assert all(map(str.startswith, said, expected or []))


def test_the_verdict_names_a_doubt_that_is_no_fault() -> None:
    leapt = ARRAYS["q_act"] + np.outer(np.arange(len(ARRAYS["q_act"])) >= 200, [0.04, 0.0, 0.0])
    found = check_recording(replace(LOG, q_encoder=leapt))
    assert found.faults == []
    assert found.verdict.startswith("in doubt: jump of J1; otherwise nothing wrong found")


def test_readings_of_an_inertial_unit_are_no_failed_import(tmp_path: Path) -> None:
    rows = np.column_stack([0.01 * np.arange(50), np.tile([0.0, 0.0, 9.8, 0.0, 0.0, 0.0], (50, 1))])
    np.savetxt(tmp_path / "imu.csv", rows, delimiter=",", header="time,ax,ay,az,gx,gy,gz", comments="")
    found = check_file(str(tmp_path / "imu.csv"))
    assert (found.faults, found.facts["readings"], found.facts["mean_force"]) == ([], 50, pytest.approx([0, 0, 9.8]))
    assert found.next == f"catenary sense --replay {tmp_path / 'imu.csv'}"


def test_an_inertia_that_no_body_has_is_a_fault(tmp_path: Path) -> None:
    text = simulated_arm.DH_TABLE.replace("[0.01, 0, 0, 0.01, 0, 0.01]", "[0.01, 0, 0, 0.01, 0, 0.05]")
    (tmp_path / "arm.toml").write_text(text)
    (fault,) = check_file(str(tmp_path / "arm.toml")).faults
    assert fault.startswith('link "shoulder": inertia has principal moments')


def test_limits_the_wrong_way_round_are_a_fault() -> None:
    model = load_robot("raven2")
    assert len(check_robot(replace(model, lower=model.upper, upper=model.lower)).faults) == 3


def test_facts_of_a_recording_are_numbers_with_units() -> None:
    facts = check_recording(replace(LOG, time=STAMPS + 60.0 * (STAMPS > 6.0))).as_data()["facts"]
    assert (facts["rows"], facts["measured_rows"], facts["gaps"]) == (400, 400, 1)
    assert facts["longest_gap_s"] == pytest.approx(60.0 + 1 / 30.0)
    slide = facts["joints"][2]
    assert (slide["name"], slide["unit"], slide["error_unit"]) == ("J3", "m", "mm")
    assert slide["lowest"] == ARRAYS["q_des"][:, 2].min()
    error = 1000.0 * (ARRAYS["q_act"] - ARRAYS["q_des"])[:, 2]
    assert slide["error_largest"] == pytest.approx(np.abs(error).max())
    unmeasured = check_recording(replace(LOG, q_encoder=None, time=None)).as_data()["facts"]
    assert [joint["error_rms"] for joint in unmeasured["joints"]] == [None] * 3
    assert [unmeasured[name] for name in ("duration_s", "gaps", "robot")] == [None] * 3


def test_facts_of_a_robot_are_numbers_with_units() -> None:
    facts = check_robot(load_robot("raven2")).as_data()["facts"]
    assert facts["joints"][0] == {"name": "shoulder", "unit": "rad", "lower": 0.0, "upper": np.pi / 2}
    assert facts["moving_mass_kg"] == load_robot("raven2").tree.mass.sum()


def test_a_robot_that_is_there_to_be_identified_has_no_fault() -> None:
    finding = check_file("dvrk_psm_motors")
    assert not finding.faults
    assert any("has no inertia, to be identified" in remark for remark in finding.remarks)


def test_a_recording_for_identification_tells_what_it_shows(moving_arm_logs: Path) -> None:
    found = check_file(str(moving_arm_logs / "run0.npz"), robot="raven2")
    assert found.kind == "recording for identification"
    assert found.faults == []
    assert any("shows all" in remark and "condition" in remark for remark in found.remarks)
    outcome = catenary("check", moving_arm_logs / "run0.npz", "--robot", "raven2")
    assert outcome.code == 0
    assert "nothing wrong found" in outcome.out


def test_a_joint_that_stands_still_shows_too_little(tmp_path: Path) -> None:
    log = recorded(load_robot("raven2"), 0)
    q, qd = np.array(log.q_nominal), np.array(log.qd)
    q[:, 1], qd[:, 1] = q[0, 1], 0.0
    write_npz(log, tmp_path / "still.npz", q=q, dq=qd)
    found = check_file(str(tmp_path / "still.npz"), robot="raven2")
    assert any("base parameters" in fault for fault in found.faults)
    assert "stands still: elbow" in found.remarks
