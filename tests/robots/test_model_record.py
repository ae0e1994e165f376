"""An identified file wherever a robot is taken: what it says is what its identification predicts."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.actuation_loads import known_loads
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.errors import FileFormatError
from catenary.identification.identification import Identification, identify
from catenary.identification.identification_file import identification_card, save_identification
from catenary.identification.identify_options import IdentifyOptions
from catenary.robots.catalog import load_robot
from catenary.robots.urdf_export import urdf_text
from catenary.workflows.gravity_trials import simulated_arm
from command_line import catenary
from moving_arm import LEVEL, recorded, sinusoids

ARM = load_robot("planar_3r")


@pytest.fixture(scope="module")
def found() -> Identification:
    return identify([recorded(ARM, 0, noise=0.01)], ARM, IdentifyOptions(friction=()))


@pytest.fixture(scope="module")
def path(found: Identification, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("identified") / "arm.npz"
    save_identification(found, identification_card(found, []), path)
    return path


def test_its_links_and_friction_together_are_what_was_identified(found: Identification, path: Path) -> None:
    robot = load_robot(path)
    q, qd, qdd = sinusoids(np.random.default_rng(5), ARM, np.linspace(0.0, 3.0, 40))
    loads = known_loads(robot)
    assert loads is not None
    tau = inverse_dynamics(robot, q, qd, qdd, LEVEL) + loads.torque(q, qd, qdd)
    assert_allclose(tau, found.predict(q, qd, qdd), atol=1e-8)


@pytest.mark.parametrize("command", ["gravity", "check", "fk", "plot"])
def test_commands_take_it(path: Path, command: str, tmp_path: Path) -> None:
    pose = () if command == "check" else ("--q", "0,0.3,0.2")
    out = ("--out", tmp_path / "arm.png") if command == "plot" else ()
    outcome = catenary(command, path, *pose, *out, "--json")
    assert outcome.code == 0, outcome.err


def test_it_is_simulated_with_its_friction(path: Path) -> None:
    pytest.importorskip("mujoco")
    arm = simulated_arm(str(path))
    arm.plant.servo_jf(np.zeros(3))
    loads = known_loads(load_robot(path))
    assert loads is not None
    coulomb = [v for term, v in zip(loads.terms, loads.values, strict=True) if term.kind == "coulomb"]
    assert_allclose(coulomb, 0.3, atol=0.02)  # recorded with 0.3 Nm
    outcome = catenary("hold", path, "--q", "0,0.3,0.2", "--seconds", "0.2", "--json")
    assert outcome.code == 0, outcome.err


def test_its_urdf_has_friction_of_every_joint(path: Path) -> None:
    robot = load_robot(path)
    joints = [j for j in ElementTree.fromstring(urdf_text(robot)).iter("joint") if j.get("type") != "fixed"]
    dynamics = [joint.find("dynamics") for joint in joints]
    assert len(dynamics) == 3
    for element in dynamics:
        assert element is not None
        assert float(element.get("friction", "nan")) == pytest.approx(0.3, abs=0.02)
        assert float(element.get("damping", "nan")) == pytest.approx(0.3, abs=0.02)


def test_archives_that_are_no_robot_are_refused_with_the_way_out(tmp_path: Path) -> None:
    free = identify([recorded(ARM, 0)], ARM, IdentifyOptions(friction=(), consistent=False))
    save_identification(free, identification_card(free, []), tmp_path / "free.npz")
    np.savez(tmp_path / "run.npz", q=np.zeros((3, 3)))
    with pytest.raises(FileFormatError, match="identify once more without --free"):
        load_robot(tmp_path / "free.npz")
    with pytest.raises(FileFormatError, match="holds no robot"):
        load_robot(tmp_path / "run.npz")
