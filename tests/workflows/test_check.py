from dataclasses import replace
from pathlib import Path

import numpy as np

import simulated_arm
from catenary.plant import MotionLog
from catenary.robots.catalog import load_robot
from catenary.workflows.check import Finding, check_file, check_recording, check_robot


def log(**changes: object) -> MotionLog:
    arrays = simulated_arm.arrays()
    whole = MotionLog(
        name="run",
        joint_names=("J1", "J2", "J3"),
        joint_units=("rad", "rad", "m"),
        q_nominal=arrays["q_des"],
        q_encoder=arrays["q_act"],
        ok=arrays["ok"],
        time=arrays["t"],
    )
    return replace(whole, **changes)  # type: ignore[arg-type]


def test_a_sound_recording_has_no_faults() -> None:
    finding = check_recording(log())
    assert (finding.faults, finding.remarks) == ([], [])


def test_ranges_and_errors_are_told_in_deg_and_mm() -> None:
    arrays = simulated_arm.arrays()
    error = 1000.0 * (arrays["q_act"] - arrays["q_des"])[:, 2]
    expected = f"error RMS {np.sqrt(np.mean(error**2)):.3f}, largest {np.abs(error).max():.2f} mm"
    assert dict(check_recording(log()).facts)["J3"].endswith(expected)


def test_time_that_goes_back_often_is_a_fault() -> None:
    shuffled = np.random.default_rng(0).permutation(400) / 30.0
    assert any("time goes back" in fault for fault in check_recording(log(time=shuffled)).faults)


def test_a_gap_is_a_remark() -> None:
    time = np.arange(400) / 30.0
    time[200:] += 60.0
    assert any("gaps longer than" in remark for remark in check_recording(log(time=time)).remarks)


def test_wild_measurements_are_a_fault() -> None:
    q_act = simulated_arm.arrays()["q_act"].copy()
    q_act[7, 0] += 2.0
    faults = check_recording(log(q_encoder=q_act)).faults
    assert len(faults) == 1
    assert faults[0].startswith("J1: 1 errors lie beyond 10 robust standard deviations")


def test_a_recording_without_measurements_is_a_fault() -> None:
    assert check_recording(log(q_encoder=None)).faults == [
        "no measured joint positions (q_encoder): it cannot be calibrated from"
    ]
    assert check_recording(log(ok=np.zeros(400, dtype=bool))).faults == [
        "ok is set on no row: it cannot be calibrated from"
    ]


def test_a_joint_at_rest_is_a_remark() -> None:
    q = simulated_arm.arrays()["q_des"].copy()
    q[:, 1] = 0.3
    assert "J2 never moves" in check_recording(log(q_nominal=q)).remarks


def test_an_inertia_that_no_body_has_is_a_fault(tmp_path: Path) -> None:
    text = simulated_arm.DH_TABLE.replace("[0.01, 0, 0, 0.01, 0, 0.01]", "[0.01, 0, 0, 0.01, 0, 0.05]")
    (tmp_path / "arm.toml").write_text(text)
    faults = check_file(str(tmp_path / "arm.toml")).faults
    assert len(faults) == 1
    assert faults[0].startswith("inertia of shoulder")


def test_limits_the_wrong_way_round_are_a_fault() -> None:
    model = load_robot("raven2")
    crossed = replace(model, lower=model.upper, upper=model.lower)
    assert len(check_robot(crossed).faults) == 3


def test_a_finding_is_plain_data() -> None:
    finding = Finding("robot", [("a", "b")], ["fault"], ["remark"])
    assert finding.as_data() == {
        "kind": "robot",
        "facts": {"a": "b"},
        "faults": ["fault"],
        "remarks": ["remark"],
    }


def test_a_robot_that_is_there_to_be_identified_has_no_fault():
    finding = check_file("dvrk_psm")
    assert not finding.faults
    assert any("kinematics only, to be identified" in remark for remark in finding.remarks)
