import csv
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.arrays import Floats
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.dynamics.kinematics import jacobian
from catenary.errors import DataError, InputError
from catenary.files import json_text
from catenary.gravity.torque import gravity_torque
from catenary.identification.identification import Identification, identify
from catenary.identification.identification_file import identification_card, save_identification
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import prepare
from catenary.plant import MotionLog
from catenary.recording.logs import Reading
from catenary.reports.identification import excitation_facts
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.robots.urdf_export import write_urdf
from catenary.sensing.wrist_tool import load_tool
from catenary.verdict.corrections import Mend
from catenary.workflows.identify import identify_files, of_joints, payload_of_files
from command_line import catenary, refusal
from moving_arm import recorded, sinusoids, write_npz
from oracles.geared_arm import ur10_log, write_ur10


def test_card_notes_and_tables_hold_what_was_fitted_and_tested(moving_arm_logs: Path) -> None:
    fitted, tested = (moving_arm_logs / f"run{k}.npz" for k in (0, 1))
    result = identify_files([fitted], "raven2", IdentifyOptions(prior=False, friction=()), tests=[tested])
    assert [(entry["log"], entry["use"]) for entry in result.card["data"]] == [("run0", "fitted"), ("run1", "tested")]
    assert all(len(entry["sha256"]) == 64 for entry in result.card["data"])
    assumed = "assumed friction on every joint, a filter of order 4 at 10 Hz"
    assert any(assumed in note for note in result.notes)
    identified = result.identification
    rows = identified.residual_table.rows
    assert [(row[0], row[-1]) for row in rows] == [("run0", "fitted"), ("run1", "holds")]
    assert len(identified.parameter_table.rows) == identified.base.count
    rank = f"{identified.base.count} of {identified.base.count} base parameters"
    assert dict(excitation_facts(identified))["rank"] == rank


EVERY = load_robot("raven2").joint_names


@pytest.mark.alike
@pytest.mark.parametrize(
    ("spoil", "message", "mend"),
    [
        (lambda tau: tau[:, [1, 0, 2]], "shoulder and elbow look swapped, torques alone", Mend(swap=("tau:shoulder,elbow",))),
        (lambda tau: tau[:, [0, 2, 1]], "", Mend(swap=("tau:elbow,insertion",))),  # a turning and a sliding one
        (lambda tau: tau * [1.0, -1.0, 1.0], "", Mend(sign=("tau:elbow",))),
        (lambda tau: -tau, "", Mend(sign=tuple(f"tau:{joint}" for joint in EVERY))),
        (lambda tau: 0.05 * tau, "all torques are 0.0[45]", Mend(scale=tuple(f"tau:{joint}=20" for joint in EVERY))),
    ],
)  # fmt: skip
def test_torques_that_are_not_the_motions_are_refused_with_what_mends_them(
    tmp_path: Path, spoil: Callable[[Floats], Floats], message: str, mend: Mend
) -> None:
    log, options = recorded(load_robot("raven2"), 0, noise=0.1), IdentifyOptions(consistent=False, friction=())
    write_npz(log, tmp_path / "spoilt.npz", tau=spoil(np.array(log.tau)))
    with pytest.raises(DataError, match=message) as refused:
        identify_files([tmp_path / "spoilt.npz"], "raven2", options)
    for name, texts in (("swap", mend.swap), ("sign", mend.sign)):
        assert all(f"--{name} {text}" in str(refused.value) for text in texts)
    mended = identify_files([tmp_path / "spoilt.npz"], "raven2", options, reading=Reading(mend=mend))
    assert not any("swapped" in note for note in mended.notes)
    if refused.value.names == ("swapped",) and message:
        accepted = identify_files([tmp_path / "spoilt.npz"], "raven2", options, accept=("swapped",)).notes
        assert any("accepted swapped" in note for note in accepted)


def poses_at_rest(path: Path, *, order: tuple[int, ...] = (0, 1, 2), sign: tuple[float, ...] = (1.0, 1.0, 1.0)) -> Path:
    """Holding torques of a RAVEN-II at random poses, times `sign`, in the order of `order`."""
    arm, rng = load_robot("raven2"), np.random.default_rng(0)
    q = rng.uniform(arm.lower, arm.upper, (300, 3))
    tau = gravity_torque(arm, q, [0.0, 0.0, -9.81]) + rng.normal(0.0, 0.05, q.shape)
    tau = (tau * sign)[:, order]
    np.savez(path, q=q, dq=np.zeros_like(q), tau=tau, fs=1.0, allow_pickle=False)
    return path


