"""Recordings with a known fault, against the first cause that is told, its number, and the option that mends it."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from catenary.identification.explanations.evidence import Evidence
from catenary.identification.explanations.findings import (
    ExplainedRecording,
    explained_torques,
    find_explanation,
    unseen_joints,
)
from catenary.identification.explanations.hypotheses import HYPOTHESES
from catenary.identification.explanations.regressor_columns import nothing_supposed
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import Samples, prepare
from catenary.robots.catalog import load_robot
from catenary.robots.urdf import load_urdf
from catenary.verdict.corrections import Mend
from catenary.verdict.finding import FINDINGS
from known_torques import TRUTHS, Truth, drawn, known_torques
from moving_arm import recorded
from oracles.geared_arm import ur10_log, write_ur10

OF = {truth.name: truth for truth in TRUTHS}
QUICK = ("clean UR5e", "8 s", "J3 times 1.25", "J2's sign")  # the option of others is told only for their cause


def samples_of(truth: Truth) -> Samples:
    return prepare(known_torques(truth), load_robot(truth.robot), IdentifyOptions(), within_limits=False)


def explained(truth: Truth) -> ExplainedRecording:
    return find_explanation(Evidence(load_robot(truth.robot), samples_of(truth)))


def is_right(truth: Truth, explanation: ExplainedRecording) -> bool:
    causes = [(cause.hypothesis.name, cause.candidate.joints) for cause in explanation.causes]
    if truth.cause == "velocities" and causes:  # by chance a joint's velocity at another time may follow its position
        return causes[0][0] == truth.cause and {*causes[0][1]} <= {*truth.joints}
    return causes[:1] == ([] if truth.cause is None else [(truth.cause, truth.joints)])


@pytest.mark.parametrize("name", QUICK)
def test_the_cause_of_a_known_fault_is_told_and_nothing_of_sound_recordings(name: str) -> None:
    assert is_right(OF[name], explained(OF[name]))


@pytest.mark.slow
@pytest.mark.parametrize("truths", [TRUTHS, drawn()], ids=["known", "drawn"])
def test_causes_of_forty_recordings_are_told_and_no_wrong_one_is_advised(truths: tuple[Truth, ...]) -> None:
    wrong = []
    for truth in truths:
        explanation = explained(truth)
        if not is_right(truth, explanation):
            wrong.append(truth.name)
            findings = explained_torques(load_robot(truth.robot), samples_of(truth))[0]
            assert not any(finding.refuses for finding in findings), truth.name
    assert len(wrong) <= 2, wrong


@pytest.mark.parametrize(
    ("name", "option"),
    [
        ("J2 10 deg off", r"--offset q_nominal:shoulder_lift_joint=-0\.1[678]"),
        ("J3 backwards", "--sign q_nominal:elbow_joint --sign qd:elbow_joint --sign tau:elbow_joint"),
        ("on a wall", "--gravity 9.81,0,0"),
        ("mNm", "--scale tau:shoulder_pan_joint=0.001"),
    ],
)
def test_the_option_mends_what_was_spoilt(name: str, option: str) -> None:
    [finding] = explained_torques(load_robot(OF[name].robot), samples_of(OF[name]))[0]
    assert finding.refuses
    assert re.search(option, finding.remedy)


def test_an_offset_is_mended_by_its_option() -> None:
    log = known_torques(OF["J2 10 deg off"])
    mended = Mend(offset=("q_nominal:shoulder_lift_joint=-0.1745",))(log)
    off = mended.q_nominal - known_torques(OF["clean UR5e"]).q_nominal
    assert np.abs(off).max() < 1e-3  # as the option has four digits, and noise


def test_a_gripper_is_a_note_with_its_mass() -> None:
    truth = OF["3 kg on a UR10e"]
    [finding] = explained_torques(load_robot(truth.robot), samples_of(truth))[0]
    assert (finding.name, finding.refuses) == ("arm", False)
    mass = re.search(r": ([\d.]+) kg, standard deviation ([\d.]+)", finding.says)
    assert mass is not None
    assert abs(float(mass[1]) - 3.0) < 2.5 * float(mass[2])


def test_a_joint_that_stood_still_is_named() -> None:
    truth = OF["J4 locked"]
    evidence = Evidence(load_robot(truth.robot), samples_of(truth))
    assert unseen_joints(evidence, evidence.plain) == ("wrist_1_joint",)


def test_evidence_of_a_gain_is_that_of_scaled_torques_and_its_jacobian() -> None:
    truth = OF["8 s"]
    arm, samples = load_robot(truth.robot), samples_of(truth)
    evidence, gains = Evidence(arm, samples), (1.0, 2.0, 1.0, 1.0, 1.0, -0.5)
    supposed = nothing_supposed(6).with_one("gains", 1, 2.0).with_one("gains", 5, -0.5)
    moved = Evidence(arm, Samples(**{**vars(samples), "tau": samples.tau / gains, "known": 0.0 * samples.tau}))
    moved.correlated = evidence.correlated
    jacobian = len(evidence.rows) / evidence.correlated @ np.log(np.abs(1.0 / np.array(gains)))
    moved.rows.carried = evidence.rows.carried / np.array(gains)  # by a first fit, of torques as they were
    for kept in (moved._shown_by, moved._grams, moved._beside):
        kept.clear()
    assert evidence.log(supposed, 1) == pytest.approx(moved.log(moved.plain, 1) + jacobian, rel=1e-9)


@pytest.mark.alike
@pytest.mark.parametrize("rows", [-8, 4, 10, 20])
def test_late_and_early_torques_are_told_with_their_time(rows: int) -> None:
    raven = load_robot("raven2")
    log = recorded(raven, 0, noise=0.1)
    log = replace(log, tau=np.roll(np.array(log.tau), rows, axis=0))  # at 200 Hz; filters cut the ends
    [finding] = explained_torques(raven, prepare(log, raven, IdentifyOptions()))[0]
    assert f"{abs(rows) * 5} ms too {'late' if rows > 0 else 'early'}" in finding.says
    assert not finding.refuses


@pytest.mark.alike
@pytest.mark.parametrize(
    ("gravity", "message", "option"),
    [
        ((0.0, -9.81, 0.0), "on a wall, its y axis up", "0,-9.81,0"),
        ((0.0, 0.0, 9.81), "hangs from a ceiling", "0,0,9.81"),
        ((6.937, 0.0, -6.937), "turned by 4[3-7]", r"[67]\.\d"),
    ],
)
def test_the_mounting_that_fits_is_told(tmp_path: Path, gravity, message: str, option: str) -> None:
    arm = load_urdf(write_ur10(tmp_path))
    [finding] = explained_torques(arm, prepare(ur10_log(0, gravity=gravity), arm, IdentifyOptions()))[0]
    assert (finding.name, finding.refuses) == ("gravity", True)
    assert re.search(message, finding.says)
    assert re.match(f"--gravity {option}", finding.remedy)


def test_every_hypothesis_is_told_by_a_finding_and_named_once() -> None:
    assert all(hypothesis.finding in FINDINGS for hypothesis in HYPOTHESES.values())
    assert all(hypothesis.name == name for name, hypothesis in HYPOTHESES.items())
