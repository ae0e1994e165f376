"""What check says of a file: its facts and faults, a recording's screen, and the next command, which runs."""

import shlex
from collections.abc import Callable
from dataclasses import replace
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import simulated_arm
from catenary.plant import MotionLog
from catenary.recording.logs import write_parquet
from catenary.robots.catalog import load_robot
from catenary.verdict.corrections import Mend
from catenary.workflows.check import check_file, check_recording, check_robot
from command_line import catenary
from hysteretic_arm import recording
from lab_bags import JOINT_STATE, JOINTS, joint_state, true_q, write_bag
from lab_tables import TABLES
from moving_arm import recorded, write_npz
from parsed_commands import complaint
from tests.campaign.parts.files import linear_model
from tests.truth.spoilings import late
from tests.verdict.test_delay import cable_arm

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
    further = [remark for remark in finding.remarks if not remark.startswith(("delay: ", "few reversals", "scale: "))]
    for said, expected in ((finding.faults, faults), (further, remarks)):
        assert expected is None or len(said) == len(expected)
        assert all(map(str.startswith, said, expected or []))


def test_the_verdict_names_a_doubt_that_is_no_fault() -> None:
    leapt = ARRAYS["q_act"] + np.outer(np.arange(len(ARRAYS["q_act"])) >= 200, [0.04, 0.0, 0.0])
    found = check_recording(replace(LOG, q_encoder=leapt))
    assert found.faults == []
    assert found.verdict.startswith("in doubt: jump of J1; no fault found, ")


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
    assert f"no fault found, {len(found.remarks)} remark" in outcome.out


def test_a_joint_that_stands_still_shows_too_little(tmp_path: Path) -> None:
    log = recorded(load_robot("raven2"), 0)
    q, qd = np.array(log.q_nominal), np.array(log.qd)
    q[:, 1], qd[:, 1] = q[0, 1], 0.0
    write_npz(log, tmp_path / "still.npz", q=q, dq=qd)
    found = check_file(str(tmp_path / "still.npz"), robot="raven2")
    assert any("base parameters" in fault for fault in found.faults)
    assert "stands still: elbow" in found.remarks


COLUMNS, LINES = 100, 24


def six_joints() -> MotionLog:
    """A recording of six joints, the last one another day's fifth."""
    log, other = recording(0), recording(1)
    q = np.column_stack([log.q_nominal, other.q_nominal[:, 4]])
    seen = np.column_stack([log.q_encoder, other.q_encoder[:, 4]])
    return replace(
        log, joint_names=(*log.joint_names, "J6"), joint_units=(*log.joint_units, "rad"), q_nominal=q, q_encoder=seen
    )


def lines_of(text: str) -> int:
    """Lines of a terminal that a text takes, names of facts on the left."""
    return sum(max(1, ceil((len(line) - 13) / (COLUMNS - 13))) for line in text.splitlines())


@pytest.mark.parametrize(("seconds", "away"), [(0.0, 0.0), (0.6, 0.0), (0.0, 2.0)])
def test_six_joints_fit_on_a_screen(tmp_path: Path, seconds: float, away: float) -> None:
    log = late(six_joints(), seconds)
    log = replace(log, q_encoder=log.q_encoder + away * (np.arange(len(log)) % 200 == 7)[:, None])
    write_parquet(replace(log, notes=(f"a note {'which is long ' * 9}",) * 9), tmp_path / "run.parquet")
    outcome = catenary("check", tmp_path / "run.parquet")
    assert lines_of(outcome.out) <= LINES, outcome.out
    for word in ("duration", "units", "delay", "outliers", "of limits", "hysteresis", "slack", "verdict", "next"):
        assert word in outcome.out


def bare_bag(folder: Path) -> Path:
    told = [(t, "/arm/joint_states", joint_state(JOINTS, true_q(t), tau=true_q(t))) for t in np.arange(0.0, 14.0, 0.02)]
    return write_bag(folder / "bare", "mcap", {"/arm/joint_states": JOINT_STATE}, told)


