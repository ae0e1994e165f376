"""What a recording suggests is proposed; what it leaves open is asked, never chosen in silence."""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.io import savemat

from catenary.bounded_parsers import toml_table
from catenary.config import parse_settings
from catenary.errors import ConfigError, InputError
from catenary.recording.import_formats.column_groups import candidates_of
from catenary.recording.import_formats.columns import Stream
from catenary.recording.import_formats.mapping import RecordingMapping, mapping_of
from catenary.workflows.import_recording import Proposal, import_recording, propose_mapping
from lab_bags import JOINT_STATE, JOINTS, Message, joint_state, true_q, write_bag

T = np.arange(0.0, 3.0, 0.01)
Q = true_q(T)[:, :2]


def of_table(folder: Path, names: str, *columns: np.ndarray) -> Proposal:
    table = folder / "lab.csv"
    rows = "\n".join(",".join(f"{v:.9f}" for v in row) for row in np.column_stack([T, *columns]))
    table.write_text(f"t,{names}\n{rows}\n")
    return propose_mapping(table)


@pytest.mark.parametrize(
    ("names", "scale", "asked"),
    [
        ("cmd1_deg,cmd2_deg,optitrack1_deg,optitrack2_deg", 1.0, None),
        ("cmd1_rad,cmd2_rad,encoder1,encoder2", 57.2957795, None),  # told by the ranges: degrees
        ("cmd1,cmd2,encoder1,encoder2", 1.0, "the units of q_nominal"),
        ("cmd1_rad,cmd2_rad,encoder1,encoder2", 7.0, "the units of q_encoder"),
        ("q_des1_rad,q_des2_rad,q_act1_rad,q_act2_rad", 1.0, "measured at the joints"),
        ("J1 motor (deg),J2 motor (deg),J1 joint (deg),J2 joint (deg)", 1.0, "measured at the joints"),
        ("a1,a2,b1,b2", 1.0, "which is q_nominal"),
        ("shoe,hat,tie,scarf", 1.0, "which columns are q_nominal"),
    ],
)
def test_what_is_open_is_asked_and_nothing_is_accepted_then(
    names: str, scale: float, asked: str | None, tmp_path: Path
) -> None:
    proposal = of_table(tmp_path, names, *Q.T, *(scale * (Q + 0.01)).T)
    if asked is None:
        assert proposal.questions == ()
        assert proposal.accepted().q_encoder is not None
        return
    assert any(asked in question for question in proposal.questions)
    assert "OPEN" in proposal.toml
    with pytest.raises(InputError, match="open questions"):
        proposal.accepted()


@pytest.mark.parametrize(("answer", "measured"), [("J1 joint (deg)", True), ("none", False)])
def test_joints_beside_motors_are_the_measurement_or_what_the_robot_reports(
    answer: str, measured: bool, tmp_path: Path
) -> None:
    names = "J1 motor (deg),J2 motor (deg),J1 joint (deg),J2 joint (deg),gripper (%)"
    of_table(tmp_path, names, *Q.T, *(Q + 0.01).T, Q[:, 0])
    mapping = propose_mapping(tmp_path / "lab.csv", answers={"q_encoder": answer}).accepted()
    joints, motors = (tuple(f"J{j} {kind} (deg)" for j in (1, 2)) for kind in ("joint", "motor"))
    assert mapping.q_nominal.columns == (motors if measured else joints)
    assert (mapping.q_encoder is not None and mapping.q_encoder.columns == joints) == measured


@pytest.mark.parametrize("places", [(0, 1), (0, 2)])
def test_torques_are_those_of_the_joints_that_were_chosen_of_an_array(places: tuple[int, int], tmp_path: Path) -> None:
    gripper = np.sin(2.0 * T)
    q = np.insert(Q, 2, gripper, axis=1) if places == (0, 1) else np.insert(Q, 1, gripper, axis=1)
    names = ",".join(f"{name}[{k}]" for name in ("position", "effort") for k in range(3)) + ",encoder[0],encoder[1]"
    of_table(tmp_path, names, *q.T, *(3.0 * q).T, *(Q + 0.01).T)
    chosen = ",".join(f"position[{k}]" for k in places)
    answers = {"q_nominal.columns": chosen, "q_nominal.units": "rad"}
    mapping = propose_mapping(tmp_path / "lab.csv", answers=answers).accepted()
    assert mapping.tau is not None
    assert mapping.tau.columns == tuple(f"effort[{k}]" for k in places)


