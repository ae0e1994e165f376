import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import NotReadyError
from catenary.plant import MotionLog
from catenary.simulation.cable_plant import JOINTS, CablePlant, as_reported
from catenary.trajectories.reference import Trajectory
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.workflows.simulated_recording import record_simulated
from oracles.cable_arms import ROBOTS, homed_plant

SECONDS = 12.0


def motion() -> Trajectory:
    return random_sinusoids(np.random.default_rng(0), SECONDS)


@pytest.fixture(scope="module")
def log() -> MotionLog:
    return record_simulated(homed_plant(seed=1), motion(), "run", np.random.default_rng(0))


def test_it_has_the_positioning_joints_at_the_rate_asked_for(log: MotionLog) -> None:
    assert log.joint_names == JOINTS[:3]
    assert set(log.signals) == {f"{group}:{tool}" for group in ("q", "tau") for tool in (*JOINTS[3:], "unused")}
    assert len(log) == pytest.approx(30.0 * SECONDS, abs=2)
    assert (np.diff(log.time) > 0.0).all()
    assert log.simulated


def test_encoders_tell_true_positions_between_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = []
    run = CablePlant.run

    def watched(plant: CablePlant, rows: np.ndarray) -> object:
        runs.append(run(plant, rows))
        return runs[-1]

    monkeypatch.setattr(CablePlant, "run", watched)
    plant = homed_plant(seed=1)
    log = record_simulated(plant, motion(), "run", np.random.default_rng(0))
    at = np.round(1000.0 * log.time).astype(int)
    true = plant.encoders.positions(plant.encoders.rig.counts * runs[-1].q[at])
    count = 1.0 / np.abs(plant.encoders.rig.counts)
    # 5 ms from the nearest sample at the acceleration of a turn, (0.07 rad/s, 7 mm/s) / 0.25 s, and half a count
    bend = 0.5 * 0.005**2 * np.array([0.3, 0.3, 0.03])
    assert log.q_encoder is not None
    assert (np.abs(log.q_encoder - true) <= 0.5 * count + 10.0 * bend).all()
    assert_allclose(log.q_nominal, as_reported(plant, runs[-1].joint[at, :3]), rtol=0)


def test_an_arm_that_is_not_homed_is_not_moved() -> None:
    with pytest.raises(NotReadyError):
        record_simulated(CablePlant(), motion(), "run", np.random.default_rng(0))


def test_the_other_arm_servoes_meanwhile() -> None:
    arms = [homed_plant(side, robot=ROBOTS[1]) for side in ("left", "right")]
    log = record_simulated(arms[0], motion(), "run", np.random.default_rng(0), columns=("all",), other_arm=arms[1])
    held = [values for name, values in log.signals.items() if name.startswith("green_tau:") and "unused" not in name]
    assert len(held) == 7
    assert all(values.any() for values in held)  # it holds its weight and its tool
    assert any(np.ptp(values) > 0.0 for values in held)  # and is not a constant
