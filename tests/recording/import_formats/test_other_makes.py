"""Heads of tables as other makes write them: what is proposed without a question is right."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from catenary.recording.import_formats.columns import places_of
from catenary.recording.import_formats.recording_files import Sources
from catenary.workflows.import_recording import propose_mapping
from gallery import QD, TAU, Q, T

DEG = 180.0 / np.pi
POSITIONS, SPEEDS, TORQUES = np.hstack([Q, Q[::-1]]), np.hstack([QD, -QD[::-1]]), np.hstack([TAU, TAU[::-1]])
REST = np.hstack([np.cos(Q), np.cos(QD)])
# groups of columns, {} the joint; the first is q_nominal, one of Nm or torque is tau
MAKES: dict[str, dict[str, np.ndarray]] = {
    "kuka": {"AxisAct_A{}": DEG * POSITIONS, "AxisCmd_A{}": DEG * POSITIONS + 0.01, "Torque_A{}": TORQUES},
    "abb": {"J{} Position [rad]": POSITIONS, "J{} Speed [rad/s]": SPEEDS, "J{} Torque [Nm]": TORQUES},
    "fanuc": {"J{}(deg)": DEG * POSITIONS, "J{} Disturbance(%)": TORQUES},
    "cia402": {"actual_position_{}": POSITIONS, "actual_torque_{}": TORQUES, "target_position_{}": POSITIONS + 0.01},
    "franka": {"q_{}": POSITIONS, "q_d_{}": POSITIONS + 0.01, "dq_{}": SPEEDS, "tau_J_{}": TORQUES, "O_T_EE_{}": REST},
    "kinova": {
        "actuator_{}_position_deg": DEG * POSITIONS, "actuator_{}_velocity_deg_s": DEG * SPEEDS,
        "actuator_{}_torque_Nm": TORQUES, "actuator_{}_current_A": REST,
    },
    "xarm": {"joint{}_angle": POSITIONS, "joint{}_speed": SPEEDS, "joint{}_torque": TORQUES},
    "techman": {"Joint_Angle{}": DEG * POSITIONS, "Joint_Torque{}": TORQUES},
    "doosan": {"posj_{}": DEG * POSITIONS, "velj_{}": DEG * SPEEDS, "posx_{}": REST, "motor_torque_{}": TORQUES},
    "staubli": {"j{}Pos [deg]": DEG * POSITIONS, "j{}Cmd [deg]": DEG * POSITIONS + 0.01, "j{}Trq [Nm]": TORQUES},
    "mecademic": {"RtJointPos_{}": DEG * POSITIONS, "TargetJointPos_{}": DEG * POSITIONS, "TargetCartPos_{}": REST},
    "unitree": {"motor_state[{}].q": POSITIONS, "motor_state[{}].dq": SPEEDS, "motor_state[{}].tau_est": TORQUES},
}  # fmt: skip


@pytest.mark.parametrize("make", MAKES)
def test_a_table_of_another_make_has_its_joints_or_a_question(tmp_path: Path, make: str) -> None:
    groups = {stem: [stem.format(i + 1) for i in range(6)] for stem in MAKES[make]}
    names = ",".join(["time", *(name for group in groups.values() for name in group)])
    path = tmp_path / f"{make}.csv"
    np.savetxt(path, np.column_stack([T, *MAKES[make].values()]), delimiter=",", header=names, comments="")
    proposal = propose_mapping(path)
    found = tomllib.loads(proposal.toml)
    asked = any(question.startswith(("which", "whether")) for question in proposal.questions)
    assert asked or found["q_nominal"]["columns"] == next(iter(groups.values()))
    torques = [group for stem, group in groups.items() if "orque" in stem or "Trq" in stem or "tau" in stem]
    assert found.get("tau", {}).get("columns") in (None, *torques)


def written(path: Path, names: str, *columns: np.ndarray) -> Path:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=names, comments="")
    return path


def test_files_whose_columns_have_equal_names_are_what_the_files_names_say(tmp_path: Path) -> None:
    names = "t,arm_1_joint,arm_2_joint,arm_3_joint"
    files = [written(tmp_path / f"tiago_{what}.csv", names, T, v) for what, v in (("position", Q), ("effort", TAU))]
    found = tomllib.loads(propose_mapping(files).toml)
    assert found["q_nominal"]["columns"][0] == "tiago_position:arm_1_joint"
    assert found["tau"]["columns"][2] == "tiago_effort:arm_3_joint"


def test_names_that_are_there_again_stay_with_their_marker(tmp_path: Path) -> None:
    names = "t,q1,q2,X [mm],Y [mm],Z [mm],X [mm],Y [mm],Z [mm]"
    path = written(tmp_path / "vicon.csv", names, T, Q[:, :2], 300.0 + 100.0 * Q, 300.0 - 50.0 * Q)
    proposal = propose_mapping(path, units="rad", robot="two_link", answers={"q_encoder": "X#2"})
    assert tomllib.loads(proposal.toml)["q_encoder"]["pose"]["columns"] == ["X#2 [mm]", "Y#2 [mm]", "Z#2 [mm]"]


@pytest.mark.parametrize(("pattern", "found"), [("Position?", [1, 2, 3]), ("?osition2", [2]), ("Position*", [1, 2, 3])])
def test_a_pattern_is_of_whole_names(tmp_path: Path, pattern: str, found: list[int]) -> None:
    path = written(tmp_path / "a.csv", "t,Position1,Position2,Position3,xPosition1,PositionX12", T, Q, Q[:, :2])
    names = [place.column for place in places_of(pattern, Sources([path]).streams)]
    assert names == [f"Position{i}" for i in found] + ["PositionX12"] * ("*" in pattern)
