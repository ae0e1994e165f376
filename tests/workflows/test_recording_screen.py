"""A recording's screen: the same over every container, small, and its next command runs."""

import shlex
from collections.abc import Callable
from dataclasses import replace
from math import ceil
from pathlib import Path

import numpy as np
import pytest

from catenary.plant import MotionLog
from catenary.recording.logs import write_parquet
from catenary.recording.mend import Mend
from catenary.workflows.recording_screen import check_recording
from command_line import catenary
from hysteretic_arm import recording
from lab_bags import JOINT_STATE, JOINTS, joint_state, true_q, write_bag
from parsed_commands import complaint
from tests.truth.spoilings import late
from tests.verdict.test_delay import cable_arm

COLUMNS, LINES = 100, 24


def six_joints() -> MotionLog:
    """A recording of six joints, the last one another day's fifth."""
    log, other = recording(0), recording(1)
    assert log.q_encoder is not None
    assert other.q_encoder is not None
    q = np.column_stack([log.q_nominal, other.q_nominal[:, 4]])
    seen = np.column_stack([log.q_encoder, other.q_encoder[:, 4]])
    return replace(
        log, joint_names=(*log.joint_names, "J6"), joint_units=(*log.joint_units, "rad"), q_nominal=q, q_encoder=seen
    )


def lines_of(text: str) -> int:
    """Lines of a terminal that a text takes, names of facts on the left."""
    return sum(max(1, ceil((len(line) - 13) / (COLUMNS - 13))) for line in text.splitlines())


@pytest.mark.alike
@pytest.mark.parametrize(("seconds", "away"), [(0.0, 0.0), (0.6, 0.0), (0.0, 2.0)])
def test_six_joints_fit_on_a_screen(tmp_path: Path, seconds: float, away: float) -> None:
    log = late(six_joints(), seconds)
    assert log.q_encoder is not None
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


@pytest.mark.alike
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