def test_columns_that_never_change_and_currents_are_set_aside_and_said(tmp_path: Path) -> None:
    still = np.ones((len(T), 2))
    proposal = of_table(tmp_path, "q1_rad,q2_rad,enc1_rad,enc2_rad,current1,current2", *Q.T, *still.T, *Q.T)
    assert any("never changes" in said for said in proposal.decisions)
    assert any("needs a scale" in said for said in proposal.decisions)
    assert proposal.accepted().q_encoder is None


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_rows_of_which_a_truth_value_is_missing_are_not_trusted(ending: str, tmp_path: Path) -> None:
    is_seen = [True] * 100 + [None] * 10 + [False] * 10 + [True] * 180
    columns = {"t": T, "q1": Q[:, 0], "q2": Q[:, 1], "camera1": Q[:, 0] + 0.01, "camera2": Q[:, 1] + 0.01}
    table = pa.table(columns | {"valid": pa.array(is_seen)})
    path = tmp_path / f"lab.{ending}"
    (pyarrow.csv.write_csv if ending == "csv" else pq.write_table)(table, path)
    assert 'ok = ["valid"]' in propose_mapping(path, units="rad").toml
    log = import_recording(path, units="rad", accept_proposal=True)
    assert np.flatnonzero(~log.ok).tolist() == list(range(100, 120))


@pytest.mark.parametrize(
    ("names", "robot", "units", "is_open"),
    [
        (("shoulder", "elbow", "insertion"), None, ["rad", "rad", "mm"], False),  # by its name
        (("j1", "j2", "j3"), None, ["rad", "rad", "mm"], True),  # angles are in rad, so this is none in deg
        (("j1", "j2", "j3"), "raven2", ["rad", "rad", "mm"], False),  # by the limits of its third joint
    ],
)
@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_a_slide_in_mm_among_angles_in_rad_is_told_by_its_range(
    names: tuple[str, ...], robot: str | None, units: list[str], is_open: bool, scale: float, tmp_path: Path
) -> None:
    q = np.column_stack([0.5 + 0.2 * np.sin(T), 1.5 + 0.2 * np.cos(T), scale * (0.4 + 0.05 * np.sin(0.7 * T))])
    messages: list[Message] = [(t, "/joint_states", joint_state(names, row)) for t, row in zip(T, q, strict=True)]
    bag = write_bag(tmp_path / "lab", "ros1", {"/joint_states": JOINT_STATE}, messages)
    proposal = propose_mapping(bag, robot=robot)
    expected = units if scale > 1.0 else ["rad", "rad", "m" if "insertion" in names or robot else "rad"]
    assert f"units = {json.dumps(expected)}  # " in proposal.toml  # and how it was told
    assert any("the units of q_nominal" in one for one in proposal.questions) == (is_open and scale > 1.0)


@settings(max_examples=30)
@given(st.text(max_size=12), st.sampled_from(["q_nominal", "signal:x", "time", "ok", "other"]))
def test_any_text_as_an_option_is_a_mapping_or_refused(text: str, quantity: str) -> None:
    try:
        mapping = mapping_of(["q_nominal=a", f"{quantity}={text}"])
    except ConfigError:
        return
    assert mapping.q_nominal.columns


def test_a_mapping_with_keys_that_there_are_not_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown key"):
        parse_settings(toml_table('[q_nominal]\ncolumn = "a"\n', "x"), RecordingMapping, "x")
    with pytest.raises(ValueError, match="needs robot"):
        parse_settings({"q_nominal": {"columns": "a"}, "q_encoder": {"pose": {"columns": "b"}}}, RecordingMapping, "x")


