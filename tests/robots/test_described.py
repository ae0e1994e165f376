import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import CatenaryError
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from catenary.robots.cut import cut_arm
from catenary.robots.shapes import load_geometry
from catenary.robots.urdf_export import urdf_text
from command_line import catenary

FRICTION = '[[actuation.friction]]\nname = "f"\non = { elbow_joint = 2.0 }\n'


@pytest.fixture
def table(tmp_path):
    (tmp_path / "arm.urdf").write_text(urdf_text(load_robot("ur10e")))

    def write(text, first='description = "arm.urdf"\n'):
        path = tmp_path / "arm.toml"
        path.write_text(first + text)
        return path

    return write


def test_a_table_beside_a_urdf_gives_it_actuation_a_name_and_a_tip(table):
    path = table(f'name = "mine"\ntip = "wrist_1_link"\n{FRICTION}')
    model = load_robot(path)
    assert (model.name, model.tip) == ("mine", "wrist_1_link")
    assert_allclose(model.actuation.friction[0].combination, [0, 0, 2, 0, 0, 0])
    assert [source.partition(",")[0] for source in model.sources[-2:]] == ["arm.urdf", "arm.toml"]
    assert load_geometry(path, model) is not None
    assert catenary("check", path).code == 0


def test_a_table_cuts_an_arm_out_of_its_description(table, rng):
    model = load_robot(table('base = "upper_arm_link"\ntip = "wrist_3_link"\n[locked_deg]\nwrist_2_joint = 30.0\n'))
    whole = load_robot(table(""))
    arm = cut_arm(whole, "upper_arm_link", "wrist_3_link", locked={"wrist_2_joint": np.pi / 6.0})
    assert model.joint_names == ("elbow_joint", "wrist_1_joint", "wrist_3_joint")
    q, gravity = rng.normal(size=3), rng.normal(size=3)
    assert_allclose(gravity_torque(model, q, gravity), gravity_torque(arm, q, gravity))


@pytest.mark.parametrize(
    ("text", "first", "said"),
    [
        (
            "",
            'description = "none.urdf"\n',
            'description "none.urdf": expected a .urdf, .xml, .mjcf, .xacro, .json file beside it',
        ),
        ('tip = "nose"\n', None, 'no frame "nose"'),
        ("[locked_m]\nelbow_joint = 0.1\n", None, '"elbow_joint" is in rad: expected locked_deg for it'),
        (FRICTION.replace("elbow_joint", "elbow"), None, 'acts on unknown coordinate "elbow"'),
        ('tipp = "tool0"\n', None, "tipp"),
    ],
)
def test_a_table_that_does_not_fit_its_description_is_refused(table, text, first, said):
    path = table(text) if first is None else table(text, first)
    with pytest.raises(CatenaryError, match=re.escape(said)) as caught:
        load_robot(path)
    assert str(path) in str(caught.value)
