"""Zeros that move are told, with where and what mends it."""

import re
from dataclasses import replace

import numpy as np
import pytest

from catenary.plant import MotionLog
from catenary.verdict.check import findings_of, repeated_findings
from catenary.verdict.corrections import NO_MEND, Mend
from hysteretic_arm import recording
from spoilt import copied, leapt


def refusals(log: MotionLog) -> list[str]:
    return [each.name for each in findings_of(log) if each.refuses]


def test_a_leap_is_told_by_its_size_and_row_and_mended_by_leaving_out_the_shorter_part() -> None:
    log = leapt(recording(), 0, np.deg2rad(10.0))
    (found,) = [each for each in findings_of(log) if each.refuses]
    told = re.match(r"at row 600 the error leaps by \+([0-9.]+) deg", found.says)
    assert told
    assert abs(float(told[1]) - 10.0) < 0.1  # the error's own spread
    option, rows = found.remedy.split()
    assert option == "--leave-out"
    assert refusals(Mend(leave_out=(rows,))(log)) == []


@pytest.mark.parametrize("by", [0.02, -0.05])
def test_what_a_registration_moves_by_passes(by: float) -> None:
    assert refusals(leapt(recording(), 0, by)) == []


def test_a_burst_of_wild_measurements_is_no_leap() -> None:
    log = recording()
    assert log.q_encoder is not None
    wild = log.q_encoder.copy()
    wild[700:740, 0] += 0.5
    assert refusals(replace(log, q_encoder=wild)) == []


def told(log: MotionLog, name: str) -> list[str]:
    """Return what notes of that name say; nothing is refused."""
    assert refusals(log) == []
    return [str(each) for each in findings_of(log) if each.name == name]


def test_a_slow_drift_is_no_leap_and_is_told_by_its_size() -> None:
    log = recording()
    assert log.q_encoder is not None
    drift = np.linspace(0.0, 0.05, len(log))[:, None] * np.eye(5)[0]
    (says,) = told(replace(log, q_encoder=log.q_encoder + drift), "drift")
    size = re.match(r"J1: the error drifts by \+([0-9.]+) deg", says)
    assert size
    assert abs(float(size[1]) - np.rad2deg(0.05)) < 0.3
    assert told(log, "drift") == []


@pytest.mark.parametrize("by", [0.04, -0.05])
def test_a_small_leap_of_a_tight_joint_is_told(by: float) -> None:
    (says,) = told(leapt(recording(), 0, by), "jump")
    size = re.match(r"J1: at row 600 the error leaps by ([-+0-9.]+) deg .*--leave-out 0:600", says)
    assert size
    assert abs(float(size[1]) - np.rad2deg(by)) < 0.5  # the error's own spread
    assert told(recording(), "jump") == []


def test_errors_that_leap_with_the_commands_of_joined_recordings_are_no_leap() -> None:
    log = recording()
    q = log.q_nominal.copy()
    q[600:, 1] += 1.5
    assert log.q_encoder is not None
    q_encoder = log.q_encoder + (q - log.q_nominal)
    q_encoder[:, 1] += 0.04 * q[:, 1]
    assert told(replace(log, q_nominal=q, q_encoder=q_encoder), "jump") == []


@pytest.mark.parametrize("turn", [2.0 * np.pi, -4.0 * np.pi])
def test_lost_turns_are_told_as_turns_whatever_else_they_look_like(turn: float) -> None:
    (found,) = [each for each in findings_of(leapt(recording(), 3, turn)) if each.refuses]
    assert (found.name, found.joints, found.remedy) == ("turns", ("J4",), "--unwrap J4=6.2832")


@pytest.mark.parametrize("joint", [0, 2])
@pytest.mark.parametrize("share", [0.5, 0.8])
def test_a_counter_that_wraps_at_any_period_is_told_with_it_and_mended_as_told(joint: int, share: float) -> None:
    log = recording()
    assert log.q_encoder is not None
    own = log.q_encoder[:, joint]
    period, first = share * np.ptp(own), own.min() - 0.1 * np.ptp(own)
    wrapped = log.q_encoder.copy()
    wrapped[:, joint] = first + (own - first) % period
    (found,) = [each for each in findings_of(replace(log, q_encoder=wrapped)) if each.refuses]
    assert (found.name, found.joints) == ("turns", (log.joint_names[joint],))
    told = re.fullmatch(rf"--unwrap {log.joint_names[joint]}=([0-9.]+)", found.remedy)
    assert told
    assert float(told[1]) == pytest.approx(period, rel=0.05)
    mend = NO_MEND.and_then(found.remedy)
    assert mend is not None
    mended = mend(replace(log, q_encoder=wrapped))
    assert refusals(mended) == []
    assert mended.q_encoder is not None
    away = mended.q_encoder[:, joint] - own
    assert np.abs(away - np.median(away)).max() < 0.01 * period


def test_a_sensor_that_hardly_moves_is_no_counter_that_wraps() -> None:
    log = recording()
    assert log.q_encoder is not None
    still = log.q_encoder.copy()
    still[:, 0] = 0.01 * np.sign(still[:, 0])  # of a joint that moves to and fro
    assert "turns" not in refusals(replace(log, q_encoder=still))


def test_a_copy_in_single_precision_is_a_copy() -> None:
    log = copied(recording(), slice(None))
    assert log.q_encoder is not None
    assert refusals(replace(log, q_encoder=log.q_encoder.astype(np.float32).astype(float))) == ["copied"]


def test_minutes_that_are_in_the_data_twice_are_told_within_one_recording_and_among_several() -> None:
    log, other = recording(), recording(seed=1)
    half = log.part(0, 750)
    twice = [np.concatenate([getattr(half, name)] * 2) for name in ("q_nominal", "q_encoder", "ok")]
    joined = replace(log, q_nominal=twice[0], q_encoder=twice[1], ok=twice[2])
    assert [(name, each.says[:3]) for name, each in repeated_findings([joined])] == [("poses", "49%")]
    assert "twice" in [each.name for each in findings_of(joined)]
    again = replace(half, name="copy")
    assert [name for name, _ in repeated_findings([log, other, again])] == ["copy"]
    assert repeated_findings([log, other]) == []
