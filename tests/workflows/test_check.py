from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import simulated_arm
from catenary.plant import MotionLog
from catenary.robots.catalog import load_robot
from catenary.workflows.check import FileReport, check_file, check_recording, check_robot

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


def test_ranges_and_errors_are_told_in_deg_and_mm() -> None:
    error = 1000.0 * (ARRAYS["q_act"] - ARRAYS["q_des"])[:, 2]
    expected = f"error RMS {np.sqrt(np.mean(error**2)):.3f}, largest {np.abs(error).max():.2f} mm"
    assert dict(check_recording(LOG).facts)["J3"].endswith(expected)


@pytest.mark.parametrize(
    ("changes", "faults", "remarks"),
    [
        ({}, [], []),
        ({"time": np.random.default_rng(0).permutation(STAMPS)}, ["stamps: time goes back 199 times"], None),
        ({"time": STAMPS + 60.0 * (STAMPS > 6.0)}, [], ["1 gaps longer than"]),
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
    for said, expected in ((finding.faults, faults), (finding.remarks, remarks)):
        assert expected is None or len(said) == len(expected)
        assert all(map(str.startswith, said, expected or []))


def test_an_inertia_that_no_body_has_is_a_fault(tmp_path: Path) -> None:
    text = simulated_arm.DH_TABLE.replace("[0.01, 0, 0, 0.01, 0, 0.01]", "[0.01, 0, 0, 0.01, 0, 0.05]")
    (tmp_path / "arm.toml").write_text(text)
    (fault,) = check_file(str(tmp_path / "arm.toml")).faults
    assert fault.startswith('link "shoulder": inertia has principal moments')


def test_limits_the_wrong_way_round_are_a_fault() -> None:
    model = load_robot("raven2")
    assert len(check_robot(replace(model, lower=model.upper, upper=model.lower)).faults) == 3


def test_a_finding_is_plain_data() -> None:
    data = FileReport("robot", [("a", "b")], ["fault"], ["remark"]).as_data()
    assert data == {
        "kind": "robot",
        "facts": {"a": "b"},
        "faults": ["fault"],
        "remarks": ["remark"],
        "findings": [],
    }


def test_a_robot_that_is_there_to_be_identified_has_no_fault() -> None:
    finding = check_file("dvrk_psm")
    assert not finding.faults
    assert any("kinematics only, to be identified" in remark for remark in finding.remarks)