def test_a_bag_without_truth_gets_a_screen_and_another_command(tmp_path: Path) -> None:
    outcome = catenary("check", bare_bag(tmp_path), "--json")
    assert outcome.code == 1
    assert outcome.json["faults"] == ["no measured joint positions (q_encoder): it cannot be calibrated from"]
    assert [joint["reversals"] for joint in outcome.json["facts"]["joints"]] == [4, 6, 3]
    first, second = outcome.json["next"].split(" && ")
    assert complaint(shlex.split(first)[1:]) is complaint(shlex.split(second)[1:]) is None


SPOILT: dict[str, Callable[[MotionLog], MotionLog]] = {
    "untouched": lambda log: log,
    "late": lambda log: late(log, 0.2),
    "swapped and late": lambda log: late(Mend(swap=("J1,J2",))(log), 0.2),
    "swapped, turned round and in mm": lambda log: Mend((), ("J1,J2",), ("J1",), ("J3=1000",))(log),
    "wild": lambda log: replace(log, q_encoder=log.q_encoder + 1.0 * (np.arange(len(log)) % 300 == 7)[:, None]),
}


@pytest.mark.parametrize("name", SPOILT)
def test_the_next_command_runs_with_the_mends_that_it_names(tmp_path: Path, name: str) -> None:
    path = tmp_path / "my run.parquet"
    write_parquet(replace(SPOILT[name](cable_arm()), settled={}), path)
    outcome = catenary("check", path, "--json")
    program, *words = shlex.split(outcome.json["next"])
    assert (program, outcome.code) == ("catenary", int(name not in ("untouched", "wild")))
    assert complaint(words) is None
    model = tmp_path / "model.npz"
    done = catenary(*words[: words.index("--out")], "--out", model, "--model", "offset")
    assert done.code == 0, done
    assert ("--max-error" in words) == (name == "wild")
    assert ("--delay" in words) == ("late" in name)


def test_what_no_option_mends_is_said() -> None:
    log = cable_arm()
    found = check_recording(replace(log, q_encoder=log.q_nominal))
    assert found.next.startswith("no option corrects copied")


def test_hysteresis_is_that_of_the_mended_recording() -> None:
    joints = check_recording(late(cable_arm(), 0.3)).facts["joints"]
    assert [joint["hysteresis"] for joint in joints] == pytest.approx([3.0, 1.6, 4.0], abs=0.3)


def test_the_share_of_a_known_robots_limits(tmp_path: Path) -> None:
    log, away = cable_arm(), np.array([0.7, 1.5, 0.2])
    log = replace(log, q_nominal=log.q_nominal + away, q_encoder=log.q_encoder + away)
    write_parquet(replace(log, joint_names=("shoulder", "elbow", "insertion")), tmp_path / "raven.parquet")
    facts = catenary("check", tmp_path / "raven.parquet", "--robot", "raven2", "--json").json["facts"]
    assert 0.6 < facts["joints"][0]["share_of_limits"] < 0.65  # of 0 to 90 deg: 56.5 deg


@pytest.mark.parametrize("container", TABLES)
def test_a_recording_of_another_make_is_proposed_in_every_container(container: str, tmp_path: Path) -> None:
    t = np.arange(0.0, 20.0, 0.02)
    q = dict(zip(("q1", "q2", "q3"), true_q(t).T, strict=True))
    path = TABLES[container](tmp_path / "lab", {"time": t, **q})
    found = check_file(str(path))
    assert found.kind == "third-party recording"
    assert found.faults[0].startswith("open: the units of q_nominal")
    assert found.next.startswith(f"catenary import {path}")


@pytest.mark.parametrize("command", ["fit {} --out m.npz", "evaluate {model} {}"])
@pytest.mark.parametrize("container", TABLES)
def test_commands_that_need_a_log_say_to_import_another_make_first(
    container: str, command: str, tmp_path: Path
) -> None:
    (tmp_path / "model.npz").write_bytes(linear_model())
    t = np.arange(0.0, 2.0, 0.02)
    q = dict(zip(("q1", "q2", "q3"), true_q(t).T, strict=True))
    path = TABLES[container](tmp_path / "lab", {"time": t, **q})
    outcome = catenary(*shlex.split(command.format(path, model=tmp_path / "model.npz")))
    assert f"`catenary import {path}` proposes how to read others" in outcome.err
