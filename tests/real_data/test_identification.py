"""Identification on recordings of real arms, against errors published or measured with other tools (their README)."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from catenary.dynamics.kinematics import forward_kinematics
from catenary.gravity.torque import gravity_torque
from catenary.identification.cable_loops import cable_loops
from catenary.identification.explanations.findings import explained_torques, findings_against
from catenary.identification.identification import Identification, identify, identify_samples
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.payload import estimate_payload
from catenary.identification.samples import prepare
from catenary.plant import MotionLog
from catenary.recording.logs import Reading, read_torque_log
from catenary.robots.catalog import load_robot
from catenary.robots.urdf import load_urdf
from catenary.spatial import LEVEL
from catenary.workflows.identify import identify_files

PUBLISHED = IdentifyOptions(consistent=False, friction=())  # as others fit: Coulomb and viscous friction
WEIGHT = ("20", [0.024, 0.535, 0.0])  # where the weight of 105 g was, in the public model's frame 20


def log_of(folder: Path, name: str, robot: str) -> MotionLog:
    path = folder / name
    if not path.is_file():
        pytest.skip(f"no recording {path}")
    return read_torque_log(path, load_robot(robot))


@pytest.fixture(scope="module")
def dvrk(recordings: Path) -> Path:
    return recordings / "dvrk_wpi_dynamics"


@pytest.fixture(scope="module")
def psm(dvrk: Path) -> Identification:
    names = ("psm_one.npz", "psm_one_no_weight.npz")
    fitted, other_day = (log_of(dvrk, name, "dvrk_psm_motors") for name in names)
    return identify([fitted], load_robot("dvrk_psm_motors"), tests=[other_day])


def test_psm_is_fitted_as_well_as_published(dvrk: Path) -> None:
    log = log_of(dvrk, "psm_one.npz", "dvrk_psm_motors")
    free = identify([log], load_robot("dvrk_psm_motors"), PUBLISHED)
    assert free.base.count == free.rank == 49
    known = np.array([0.066, 0.143, 0.179, 0.110, 0.206, 0.196, 0.237])
    assert (free.training[0].relative_rms <= 1.05 * known).all()


def test_psm_of_another_day_is_predicted_as_well_as_with_other_tools(psm: Identification) -> None:
    known = np.array([0.065, 0.170, 0.164, 0.234, 0.335, 0.383, 0.378])
    assert (psm.tests[0].relative_rms <= known).all()
    assert np.mean(psm.tests[0].relative_rms / known) < 0.86  # friction that builds up after reversals
    assert psm.tests[0].verdict == "drifted"  # the arm changed between days


def test_two_days_of_a_psm_are_fitted_where_coupled_joints_show_no_friction_of_each_day(dvrk: Path) -> None:
    logs = [log_of(dvrk, name, "dvrk_psm_motors") for name in ("psm_one.npz", "psm_one_no_weight.npz")]
    options = IdentifyOptions(consistent=False, friction=("recording",))
    result = identify(logs, load_robot("dvrk_psm_motors"), options)
    assert result.rank == result.base.count


def test_mtm_is_fitted_with_the_published_number_of_parameters(dvrk: Path) -> None:
    log, model = log_of(dvrk, "mtm_one.npz", "dvrk_mtm_motors"), load_robot("dvrk_mtm_motors")
    free = identify([log], model, PUBLISHED)
    assert free.base.count == 73
    assert (free.training[0].relative_rms <= [0.09, 0.18, 0.19, 0.21, 0.26, 0.23, 0.34]).all()
    bodies = identify([log], model, IdentifyOptions(friction=()))
    assert (bodies.training[0].rms <= 1.1 * free.training[0].rms).all()
    assert bodies.robot().tree.mass.min() > 0.0


@pytest.mark.slow
def test_the_end_of_the_mtms_motion_is_predicted_better_than_by_plain_friction(dvrk: Path) -> None:
    samples = prepare(log_of(dvrk, "mtm_one.npz", "dvrk_mtm_motors"), load_robot("dvrk_mtm_motors"), IdentifyOptions())
    early = np.arange(len(samples)) < int(0.8 * len(samples))
    first, last = samples.rows(early, "first 80 %"), samples.rows(~early, "last 20 %")
    result = identify_samples([first], load_robot("dvrk_mtm_motors"), IdentifyOptions()).test([last])
    known = np.array([0.089, 0.204, 0.125, 0.207, 0.215, 0.177, 0.327])  # Coulomb and viscous friction alone
    assert (result.tests[0].relative_rms <= 1.02 * known).all()  # bodies alone cost axis 1 2 %
    assert np.mean(result.tests[0].relative_rms / known) < 0.9


def test_panda_is_predicted_on_the_seconds_it_was_not_fitted_to(recordings: Path) -> None:
    log = log_of(recordings / "panda_dynamics", "panda_first60.npz", "panda")
    assert identify([log], load_robot("panda"), PUBLISHED).base.count == 64
    result = identify([log], load_robot("panda"), IdentifyOptions(blocks=1.0))
    known = np.array([0.085, 0.009, 0.014, 0.012, 0.124, 0.051, 0.158])  # of other tools, the folder's README
    assert (result.tests[0].relative_rms <= known).all()
    assert np.mean(result.tests[0].relative_rms / known) < 0.85


def test_a_geared_arm_is_identified_from_its_currents_and_a_known_load(recordings: Path) -> None:
    folder = recordings / "ur10e_dynamics"
    fitted, tested, loaded = (
        folder / f"{name}.npz" for name in ("free_12harm_30s", "free_14harm_50s", "load_14harm_50s")
    )
    if not loaded.is_file():
        pytest.skip(f"no recording {loaded}")
    result = identify_files(
        [fitted], "ur10e", IdentifyOptions(), tests=[tested], reading=Reading(currents=True), load=(2.805, loaded)
    )
    identified, arm = result.identification, load_robot("ur10e")
    without_rotors = np.array([0.0502, 0.0217, 0.0276, 0.0613, 0.0812, 0.1099])
    assert (identified.tests[0].relative_rms <= without_rotors).all()
    assert np.mean(identified.tests[0].relative_rms / without_rotors) < 0.85
    assert result.gains is not None
    assert (result.gains.errors < 0.1).all()
    assert (result.gains.errors[1:] < 0.05).all()
    robot, q = identified.robot(), np.random.default_rng(0).uniform(-np.pi, np.pi, (500, 6))
    assert (np.abs(robot.tree.mass / arm.tree.mass - 1.0) < 0.15).all()
    off = gravity_torque(robot, q, LEVEL) - gravity_torque(arm, q, LEVEL)
    assert (np.sqrt(np.mean(off**2, axis=0)) < [0.01, 3.0, 1.5, 0.1, 0.1, 0.1]).all()  # of 122 Nm and 42 on J2, J3
    samples = prepare(read_torque_log(loaded, identified.model), identified.model, identified.options)
    assert estimate_payload(identified, [samples]).mass == pytest.approx(2.805, rel=0.05)


def test_a_staublis_wrist_is_identified_with_the_drive_that_two_joints_share(recordings: Path) -> None:
    folder = recordings / "tx40_dynamics"
    if not (folder / "first60.npz").is_file():
        pytest.skip(f"no recording {folder}")
    result = identify_files([folder / "first60.npz"], str(folder / "tx40.urdf"), IdentifyOptions(blocks=1.0))
    by_hand = np.array([0.078, 0.098, 0.177, 0.139, 0.167, 0.167])  # of other tools, told of the drive
    assert (result.identification.tests[0].relative_rms < 0.65 * by_hand).all()
    assert any("a drive moves joint_5 + joint_6" in note for note in result.notes)


def test_masters_static_torques_are_predicted_from_both_sides(recordings: Path) -> None:
    folder = recordings / "dvrk_mtm_static_gravity"
    logs = [log_of(folder, f"grid4_{side}.npz", "dvrk_mtm") for side in ("pos", "neg")]
    options = IdentifyOptions(terms="static", blocks=128)
    result = identify(logs, load_robot("dvrk_mtm"), options)
    for test in result.tests:
        assert (test.rms[1:3] <= 0.075).all()  # [Nm] J2, J3


def test_tiagos_lift_and_arm_are_explained(recordings: Path) -> None:
    log = log_of(recordings / "tiago_dynamics", "tiago_dynamic.npz", "tiago")
    # the rows that the figaroh examples use
    result = identify([log.part(921, 6791)], load_robot("tiago"))
    assert (result.training[0].relative_rms[:5] < 0.35).all()
    assert result.rank == result.base.count


def test_tiagos_table_is_the_robots_own_chain(recordings: Path) -> None:
    path = recordings / "tiago_dynamics" / "tiago_chain.json"
    if not path.is_file():
        pytest.skip(f"no {path}")
    model = load_robot("tiago")
    for q in np.random.default_rng(0).uniform(-2.0, 2.0, size=(10, 8)):
        T = np.eye(4)
        for joint, x in zip(json.loads(path.read_text()), q, strict=True):
            fixed, moved = np.eye(4), np.eye(4)
            fixed[:3, :3], fixed[:3, 3] = joint["R0"], joint["p0"]
            if joint["type"] == "P":
                moved[2, 3] = x
            else:
                moved[:2, :2] = [[np.cos(x), -np.sin(x)], [np.sin(x), np.cos(x)]]
            T = T @ fixed @ moved
        pose = forward_kinematics(model, q)
        np.testing.assert_allclose(pose.position, T[:3, 3], atol=1e-9)
        np.testing.assert_allclose(pose.rotation, T[:3, :3], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "cutoff_hz", "largest"),
    [("psm_one_105g_insertion.npz", None, 0.010), ("psm_half_105g_insertion.npz", 8.48, 0.035)],
)
def test_a_known_weight_is_weighed(psm, dvrk, name, cutoff_hz, largest) -> None:
    log = log_of(dvrk, name, "dvrk_psm_motors")
    samples = prepare(log, psm.model, IdentifyOptions(cutoff_hz=cutoff_hz))
    payload = estimate_payload(psm, [samples], at=WEIGHT)
    assert payload.detected
    assert payload.mass == pytest.approx(0.105, abs=largest)


def test_an_unloaded_arm_of_another_day_carries_no_payload(psm: Identification, dvrk: Path) -> None:
    samples = [prepare(log_of(dvrk, "psm_one_no_weight.npz", "dvrk_psm_motors"), psm.model, IdentifyOptions())]
    payload = estimate_payload(psm, samples, at=WEIGHT)
    assert not payload.detected
    assert payload.mass is not None
    assert abs(payload.mass) <= 0.020
    assert not estimate_payload(psm, samples).detected


def test_a_weight_anywhere_is_found_on_a_link_that_turns_with_the_second_axis(psm, dvrk) -> None:
    samples = [prepare(log_of(dvrk, "psm_one_105g_insertion.npz", "dvrk_psm_motors"), psm.model, IdentifyOptions())]
    payload = estimate_payload(psm, samples)
    assert payload.detected
    # bars that turn with the pitch: whose mass it is and how far it hangs these torques do not tell
    assert "pitch" in payload.likely
    assert payload.mass is None


@pytest.mark.parametrize("joints", [range(7), [3]])
def test_a_panda_whose_torques_are_turned_names_the_joints(recordings: Path, joints) -> None:
    log, panda = log_of(recordings / "panda_dynamics", "panda_first60.npz", "panda"), load_robot("panda")
    sign = np.ones(7)
    sign[list(joints)] = -1.0
    assert log.tau is not None
    [finding] = explained_torques(panda, prepare(replace(log, tau=sign * log.tau), panda, IdentifyOptions()))[0]
    assert (finding.name, finding.refuses) == ("sign", True)
    assert finding.joints == tuple(panda.joint_names[j] for j in joints)


@pytest.mark.parametrize("name", ["psm_one_no_weight.npz", "psm_one_105g_insertion.npz"])
def test_a_second_of_motion_in_which_joints_hardly_move_is_not_refused(dvrk: Path, name: str) -> None:
    log, arm = log_of(dvrk, name, "dvrk_psm_motors"), load_robot("dvrk_psm_motors")
    ninth = log.part(len(log) * 8 // 10, len(log) * 9 // 10)  # q1 and q5 look swapped in it
    assert not any(finding.refuses for finding in explained_torques(arm, prepare(ninth, arm, IdentifyOptions()))[0])


@pytest.mark.parametrize(
    ("spoil", "says", "remedy"),
    [
        (lambda qd, other: 57.29578 * qd, "are 57.3 times the derivatives", "--scale qd:q1=0.01745"),
        (lambda qd, other: qd[:, [0, 2, 1, 3, 4, 5, 6]], "of q2 are those of q3", "--swap qd:q2,q3"),
        (lambda qd, other: other[::-1], "do not follow positions", "--leave-out qd"),
        (lambda qd, other: np.roll(qd, 8, axis=0), "velocities come 40 ms too late", ""),
    ],
    ids=["deg/s", "swapped", "of another recording", "late"],
)
def test_velocities_that_do_not_belong_to_positions_are_named_first(dvrk: Path, spoil, says, remedy) -> None:
    arm = load_robot("dvrk_psm_motors")
    log, other = (log_of(dvrk, name, "dvrk_psm_motors") for name in ("psm_one.npz", "psm_one_no_weight.npz"))
    spoilt = replace(log, qd=spoil(log.qd, other.qd))
    first, *_ = explained_torques(arm, prepare(spoilt, arm, IdentifyOptions(), within_limits=False))[0]
    assert (first.name, first.refuses) == ("velocities", bool(remedy))
    assert says in first.says
    assert first.remedy.startswith(remedy)


def test_swapped_axes_of_a_recording_are_noticed(dvrk: Path, psm: Identification) -> None:
    log = log_of(dvrk, "psm_one_no_weight.npz", "dvrk_psm_motors")
    mixed = replace(log, **{key: getattr(log, key)[:, [1, 0, *range(2, 7)]] for key in ("q_nominal", "qd", "tau")})
    messages = [str(each) for each in findings_against(psm, prepare(mixed, psm.model, psm.options))]
    assert any("q1 and q2 look swapped, all columns" in each for each in messages)


def test_lost_motion_of_a_da_vinci_tool_is_that_of_its_torque(recordings: Path) -> None:
    path = recordings / "davinci_tools" / "4LPitch1_000.npz"
    if not path.is_file():
        pytest.skip(f"no recording {path}")
    with np.load(path) as run:
        t, q, jaw, tau = (run[name] for name in ("t", "q_des", "q_act", "tau"))
    log = MotionLog("jaw", ("jaw",), ("rad",), q, np.ones(len(t), bool), q_encoder=jaw, time=t, tau=tau)
    (backwards,), doubts = cable_loops(log)
    assert [doubt.name for doubt in doubts] == ["sign"]  # it counts against the motion
    assert backwards.friction.high < 0.0
    (cable,), doubts = cable_loops(replace(log, tau=-tau))
    assert not doubts
    loop = np.deg2rad(80.0) * 2.0 * cable.friction.value  # a compliance under load of 70 to 93 deg/Nm
    assert loop / 3.0 * 0.9 < cable.width.value < loop / 2.0 * 1.1
    assert cable.stiffness.low > 1.0 / np.deg2rad(93.0)  # a reversal meets a stiffer cable than a load does


def test_nine_seconds_at_5_khz_are_fitted_as_well_as_without_the_filters_edges(recordings: Path) -> None:
    folder = recordings / "tx40_dynamics"
    if not folder.is_dir():
        pytest.skip(f"no recording {folder}")
    arm, data = load_urdf(folder / "tx40.urdf"), np.load(folder / "first60.npz")
    every, time = np.ones(len(data["q"]), dtype=bool), np.arange(len(data["q"])) / 5000.0
    log = MotionLog("tx40", arm.joint_names, arm.joint_units, data["q"], every, time=time, tau=data["tau"])
    left = identify([log], arm, PUBLISHED).training[0].relative_rms
    assert (left[:2] < [0.045, 0.055]).all()  # .145 .202 with 100 samples cut, .041 .049 with 500 (its README)