def test_torques_of_poses_at_rest_are_judged_too(tmp_path: Path) -> None:
    static = IdentifyOptions(terms="static")
    identify_files([poses_at_rest(tmp_path / "sound.npz")], "raven2", static)
    for name, spoilt, mend in (
        ("turned", {"sign": (1.0, -1.0, 1.0)}, "--sign tau:elbow"),
        ("all", {"sign": (-1.0, -1.0, -1.0)}, "--sign tau:shoulder --sign tau:elbow --sign tau:insertion"),
        ("mixed", {"order": (1, 0, 2)}, "--swap tau:shoulder,elbow"),
        ("sliding", {"order": (0, 2, 1)}, "--swap tau:elbow,insertion"),
    ):
        with pytest.raises(DataError, match=mend):
            identify_files([poses_at_rest(tmp_path / f"{name}.npz", **spoilt)], "raven2", static)  # type: ignore[arg-type]


def test_currents_with_a_known_load_give_torques(tmp_path: Path) -> None:
    urdf, gains = str(write_ur10(tmp_path)), np.array([14.0, 12.0, 11.0, 9.0, 10.0, 8.0])
    place = [0.0, 0.1, 0.1]
    for seed, payload in ((0, None), (1, None), (2, (5.0, place)), (3, (3.0, place))):
        log = ur10_log(seed, payload=payload)
        assert log.tau is not None
        write_npz(log, tmp_path / f"run{seed}.npz", tau=None, current=log.tau / gains)
    options, reading = IdentifyOptions(friction=()), Reading(currents=True)
    fitted, tested, loaded = (tmp_path / f"run{seed}.npz" for seed in range(3))
    with pytest.raises(InputError, match=r"drive gains are not known.*--load KG LOG"):
        identify_files([fitted], urdf, options, reading=reading)
    with pytest.raises(InputError, match="--currents with a known --load"):
        identify_files([fitted], urdf, options)
    result = identify_files([fitted], urdf, options, tests=[tested], reading=reading, load=(5.0, loaded))
    assert result.gains is not None
    assert (np.abs(result.gains.gains / gains - 1.0) < 0.03).all()
    assert json.loads(json_text(result.summary()))["drive_gains"]["gains"] == result.gains.gains.tolist()
    assert result.identification.tests[0].verdict == "holds"
    assert any("drive gains" in note for note in result.notes)
    assert any("the load weighs 5.0" in note or "the load weighs 4.9" in note for note in result.notes)
    # what was identified knows its gains: another load is weighed from its currents
    save_identification(result.identification, result.card, tmp_path / "arm.npz")
    (weighed,), _ = payload_of_files([tmp_path / "run3.npz"], tmp_path / "arm.npz", at=("wrist_3_link", place))
    assert weighed.mass == pytest.approx(3.0, rel=0.03)


@pytest.fixture(scope="module")
def wrist_held(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, MotionLog]:
    """A UR10 and a recording of it in which the wrist stands still."""
    folder = tmp_path_factory.mktemp("held")
    return write_ur10(folder), ur10_log(0, moving=3, rate=100.0)


QUICK = IdentifyOptions(friction=(), prior=False)
JOINTS = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint")


@pytest.mark.parametrize("count", [3, 6])
def test_three_joints_of_an_arm_are_identified_from_theirs_or_all_columns(
    count: int, wrist_held: tuple[Path, MotionLog], tmp_path: Path
) -> None:
    urdf, log = wrist_held
    assert log.qd is not None
    assert log.tau is not None
    path = tmp_path / "run.npz"
    write_npz(log, path, q=log.q_nominal[:, :count], dq=log.qd[:, :count], tau=log.tau[:, :count])
    identified = identify_files([path], str(urdf), QUICK, joints=JOINTS).identification
    assert identified.model.joint_names == JOINTS
    part = of_joints(log, identified.model)
    assert (identified.compare(prepare(part, identified.model, QUICK)).relative_rms < 0.06).all()


