"""Spoilt copies of a recording are refused or named; whole ones pass."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import DataError, InputError
from catenary.plant import MotionLog
from catenary.robots.catalog import load_robot
from catenary.verdict.check import findings_of, verdict
from catenary.verdict.command_response import scales
from catenary.verdict.corrections import NO_MEND, Mend
from catenary.verdict.finding import judge
from catenary.verdict.units_and_scale import trained_findings
from hysteretic_arm import recording
from spoilt import (
    BOTH,
    MEASURED,
    SPOILS,
    Spoil,
    drifting,
    exchanged,
    in_deg_and_mm,
    leapt,
    mixed,
    scaled,
    shifted,
    stuck,
    with_outliers,
    wrapped,
)
from tests.drawn_arms.arm import Arm
from tests.truth.spoilings import late
from tests.verdict.test_delay import cable_arm


@pytest.mark.alike
@pytest.mark.parametrize("seed", range(4))
def test_a_sound_recording_passes(seed: int) -> None:
    assert [f for f in findings_of(recording(seed)) if f.refuses or f.name not in ("outliers", "delay")] == []


@pytest.mark.alike
@pytest.mark.parametrize("spoil", SPOILS, ids=lambda s: f"{s.kind}: {s.says}")
def test_a_spoilt_recording_is_refused_or_named_and_goes_on_when_it_is_accepted(spoil: Spoil) -> None:
    found = [("run", each) for each in findings_of(spoil.spoil(recording()))]
    assert {each.name for _, each in found if each.refuses == spoil.refused} & set(spoil.named)
    if spoil.refused:
        with pytest.raises(DataError, match="--accept") as refusal:
            judge(found)
        assert any("accepted" in note for note in judge(found, refusal.value.names))


def test_an_unknown_name_to_accept_is_refused_with_the_choices() -> None:
    with pytest.raises(InputError, match="swaped; choices: units"):
        verdict([recording()], accept=["swaped"])


@pytest.mark.parametrize("rows", [3, -4])
def test_a_shift_is_named_by_the_time_that_mends_it(rows: int) -> None:
    late = shifted(recording(), rows)
    (found,) = [f for f in findings_of(late) if f.refuses]
    option, seconds = found.remedy.split()
    assert option == "--delay"
    assert [f for f in findings_of(Mend(delay=float(seconds))(late)) if f.refuses] == []
    (found,) = [f for f in findings_of(replace(late, time=None)) if f.refuses]
    assert found.remedy == f"--shift {rows}"
    assert [f for f in findings_of(Mend(shift=rows)(replace(late, time=None))) if f.refuses] == []


def test_small_motions_in_degrees_are_told_by_the_limits_of_the_robot() -> None:
    # 20 to 60 deg: within the robot's limits as degrees only
    names = ("shoulder", "elbow", "insertion", "roll", "wrist")
    log = replace(recording().part(0, 400), joint_names=names, robot="raven2")
    told = findings_of(in_deg_and_mm(log, *BOTH), robot=load_robot("raven2"))
    assert any(f.name == "units" and "deg" in f.remedy and "mm" in f.remedy for f in told)


PSM = load_robot("dvrk_psm")
LOOSE = {  # what a PSM does without its instrument, whose disks turn freely and whose carriage has no cannula [rad, m]
    "wrist to 170 deg": {4: np.deg2rad(170.0)},
    "wrist and roll": {3: np.deg2rad(350.0), 5: np.deg2rad(170.0)},
    "insertion to .55 m": {2: 0.55},
    "all of it": {2: 0.55, 3: np.deg2rad(350.0), 4: np.deg2rad(170.0), 5: np.deg2rad(170.0)},
}


def of_psm(reach: dict[int, float], *, stated: bool, still: tuple[int, ...] = ()) -> MotionLog:
    """A PSM that goes to 0.6 of its limits, further where `reach` says so, with joints that stand still at zero."""
    farthest = 0.6 * PSM.upper
    farthest[list(reach)] = list(reach.values())
    q = np.sin(np.outer(0.4 * np.arange(1500.0), [0.31, 0.37, 0.41, 0.43, 0.47, 0.53])) * farthest
    q[:, 2], q[:, list(still)] = np.abs(q[:, 2]), 0.0
    settled = {"units": ()} if stated else {}
    return replace(recording(), joint_names=PSM.joint_names, joint_units=PSM.joint_units, robot="dvrk_psm",
                   q_nominal=q, q_encoder=1.01 * q, settled=settled)  # fmt: skip


@pytest.mark.parametrize("reach", LOOSE.values(), ids=LOOSE)
@pytest.mark.parametrize("stated", [True, False])
def test_a_joint_beyond_its_limits_is_in_no_other_unit(reach: dict[int, float], stated: bool) -> None:
    log = of_psm(reach, stated=stated)
    assert all(each.name != "units" and "--units" not in each.remedy for each in findings_of(log, robot=PSM))


def test_one_joint_beyond_its_training_is_in_no_other_unit() -> None:
    trained = 0.6 * PSM.upper
    trained[4] = 0.5
    trained = np.array([-trained * [1, 1, 0, 1, 1, 1], trained])
    assert trained_findings(of_psm({4: np.deg2rad(170.0)}, stated=True), tuple(trained)) == []
    (told,) = trained_findings(in_deg_and_mm(of_psm({}, stated=True), *BOTH), tuple(trained))
    assert told.remedy == "--units deg,deg,mm,deg,deg,deg"


@pytest.mark.parametrize("still", [(), (3, 5)])
@pytest.mark.parametrize("stated", [True, False])
def test_numbers_in_deg_and_mm_are_found_and_mended_where_nobody_states_another_unit(
    still: tuple[int, ...], stated: bool
) -> None:
    found = findings_of(in_deg_and_mm(of_psm({}, stated=stated, still=still), *BOTH), robot=PSM)
    (told,) = [each for each in found if each.name in ("units", "range")]
    assert told.refuses
    assert (told.name, told.remedy) == (("range", "") if stated else ("units", "--units deg,deg,mm,deg,deg,deg"))


def test_rows_beyond_the_error_limit_are_not_judged() -> None:
    log = recording()
    assert log.q_encoder is not None
    wild = log.q_encoder.copy()
    wild[::40] += 3.0
    spoilt = replace(log, q_encoder=wild)
    assert any(f.name == "outliers" for f in findings_of(spoilt))
    left = findings_of(spoilt, max_error=np.full(5, 1.0))
    assert not any(f.name == "outliers" for f in left)


@pytest.mark.alike
@pytest.mark.parametrize("number", [-9999.0, 1e37, -6.8e35, 1e300])
@pytest.mark.parametrize("arrays", [("q_nominal",), ("q_encoder",), ("q_nominal", "q_encoder")])
def test_rows_where_no_arm_can_be_are_refused_and_hide_nothing_else(arrays: tuple[str, ...], number: float) -> None:
    log = recording()
    spoilt = {}
    for array in arrays:
        values = getattr(log, array).copy()
        values[-40:-38, 1] = number
        spoilt[array] = values
    found = findings_of(replace(log, **spoilt))
    told = next((f for f in found if f.refuses), None)
    if told is None:  # a number that means missing: the recording itself holds none
        assert not replace(log, **spoilt).ok[-40:-38].any()
        return
    assert (told.name, told.joints) == ("range", log.joint_names[1:2])
    assert f"2 row(s) where no arm can be: up to {abs(number):.3g} rad" in told.says
    left = Mend()(replace(log, **spoilt))
    assert told.remedy == f"--leave-out {len(log) - 40}:{len(log) - 38}"
    assert not [f for f in findings_of(Mend(leave_out=(told.remedy.split()[1],))(left)) if f.refuses]
    late = [f.name for f in findings_of(shifted(replace(log, **spoilt), 3)) if f.refuses]
    assert late == ["range", "delay"]


def test_a_joint_that_stands_still_on_purpose_is_a_note() -> None:
    log = recording()
    q = log.q_nominal.copy()
    q[:, 1] = 1.0
    assert log.q_encoder is not None
    measured = log.q_encoder.copy()
    measured[:, 1] = 1.01 + 1e-4 * np.random.default_rng(0).standard_normal(len(q))
    (found,) = [f for f in findings_of(replace(log, q_nominal=q, q_encoder=measured)) if f.name != "delay"]
    assert (found.name, found.joints, found.refuses) == ("constant", ("J2",), False)


def test_joints_that_move_as_one_are_told_apart_by_where_they_stand() -> None:
    log = recording()
    q = log.q_nominal.copy()
    q[:, 1] = q[:, 0] + 0.9
    assert log.q_encoder is not None
    measured = q + 0.01 + 1e-3 * np.random.default_rng(0).standard_normal(q.shape)
    sound = replace(log, q_nominal=q, q_encoder=measured)
    assert not any(f.refuses for f in findings_of(sound))
    swapped = replace(sound, q_encoder=measured[:, [1, 0, 2, 3, 4]])
    assert [f.joints for f in findings_of(swapped) if f.name == "swapped"] == [("J1", "J2")]


def test_a_sum_in_another_joints_place_is_put_into_its_own_before_it_is_parted() -> None:
    log = cable_arm()
    assert log.q_encoder is not None
    summed = replace(
        log, q_encoder=log.q_encoder + np.outer(0.8 * log.q_encoder[:, 1], np.eye(len(log.joint_names))[0])
    )
    found = [each for each in findings_of(exchanged(summed, MEASURED, [1, 0])) if each.refuses]
    assert [each.name for each in found] == ["swapped", "mixed"]
    assert found[1].joints == ("J1",)
    assert "as if mended by --swap J1,J2" in found[1].says


def test_a_frame_that_turns_an_axis_round_is_no_sign_beside() -> None:
    found = [each for each in findings_of(exchanged(mixed(cable_arm(), 0, 1), MEASURED, [1, 0])) if each.refuses]
    assert found
    assert not any("--sign J2" in each.remedy and "mixed" in {other.name for other in found} for each in found[:2])


def test_a_recording_without_measurements_is_judged_by_its_commands() -> None:
    log = replace(recording(), q_encoder=None)
    assert findings_of(log) == ()
    assert any(f.name == "units" for f in findings_of(in_deg_and_mm(log, "q_nominal")))


@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_a_scale_that_cables_may_have_passes(factor: float) -> None:
    assert not any(f.refuses for f in findings_of(scaled(recording(), MEASURED, [4], factor)))


@pytest.mark.parametrize(("joints", "told"), [([0, 1, 3, 4], ("J1", "J2", "J4", "J5")), ([2], ("J3",)), ([0, 1], ())])
def test_numbers_that_were_converted_twice_are_told_before_errors_look_as_small(joints: list[int], told: tuple) -> None:
    log, factors = recording(), np.ones(5)
    factors[joints] = [{"rad": np.pi / 180.0, "m": 1e-3}[log.joint_units[j]] for j in joints]
    tiny = replace(log, q_nominal=log.q_nominal * factors, q_encoder=log.q_encoder * factors)
    named = [each for each in findings_of(tiny) if "converted twice" in str(each)]
    assert [each.joints for each in named] == ([told] if told else [])
    assert not any(each.refuses for each in named)


TOGETHER = {  # what two faults or more of one recording are found to be, gravest first
    "mixed, delay": lambda: late(mixed(cable_arm(), 0, 1), 0.73),
    "clock, delay": lambda: late(drifting(cable_arm(seconds=600.0), 3e-4), 0.73),
    "clock, delay ": lambda: late(late(cable_arm(), 0.5), 0.23, slice(0, 2)),
    "sign, delay, outliers": lambda: with_outliers(late(scaled(cable_arm(), MEASURED, [0], -1.0), 0.3)),
    "swapped, scale, delay": lambda: late(scaled(exchanged(cable_arm(), MEASURED, [1, 0]), MEASURED, [0], 1.4), 0.3),
    "delay, stuck": lambda: stuck(late(cable_arm(), 0.3), 1, 0.1),
    "units, jump": lambda: leapt(scaled(recording(), MEASURED, [1], np.rad2deg(1.0)), 0, 0.3),
    "sign, jump": lambda: leapt(scaled(recording(), MEASURED, [0], -1.0), 0, 0.3),
    "turns, jump": lambda: leapt(wrapped(recording(), 3, np.pi), 3, 0.3),
    "stamps, delay": lambda: replace(late(cable_arm(), 0.3), time=1e3 * cable_arm().time),
}


@pytest.mark.parametrize("entry", [0.4, -0.7])
def test_a_sum_of_commands_names_its_entries_and_the_coupling_that_parts_it(entry: float) -> None:
    log, matrix = cable_arm(), np.eye(3)
    matrix[1, 0] = entry
    found = next(each for each in findings_of(replace(log, q_encoder=log.q_encoder @ matrix.T)) if each.name == "mixed")
    told, width = map(float, found.says.split("J2/J1 ")[1].split(", ")[0].split(" +- "))
    assert abs(told - entry) < max(2.0 * width, 0.06 * abs(entry))  # cables lose motion
    mended = NO_MEND.and_then(found.remedy)(replace(log, q_encoder=log.q_encoder @ matrix.T))
    assert not any(each.refuses for each in findings_of(mended))
    assert_allclose(mended.q_encoder, log.q_encoder, atol=0.02)


# even seeds, on which limits were set, then odd ones; 16 and 13 move along zig-zags
@pytest.mark.parametrize(("seed", "motion"), [(12, "random"), (16, "zigzag"), (17, "random"), (13, "zigzag")])
def test_on_any_arm_a_small_sum_and_a_scale_are_named_with_their_size(seed: int, motion: str) -> None:
    log = Arm(seed).moved(motion, 1, 60.0).log
    shown = scales(log)
    entry = 0.3 * shown[0] / shown[1]
    summed = log.q_encoder + np.outer(log.q_encoder[:, 0], np.eye(log.q_encoder.shape[1])[1] * entry)
    found = [each for each in findings_of(replace(log, q_encoder=summed)) if each.refuses]
    assert [each.name for each in found] == ["mixed"]
    assert float(found[0].remedy.partition("J2/J1=")[2].partition(",")[0]) == pytest.approx(-entry, rel=0.15)
    found = [each for each in findings_of(scaled(log, MEASURED, [1], 0.5)) if each.refuses]
    assert [each.name for each in found] == ["scale"]
    assert float(found[0].remedy.partition("=")[2]) == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize("seed", [6, 7])
def test_an_error_that_is_a_share_of_the_motion_is_noted(seed: int) -> None:
    log = Arm(seed).moved("random", 1, 60.0).log
    assert not any(each.name == "scale" for each in findings_of(log))
    notes = [each for each in findings_of(scaled(log, MEASURED, [1], 1.05)) if each.name == "scale"]
    assert [(each.joints, each.refuses) for each in notes] == [(("J2",), False)]
    assert float(notes[0].says.split()[3]) == pytest.approx(0.05, abs=0.015)


def test_one_sum_in_the_place_of_two_joints_is_refused_without_a_coupling() -> None:
    log = cable_arm()
    told = [
        each
        for each in findings_of(replace(log, q_encoder=log.q_encoder[:, [0, 0, 2]] + log.q_encoder[:, [1, 1, 2]]))
        if each.name == "mixed"
    ]
    assert [(each.joints, each.refuses, each.remedy) for each in told] == [(("J1", "J2"), True, "")]


@pytest.mark.parametrize("names", TOGETHER)
def test_no_finding_hides_another_whatever_is_accepted(names: str) -> None:
    wanted = names.strip().split(", ")
    found = findings_of(TOGETHER[names]())
    assert [name for name in dict.fromkeys(each.name for each in found) if name in wanted] == wanted
    refused = {each.name for each in found if each.refuses}
    assert refused == {*wanted} - {"outliers"}
    for accepted in refused:
        with pytest.raises(DataError) as refusal:
            judge([("run", each) for each in found], [accepted])
        assert set(refusal.value.names) == refused - {accepted}


def test_what_is_found_behind_another_fault_says_as_if_that_were_mended() -> None:
    found = findings_of(late(mixed(cable_arm(), 0, 1), 0.73))
    assert all("as if mended by --delay 0.7" in each.says for each in found if each.name == "mixed")
    assert not any("as if" in each.says for each in findings_of(late(cable_arm(), 0.73)))
