import numpy as np
import pytest

from catenary.robots.catalog import load_robot
from catenary.robots.urdf_export import urdf_text
from tests.descriptions.against import between_limits, differences, main, read

ARMS = ["panda", "ur5e", "ur10e", "iiwa14", "gen3"]


@pytest.mark.parametrize("name", ARMS)
def test_an_arm_has_pinocchios_torques(name, tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(urdf_text(load_robot(name)))
    model = load_robot(name)
    poses = between_limits(model, np.random.default_rng(1))
    worst, largest = differences(model, read(path, ()), range(1, model.n + 1), poses)
    assert worst.max() < 1e-10 * largest


def test_a_link_left_out_is_seen_in_the_line(tmp_path, capsys):
    path = tmp_path / "arm.urdf"
    path.write_text(urdf_text(load_robot("ur5e")))
    assert main(["ur5e", str(path), "--without", "wrist_3"]) == 0
    robot, file, joints, share = capsys.readouterr().out.strip("| \n").split(" | ")
    assert (robot, file) == ("ur5e", "arm.urdf")
    assert float(joints.split(", ")[0]) > 1.0  # 0.365 kg at up to 0.9 m
    assert share.endswith(" of 59.9") or float(share.split(" of ")[0]) > 0.01