def test_three_joints_of_a_longer_arm_weigh_a_load_where_the_others_are_held(tmp_path: Path) -> None:
    arm, rows = load_robot("ur10e"), slice(None)
    place, held = np.array([0.0, 0.0, 0.1]), [0, 4, 5]
    parameters = tmp_path / "arm.npz"

    def run(model: RobotModel, name: str, at: float = 0.3) -> Path:
        time = np.arange(3000) / 100.0
        q, qd, qdd = sinusoids(np.random.default_rng(0), arm, time)
        q[rows, held], qd[rows, held], qdd[rows, held] = at, 0.0, 0.0
        log = MotionLog(name, arm.joint_names, arm.joint_units, q, np.ones(len(q), bool), time=time, qd=qd)
        tau = inverse_dynamics(model, q, qd, qdd, [0.0, 0.0, -9.81]) + np.random.default_rng(1).normal(0, 0.3, q.shape)
        write_npz(replace(log, tau=tau), tmp_path / f"{name}.npz", joint_names=np.array(arm.joint_names))
        return tmp_path / f"{name}.npz"

    moving = [name for k, name in enumerate(arm.joint_names) if k not in held]
    result = identify_files([run(arm, "free")], "ur10e", QUICK, joints=moving)
    save_identification(result.identification, result.card, parameters)
    loaded = run(arm.with_payload("tool0", 3.0, place), "loaded")
    (identified,), _ = payload_of_files([loaded], parameters, at=("tool0", place))
    assert identified.mass == pytest.approx(3.0, rel=0.03)
    with pytest.raises(InputError, match=r"joint shoulder_pan_joint .* was held at 0.3 when others were identified"):
        payload_of_files([run(arm, "elsewhere", at=0.5)], parameters)


def test_a_container_without_a_mapping_is_refused_with_a_proposal(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("time,q1,q2,tau1,tau2\n" + "".join(f"{i},{i},1,2,3\n" for i in range(9)))
    with pytest.raises(InputError, match=r"give a mapping, or accept the proposed one"):
        identify_files([tmp_path / "run.csv"], "two_link", QUICK)


MASS, CENTER, BIASES = 0.82, np.array([0.01, -0.02, 0.09]), np.array([3.0, -5.0, 12.0, 0.2, 0.05, -0.3])


def poses_of_ur10e(path: Path, rng: np.random.Generator, columns: int | None = None) -> Path:
    pin = pytest.importorskip("pinocchio")
    from catenary.robots.urdf_export import urdf_text

    arm = load_robot("ur10e")
    model = pin.buildModelFromXML(urdf_text(arm))
    data, frame, rows = model.createData(), model.getFrameId(arm.tip), []
    for q in rng.uniform(-2.0, 2.0, (12, 6)):
        pin.framesForwardKinematics(model, data, pin.neutral(model) + q)
        weight = data.oMf[frame].rotation.T @ [0.0, 0.0, -9.81 * MASS]
        rows.append([*q, *(np.r_[weight, np.cross(CENTER, weight)] + BIASES + 0.01 * rng.normal(size=6))])
    header = ",".join((*arm.joint_names, "fx", "fy", "fz", "tx", "ty", "tz")[:columns])
    np.savetxt(path, np.array(rows)[:, :columns], delimiter=",", header=header, comments="")
    return path


def test_mass_centre_and_biases_come_out_of_a_table_of_poses(tmp_path: Path, rng: np.random.Generator) -> None:
    table = poses_of_ur10e(tmp_path / "poses.csv", rng)
    identified = catenary("payload", table, "--wrist-sensor", "ur10e", "--json").json
    assert identified["mass"] == pytest.approx(MASS, abs=4.0 * identified["mass_deviation"])
    assert identified["mass_deviation"] < 0.002
    assert_allclose(identified["center"], CENTER, atol=2e-3)
    assert_allclose([*identified["force_bias"], *identified["torque_bias"]], BIASES, atol=0.02)
    printed = catenary("payload", table, "--wrist-sensor", "ur10e", "--tool", tmp_path / "tool.toml").out
    assert re.search(r"mass +0\.8", printed)
    assert "counts the load, in axes turned by 0.0 deg from tool0" in printed
    tool = load_tool(tmp_path / "tool.toml")
    assert (tool.mass, tool.robot, tool.frame) == (identified["mass"], "ur10e", "tool0")


def test_what_is_missing_is_named(tmp_path: Path, rng: np.random.Generator) -> None:
    table = poses_of_ur10e(tmp_path / "poses.csv", rng, columns=-1)
    assert "no column tz" in refusal("payload", table, "--wrist-sensor", "ur10e")
    assert "one of --model and --wrist-sensor" in refusal("payload", table)


ARM = load_robot("ur10e")
FORCE = np.array([15.0, -25.0, 30.0])  # [N] on the tip, base axes
PUSHED = (5.0, 9.0)  # [s]
PACE = 0.25  # of sinusoids' speed: up to 4 rad/s
NOISE = np.array([1.5, 1.5, 0.8, 0.3, 0.3, 0.2])  # [Nm]


@pytest.fixture(scope="module")
def in_mujoco(tmp_path_factory: pytest.TempPathFactory) -> Any:
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    write_urdf(ARM, path)
    return mujoco.MjModel.from_xml_path(str(path))


def recording(model: Any, seed: int, force: np.ndarray) -> MotionLog:
    """Torques that MuJoCo asks of the motors on a motion, while a force pulls at the tip, with noise."""
    rng, time = np.random.default_rng(seed), np.arange(1500) / 100.0
    q, qd, qdd = (PACE**k * values for k, values in enumerate(sinusoids(rng, ARM, PACE * time)))
    data, tau = mujoco.MjData(model), []
    for k, t in enumerate(time):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], qd[k], qdd[k]
        mujoco.mj_inverse(model, data)
        pull = jacobian(ARM, q[k])[:3].T @ force if PUSHED[0] <= t < PUSHED[1] else 0.0
        tau.append(data.qfrc_inverse - pull)
    noisy = np.array(tau) + NOISE * rng.normal(size=q.shape)
    ok = np.ones(len(time), dtype=bool)
    return MotionLog(f"run{seed}", ARM.joint_names, ARM.joint_units, q, ok, time=time, qd=qd, tau=noisy)


