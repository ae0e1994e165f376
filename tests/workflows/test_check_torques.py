from pathlib import Path

import numpy as np
import pytest

from catenary.errors import InputError
from catenary.robots.catalog import load_robot
from catenary.workflows.check import check_file
from command_line import catenary
from moving_arm import recorded, write_npz


def test_a_recording_for_identification_tells_what_it_shows(moving_arm_logs: Path) -> None:
    found = check_file(str(moving_arm_logs / "run0.npz"), robot="raven2")
    assert found.kind == "recording for identification"
    assert found.faults == []
    assert any("shows all" in remark and "condition" in remark for remark in found.remarks)
    outcome = catenary("check", moving_arm_logs / "run0.npz", "--robot", "raven2")
    assert outcome.code == 0
    assert "nothing wrong found" in outcome.out


def test_whose_it_is_must_be_said(moving_arm_logs: Path) -> None:
    with pytest.raises(InputError, match="of which robot\\? name it with --robot"):
        check_file(str(moving_arm_logs / "run0.npz"))


def test_torques_that_are_not_the_motions_are_faults(tmp_path: Path) -> None:
    log = recorded(load_robot("raven2"), 0, noise=0.1)
    write_npz(log, tmp_path / "turned.npz", tau=np.array(log.tau) * [1.0, -1.0, 1.0])
    found = check_file(str(tmp_path / "turned.npz"), robot="raven2")
    assert [finding.name for finding in found.findings] == ["sign"]
    assert any(fault.startswith("sign: elbow") for fault in found.faults)


def test_a_joint_that_stands_still_shows_too_little(tmp_path: Path) -> None:
    log = recorded(load_robot("raven2"), 0)
    q, qd = np.array(log.q_nominal), np.array(log.qd)
    q[:, 1], qd[:, 1] = q[0, 1], 0.0
    write_npz(log, tmp_path / "still.npz", q=q, dq=qd)
    found = check_file(str(tmp_path / "still.npz"), robot="raven2")
    assert any("base parameters" in fault for fault in found.faults)
    assert "stands still: elbow" in found.remarks