def moving(rows: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Commands of three joints [deg, deg, mm], and measurements that follow them."""
    t = np.linspace(0.0, 20.0, rows)
    q = np.column_stack([30.0 * np.sin(t), 20.0 * np.cos(1.3 * t), 150.0 + 25.0 * np.sin(0.7 * t)])
    return q, 1.02 * q + 0.5


def test_units_behind_the_names_and_words_of_a_lab_are_enough(tmp_path: Path) -> None:
    q, seen = moving()
    robot = np.column_stack([0.05 * np.arange(len(q)), q])
    np.savetxt(
        tmp_path / "robot.csv", robot, delimiter=",", header="time,yaw [deg],pitch [deg],insertion [mm]", comments=""
    )
    camera = np.column_stack([0.15 * np.arange(len(seen[::3])), seen[::3]])
    np.savetxt(tmp_path / "camera.csv", camera, delimiter=",", header="t,yaw_cam,pitch_cam,ins_cam", comments="")
    proposal = propose_mapping([tmp_path / "robot.csv", tmp_path / "camera.csv"])
    assert 'units = ["deg", "deg", "mm"]' in proposal.toml
    assert "yaw_cam" in proposal.toml.partition("[q_encoder]")[2]
    # one table's joint is insertion, the other's ins: that is asked, and the text is a mapping once it is answered
    mapping = parse_settings(toml_table(proposal.toml, "proposal"), RecordingMapping, "proposal")
    assert mapping.time == ("time", "t")
    log = import_recording([tmp_path / "robot.csv", tmp_path / "camera.csv"], mapping.model_dump(exclude_unset=True))
    assert log.q_encoder is not None
    assert_allclose(log.q_nominal, q * [np.pi / 180, np.pi / 180, 1e-3], atol=1e-12)


def test_what_was_told_and_what_was_measured_in_one_file_says_what_a_fit_needs(tmp_path: Path) -> None:
    q, seen = moving()
    np.savez(tmp_path / "two.npz", joint_desired=q, joint_measured=seen, time=0.05 * np.arange(len(q)))
    said = " ".join(propose_mapping(tmp_path / "two.npz", units="deg,deg,mm").decisions)
    log = import_recording(tmp_path / "two.npz", mapping_of(re.findall(r"--map (\S+)", said), units="deg,deg,mm"))
    assert_allclose(log.q_nominal, q * [np.pi / 180, np.pi / 180, 1e-3], atol=1e-12)
    assert log.ok.all()


PSM = ("outer_yaw", "outer_pitch", "outer_insertion", "outer_roll", "outer_wrist_pitch", "outer_wrist_yaw")


def groups(names: list[str]) -> list[tuple[tuple[str, ...], str]]:
    numbers = {name: np.random.default_rng(i).normal(size=20) for i, name in enumerate(names)}
    return [(one.columns, one.kind) for one in candidates_of([Stream("lab", "table", numbers, 20)], 0.0)]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        # PlotJuggler's: a digit in the arm's name, two arms, two quantities
        (
            [f"/PSM{a}/measured_js/{j}/{q}" for a in (1, 2) for j in PSM for q in ("position", "velocity")],
            [tuple(f"/PSM{a}/measured_js/{j}/{q}" for j in PSM) for q in ("position", "velocity") for a in (1, 2)],
        ),
        (
            ["cmd_left1", "cmd_left2", "cmd_right1", "cmd_right2"],
            [("cmd_left1", "cmd_left2"), ("cmd_right1", "cmd_right2")],
        ),
        (["link1_shoulder_cmd", "link2_elbow_cmd"], [("link1_shoulder_cmd", "link2_elbow_cmd")]),
        (
            ["robot1_q1_enc", "robot1_q2_enc", "robot2_q1_enc", "robot2_q2_enc"],
            [("robot1_q1_enc", "robot1_q2_enc"), ("robot2_q1_enc", "robot2_q2_enc")],
        ),
        (["a2", "a10", "a1", "b1", "b2"], [("a1", "a2", "a10"), ("b1", "b2")]),
        (
            ["psm_outer_yaw", "psm_outer_insertion", "imu_roll", "imu_pitch", "imu_yaw", "arm_elbow_temp"],
            [("psm_outer_yaw", "psm_outer_insertion")],
        ),
    ],
)
def test_a_digit_anywhere_in_a_name_does_not_break_a_group(names: list[str], expected: list[tuple[str, ...]]) -> None:
    assert sorted(columns for columns, _ in groups(names)) == sorted(expected)


@pytest.mark.parametrize(
    ("name", "kind", "unit", "scale"),
    [
        ("q1 [deg]", "position", "deg", None), ("elbow_deg[2]", "position", "deg", None),
        ("dq_rad_s", "velocity", "rad", None), ("tau1 [mNm]", "effort", None, 1e-3), ("push_kN", "effort", None, 1e3),
        # accelerations are no speeds, nor a letter a force
        ("a1 [m/s2]", "acceleration", "m", None), ("a1_rad_s2", "acceleration", "rad", None),
        ("a1 [rad/s^2]", "acceleration", "rad", None), ("part1_n", "position", None, None),
    ],
)  # fmt: skip
def test_a_unit_behind_a_name_tells_a_quantity(name: str, kind: str, unit: str | None, scale: float | None) -> None:
    stream = Stream("log.csv", "table", {name: np.arange(9.0), "t": np.arange(9.0)}, 9)
    found = next(one for one in candidates_of([stream], 0.0) if one.columns == (name,))
    assert found.kind == kind
    assert found.stated_units() == (None if unit is None else (unit,))
    assert found.stated_scale() == (None if scale is None else (scale,))


@pytest.mark.parametrize(("robot", "frame"), [("dvrk_psm", "outer_insertion"), ("ur5e", "forearm_link")])
def test_a_marker_beside_the_first_joints_is_proposed_on_the_link_that_they_move(
    robot: str, frame: str, tmp_path: Path
) -> None:
    rows = np.column_stack([T, true_q(T), 1e3 * true_q(T)])
    np.savetxt(tmp_path / "lab.csv", rows, delimiter=",", header="t,q1,q2,q3,ndi_x,ndi_y,ndi_z", comments="")
    answers = {"q_encoder": "ndi_x", "q_nominal.columns": "q1,q2,q3"}
    proposed = propose_mapping(tmp_path / "lab.csv", robot=robot, units="rad,rad,m", answers=answers)
    pose = proposed.accepted().q_encoder.pose
    assert (pose.frame, pose.unit, pose.match) == (frame, "mm", "position")


@pytest.mark.parametrize("scale", [1.0, 180.0 / np.pi])
def test_a_mapping_without_units_takes_those_that_are_proposed(scale: float, tmp_path: Path) -> None:
    """JointStates in rad and m, or a robot's in degrees against the standard: told by the robot's limits."""
    messages: list[Message] = []
    for t in T:
        q = true_q(t) * (1.0 if scale == 1.0 else np.array([scale, scale, 1000.0]))
        messages += [(t, "/arm/joint_states", joint_state(JOINTS, q)), (t, "/vicon/joints", joint_state(JOINTS, q))]
    topics = dict.fromkeys(("/arm/joint_states", "/vicon/joints"), JOINT_STATE)
    bag = write_bag(tmp_path / "lab", "mcap", topics, messages)
    robot = "dvrk_psm"
    proposed = import_recording(bag, robot=robot, accept_proposal=True)
    by_hand = import_recording(
        bag, ["q_nominal=/arm/joint_states.position", "q_encoder=/vicon/joints.position"], robot=robot
    )
    for log in (proposed, by_hand):
        assert log.joint_units == ("rad", "rad", "m")
        assert_allclose(log.q_nominal, true_q(T), atol=1e-9)
        assert_allclose(log.q_encoder, true_q(T), atol=1e-9)
    if scale == 1.0:
        alone = import_recording(bag, ["q_nominal=/arm/joint_states.position"])
        assert alone.joint_units == ("rad", "rad", "m")  # which slides, by its name


def test_more_columns_than_the_robot_has_joints_are_asked_for_and_measured_ones_chosen_alike(tmp_path: Path) -> None:
    """A dVRK's script writes the jaw behind the joints: nobody shall answer units of seven for an arm of six."""
    table, q = tmp_path / "lab.csv", np.column_stack([true_q(T), 0.3 * np.sin(np.outer(T, [1.0, 1.3, 1.7, 2.1]))])
    names = [f"{what}_{j}" for what in ("joint", "cam") for j in range(7)]
    np.savetxt(table, np.hstack([q, 1.01 * q]), delimiter=",", header=",".join(names), comments="")
    proposal = propose_mapping(table, robot="dvrk_psm")
    assert any(
        "which 6 of the 7 columns of joint_0 ... joint_6 are the joints of" in each for each in proposal.questions
    )
    answers = {"q_nominal.columns": ",".join(names[:6])}
    log = import_recording(table, robot="dvrk_psm", answers=answers)
    assert log.joint_units == ("rad", "rad", "m", "rad", "rad", "rad")
    assert_allclose(log.q_encoder, 1.01 * q[:, :6], atol=1e-9)


# of each make's log: how positions are named, what else moves in it, and what stands still; {} is a joint's number
MAKES = {
    "UR by RTDE": (
        "actual_q_{}", range(6),
        "actual_current_{} joint_control_output_{} joint_temperatures_{} actual_joint_voltage_{} actual_TCP_force_{} "
        "actual_digital_input_bits actual_execution_time actual_main_voltage actual_robot_voltage actual_momentum "
        "speed_scaling digital_input_bits execution_time main_voltage robot_voltage robot_current",
        "actual_qd_{} target_qdd_{} joint_mode_{} robot_mode safety_mode actual_digital_output_bits",
    ),
    "Franka": ("q_{}", range(7), "tau_J_{} O_T_EE_{} K_F_ext_hat_K_{} control_command_success_rate", "dq_{} robot_mode"),
    "Kinova": (
        "position_{}", range(7), "torque_{} current_motor_{} voltage_{} temperature_motor_{} temperature_core_{}",
        "velocity_{} status_flags_{}",
    ),
    "xArm": ("J{}", range(1, 8), "temp{} voltage{} current{}", "mode state error_code"),
}  # fmt: skip
TABLES = {
    "csv": lambda path, table: pa.csv.write_csv(pa.table(table), path),
    "parquet": lambda path, table: pq.write_table(pa.table(table), path),
    "npz": lambda path, table: np.savez(path, **table),
    "mat": lambda path, table: savemat(path, table),
}


def of_make(make: str, moving: tuple[int, ...]) -> tuple[list[str], dict[str, np.ndarray]]:
    """The names of a make's joints, and its log of an arm at rest but for the joints that move."""
    position, numbers, others, still = MAKES[make]
    rng, names = np.random.default_rng(3), [position.format(j) for j in numbers]
    table = {"timestamp": 1000.0 + T}
    for pattern in still.split():
        table |= {pattern.format(j): np.full(len(T), 3.0) for j in numbers}
    for k, name in enumerate(names):
        table[name] = 0.2 + 0.1 * k + 0.3 * np.sin(T + k) * (k in moving)
    for pattern in others.split():
        table |= {pattern.format(j): 48.0 + np.cumsum(0.05 * rng.normal(size=len(T))) for j in numbers}
    return names, table


@pytest.mark.parametrize("moving", [(), (1,), (0, 1, 2, 3, 4, 5)])
@pytest.mark.parametrize("make", MAKES)
@pytest.mark.parametrize("ending", TABLES)
def test_an_arm_at_rest_has_joints_and_no_temperatures_voltages_or_bits(
    ending: str, make: str, moving: tuple[int, ...], tmp_path: Path
) -> None:
    names, table = of_make(make, moving)
    path = tmp_path / f"lab.{ending}"
    TABLES[ending](path, table)
    found = tomllib.loads(propose_mapping(path, units="rad").toml)
    assert found["q_nominal"]["columns"] == names
    assert "q_encoder" not in found
    assert not any(word in str(found.get("tau")) for word in ("temp", "volt", "current"))


WORDED = ("mast", "twist", "wrench", "effort", "pose", "current", "error", "tool_linear")  # joints called as quantities


def of_robot(joints: tuple[str, ...], folder: Path) -> str:
    """A robot whose joints turn about one axis after another."""
    links = "".join(
        f'[[link]]\nname = "{name}"\njoint = "revolute"\nalpha_deg = {90 * (k % 2)}\na_m = 0.2\n'
        "d_m = 0\ntheta_deg = 0\nlimits_deg = [-120, 120]\n"
        for k, name in enumerate(joints)
    )
    path = folder / "worded.toml"
    path.write_text(f'name = "worded"\nconvention = "modified"\nsources = ["a test"]\ntip = "{joints[-1]}"\n{links}')
    return str(path)


@pytest.mark.parametrize("still", [(), ("twist",), WORDED])
@pytest.mark.parametrize("ending", TABLES)
@pytest.mark.parametrize(("front", "behind"), [("", ""), ("", "_pos"), ("joint_", "")])
def test_a_column_named_as_a_joint_of_the_robot_is_that_joint(
    front: str, behind: str, ending: str, still: tuple[str, ...], tmp_path: Path
) -> None:
    """Words of other quantities and standing still notwithstanding; in the robot's order; its velocities apart."""
    q = {name: 0.4 * np.sin(T + k) * (name not in still) + 0.1 * k for k, name in enumerate(WORDED)}
    table = {"t": T} | {f"{front}{name}{behind}": q[name] for name in sorted(WORDED)}
    table |= {f"{front}{name}_vel": np.gradient(q[name], T) for name in WORDED}
    table |= {f"{front}{name}_temperature": 40.0 + 0.1 * T + q[name] for name in WORDED}
    TABLES[ending](tmp_path / f"lab.{ending}", table)
    robot = of_robot(WORDED, tmp_path)
    log = import_recording(tmp_path / f"lab.{ending}", robot=robot, accept_proposal=True)
    assert log.joint_names == WORDED
    assert_allclose(log.q_nominal, np.column_stack([*q.values()]), atol=1e-9)
    if still != WORDED:
        assert_allclose(log.qd, np.column_stack([table[f"{front}{name}_vel"] for name in WORDED]), atol=1e-9)


@pytest.mark.parametrize("lost", ["twist", "tool_linear"])
@pytest.mark.parametrize("ending", TABLES)
def test_fewer_columns_than_the_robot_has_joints_are_asked_for_and_not_written(
    ending: str, lost: str, tmp_path: Path
) -> None:
    names = tuple(name for name in WORDED if name != lost)
    q = np.column_stack([0.4 * np.sin(T + k) for k in range(len(names))])
    path = tmp_path / f"lab.{ending}"
    TABLES[ending](path, {"t": T} | dict(zip(names, q.T, strict=True)))
    robot = of_robot(WORDED, tmp_path)
    (asked,) = propose_mapping(path, robot=robot).questions
    assert f"which columns are the 8 joints of worded ({', '.join(WORDED)})" in asked
    with pytest.raises(InputError, match="open questions"):
        import_recording(path, robot=robot, accept_proposal=True)
    answer = asked.partition("--answer q_nominal.columns=")[2]
    log = import_recording(path, robot=robot, answers={"q_nominal.columns": answer})
    assert log.joint_names == names
    assert_allclose(log.q_nominal, q, atol=1e-9)


@pytest.mark.parametrize("first", [0, 1])
def test_numbers_in_columns_count_from_zero_or_one(first: int, tmp_path: Path) -> None:
    """A robot whose joints are q1 to q7, and columns q_0 to q_6: by name six would fit, each of its neighbour."""
    table = {f"q_{first + k}": 0.1 * k + 0.3 * np.sin(T + k) for k in range(7)}
    TABLES["csv"](tmp_path / "lab.csv", {"t": T} | table)
    log = import_recording(tmp_path / "lab.csv", robot="panda", accept_proposal=True)
    assert_allclose(log.q_nominal, np.column_stack([*table.values()]), atol=1e-9)


@pytest.mark.parametrize("still", [(), WORDED])
@pytest.mark.parametrize("kind", ["ros1", "mcap", "sqlite"])
def test_messages_that_name_their_joints_say_which_they_are(kind: str, still: tuple[str, ...], tmp_path: Path) -> None:
    """Fewer than the robot has, as of an arm without its instrument, and at rest."""
    names = WORDED[:5]
    q = np.column_stack([0.1 * k + 0.4 * np.sin(T + k) * (name not in still) for k, name in enumerate(names)])
    told: list[Message] = [(t, "/joint_states", joint_state(names, row)) for t, row in zip(T, q, strict=True)]
    path = write_bag(tmp_path / "lab", kind, {"/joint_states": JOINT_STATE}, told)
    log = import_recording(path, robot=of_robot(WORDED, tmp_path), accept_proposal=True)
    assert log.joint_names == names
    assert_allclose(log.q_nominal, q, atol=1e-9)


@pytest.mark.parametrize("name", ["temperature{} [deg]", "motor_temp{}_deg", "main_voltage{} [m]", "current{} [deg]"])
def test_no_unit_makes_a_position_of_a_temperature_voltage_or_current(name: str, tmp_path: Path) -> None:
    proposal = of_table(tmp_path, ",".join(name.format(j) for j in (1, 2)), *Q.T)
    assert "[q_nominal]" not in proposal.toml
    assert any("which columns are q_nominal" in each for each in proposal.questions)