@pytest.fixture(scope="module")
def identified(in_mujoco: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    options = IdentifyOptions(friction=(), find_rotors=False)
    logs = [recording(in_mujoco, seed, np.zeros(3)) for seed in (0, 1)]
    result: Identification = identify(logs[:1], ARM, options, tests=logs[1:])
    path = tmp_path_factory.mktemp("out") / "arm.npz"
    save_identification(result, identification_card(result, []), path)
    return path


def table(path: Path) -> dict[str, np.ndarray]:
    with path.open() as file:
        header, *rows = csv.reader(file)
    return dict(zip(header, np.array(rows, dtype=float).T, strict=True))


def test_a_push_in_mujoco_is_found_within_its_interval(in_mujoco: Any, identified: Path, tmp_path: Path) -> None:
    log, out = recording(in_mujoco, 2, FORCE), tmp_path / "pushed.csv"
    write_npz(log, tmp_path / "pushed.npz", joint_names=np.array(ARM.joint_names))
    line = ("payload", tmp_path / "pushed.npz", "--model", identified, "--external", out)
    output = catenary(*line, "--accept", "sign", "--accept", "torques", "--json").json
    rows = table(out)
    t = rows["t [s]"]
    settled = (np.abs(t - PUSHED[0]) > 0.3) & (np.abs(t - PUSHED[1]) > 0.3)  # the filter rounds the steps
    pushed = settled & (t >= PUSHED[0]) & (t < PUSHED[1])
    q = np.array([np.interp(t, log.time, column) for column in log.q_nominal.T]).T
    external = np.where(pushed[:, None], np.einsum("nij,i->nj", jacobian(ARM, q)[:, :3], FORCE), 0.0)
    for k, name in enumerate(ARM.joint_names):
        inside = np.abs(rows[f"external:{name} [Nm]"] - external[:, k]) <= rows[f"within:{name} [Nm]"]
        assert 0.9 < inside[settled].mean() <= 1.0
    for axis, true in zip("xyz", FORCE, strict=True):
        off = rows[f"tip:force:{axis} [N]"][pushed] - true
        assert 0.9 < np.mean(np.abs(off) <= rows[f"within:tip:force:{axis} [N]"][pushed])
    assert [joint["joint"] for joint in output["joints"]] == list(ARM.joint_names)
    assert output["joints"][1]["beyond"] > 0.15  # pushed for four of 15 seconds


def test_the_table_names_the_joint_that_felt_it_and_an_unloaded_run_gives_the_interval(
    in_mujoco: Any, identified: Path, tmp_path: Path
) -> None:
    for seed, force in ((2, FORCE), (3, np.zeros(3))):
        write_npz(recording(in_mujoco, seed, force), tmp_path / f"{seed}.npz")
    line = ("payload", tmp_path / "2.npz", "--model", identified, "--external", tmp_path / "o.csv")
    outcome = catenary(*line, "--unloaded", tmp_path / "3.npz", "--accept", "sign", "--accept", "torques")
    assert "External torques in 2" in outcome.out
    assert "largest force on tool0" in outcome.out
    assert "throughout" not in outcome.err
    log = recording(in_mujoco, 2, FORCE)
    write_npz(replace(log, tau=log.tau + 20.0 * np.eye(6)[2]), tmp_path / "2.npz")
    steady = catenary(*line, "--accept", "sign", "--accept", "torques").err
    printed = re.search(r"elbow_joint: (-[\d.]+) Nm", steady)
    assert printed is not None
    assert float(printed[1]) == pytest.approx(-20.0, abs=2.0)
    assert "throughout: a shifted zero of its torque looks like a steady push" in steady
    assert "expected one recording, got 2" in refusal(*line, tmp_path / "3.npz")
