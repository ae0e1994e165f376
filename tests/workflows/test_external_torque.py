"""External torques in a recording, against what MuJoCo's arm feels of a known force."""

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.signal import lfilter

from catenary.dynamics.kinematics import jacobian
from catenary.identification.identification import Identification, identify
from catenary.identification.identification_file import identification_card, save_identification
from catenary.identification.identify_options import IdentifyOptions
from catenary.plant import MotionLog
from catenary.robots.catalog import load_robot
from catenary.robots.urdf_export import write_urdf
from command_line import catenary, refusal
from moving_arm import sinusoids, write_npz

ARM = load_robot("ur10e")
FORCE = np.array([15.0, -25.0, 30.0])  # [N] on the tip, base axes
PUSHED = (8.0, 14.0)  # [s]
PACE = 0.25  # of sinusoids' speed: up to 4 rad/s
NOISE = np.array([1.5, 1.5, 0.8, 0.3, 0.3, 0.2])  # [Nm]


@pytest.fixture(scope="module")
def in_mujoco(tmp_path_factory: pytest.TempPathFactory) -> Any:
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    write_urdf(ARM, path)
    return mujoco.MjModel.from_xml_path(str(path))


def recording(model: Any, seed: int, force: np.ndarray) -> MotionLog:
    """Torques that MuJoCo asks of the motors on a motion, while a force pulls at the tip, with noise."""
    rng, time = np.random.default_rng(seed), np.arange(2500) / 100.0
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
def found(in_mujoco: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    options = IdentifyOptions(friction=(), find_rotors=False, cut_samples=20)
    logs = [recording(in_mujoco, seed, np.zeros(3)) for seed in (0, 1)]
    result: Identification = identify(logs[:1], ARM, options, tests=logs[1:])
    path = tmp_path_factory.mktemp("out") / "arm.npz"
    save_identification(result, identification_card(result, []), path)
    return path


def table(path: Path) -> dict[str, np.ndarray]:
    with path.open() as file:
        header, *rows = csv.reader(file)
    return dict(zip(header, np.array(rows, dtype=float).T, strict=True))


def test_a_push_in_mujoco_is_found_within_its_interval(in_mujoco: Any, found: Path, tmp_path: Path) -> None:
    log, out = recording(in_mujoco, 2, FORCE), tmp_path / "pushed.csv"
    write_npz(log, tmp_path / "pushed.npz", joint_names=np.array(ARM.joint_names))
    line = ("payload", tmp_path / "pushed.npz", "--model", found, "--external", out)
    said = catenary(*line, "--accept", "sign", "--accept", "torques", "--json").json
    rows = table(out)
    t = rows["t [s]"]
    settled = (np.abs(t - PUSHED[0]) > 0.3) & (np.abs(t - PUSHED[1]) > 0.3)  # the filter rounds the steps
    pushed = settled & (t >= PUSHED[0]) & (t < PUSHED[1])
    q = np.array([np.interp(t, log.time, column) for column in log.q_nominal.T]).T
    asked = np.where(pushed[:, None], np.einsum("nij,i->nj", jacobian(ARM, q)[:, :3], FORCE), 0.0)
    for k, name in enumerate(ARM.joint_names):
        by_dynamics, by_momentum = rows[f"external:{name} [Nm]"], rows[f"momentum:{name} [Nm]"]
        inside = np.abs(by_dynamics - asked[:, k]) <= rows[f"within:{name} [Nm]"]
        assert 0.9 < inside[settled].mean() <= 1.0
        # what momentum shows lags as a filter of first order does, of 10 Hz
        keep = np.exp(-2.0 * np.pi * 10.0 * 0.01)
        lagging = lfilter([1.0 - keep], [1.0, -keep], asked[:, k])
        assert np.sqrt(np.mean((by_momentum - lagging)[settled] ** 2)) < 0.05 * np.abs(asked).max()
    for axis, true in zip("xyz", FORCE, strict=True):
        off = rows[f"tip:force:{axis} [N]"][pushed] - true
        assert 0.9 < np.mean(np.abs(off) <= rows[f"within:tip:force:{axis} [N]"][pushed])
    assert [joint["joint"] for joint in said["joints"]] == list(ARM.joint_names)
    assert said["joints"][1]["beyond"] > 0.15  # pushed for six of 25 seconds


def test_the_table_names_the_joint_that_felt_it_and_an_unloaded_run_gives_the_interval(
    in_mujoco: Any, found: Path, tmp_path: Path
) -> None:
    for seed, force in ((2, FORCE), (3, np.zeros(3))):
        write_npz(recording(in_mujoco, seed, force), tmp_path / f"{seed}.npz")
    line = ("payload", tmp_path / "2.npz", "--model", found, "--external", tmp_path / "o.csv")
    outcome = catenary(*line, "--unloaded", tmp_path / "3.npz", "--accept", "sign", "--accept", "torques")
    assert "External torques in 2" in outcome.out
    assert "largest force on tool0" in outcome.out
    assert "all along" not in outcome.err
    log = recording(in_mujoco, 2, FORCE)
    write_npz(replace(log, tau=log.tau + 20.0 * np.eye(6)[2]), tmp_path / "2.npz")
    steady = catenary(*line, "--accept", "sign", "--accept", "torques").err
    assert "elbow_joint: -2" in steady
    assert "all along: a zero of its torque that shifted looks like a steady push" in steady
    assert "expected one recording, got 2" in refusal(*line, tmp_path / "3.npz")
