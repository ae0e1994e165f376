"""Numbers and names that no robot can have are refused, whatever kind of file holds them."""

import re
import warnings

import pytest

from catenary.errors import CatenaryError, FileFormatError
from catenary.robots.catalog import load_robot
from catenary.robots.dh_table import load_table
from catenary.robots.mjcf import load_mjcf
from catenary.robots.model_record import robot_from_record, robot_record
from catenary.robots.urdf import parse_urdf

TABLE = """
name = "r"
convention = "modified"
sources = ["made up"]
[[link]]
name = "a"
joint = "revolute"
alpha_deg = 0
a_m = 0
d_m = 0
theta_deg = 0
limits_deg = [-90, 90]
mass_kg = 1
com_m = [0, 0, 0.1]
inertia_kg_m2 = [0.1, 0, 0, 0.1, 0, 0.1]
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("mass_kg = 1", "mass_kg = 1e308", 'link "a": mass: 1e+308 kg, expected at most 1e+06 kg'),
        ("[0.1, 0, 0, 0.1, 0, 0.1]", "[1e20, 0, 0, 1e20, 0, 1e20]", "inertia: 1e+20 kg m2, expected at most"),
        ("[0, 0, 0.1]", "[0, 0, 2e3]", "centre of mass: 2000 m, expected at most 1000 m"),
        ("d_m = 0", "d_m = 1e9", "joint: origin: 1e+09 m, expected at most 1000 m"),
        ("[-90, 90]", "[90, -90]", "expected the lower one first"),
        ('name = "a"', 'name = "a\\u001b[2J"', "none a control character"),
        ('name = "r"', 'name = "r\\n"', "none a control character"),
        ('name = "a"', 'name = ""', "expected a name of 1 to 500 characters"),
        ('joint = "revolute"', 'joint = "revolute"\nvariable = {a = 1e300}', 'factor of "a": 1e+300'),
        ("mass_kg = 1", "mass_kg = " + "9" * 5000, "4300 digits"),
        ('sources = ["made up"]', "sources = " + "[" * 3000, "nested more than 64"),
    ],
)
def test_a_table_with_nonsense_is_refused(tmp_path, old, new, said):
    assert old in TABLE
    path = tmp_path / "robot.toml"
    path.write_text(TABLE.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(CatenaryError, match=re.escape(said)) as error:
        load_table(path)
    assert str(path) in str(error.value)


LINK = '<link name="l{0}"/>'
JOINT = '<joint name="j{0}" type="continuous"><parent link="l0"/><child link="l{0}"/></joint>'


def test_a_urdf_of_more_links_than_any_robot_is_refused():
    count = 10_000
    text = "".join(map(LINK.format, range(count))) + "".join(map(JOINT.format, range(1, count)))
    with pytest.raises(CatenaryError, match="9999 links, expected at most 1000"):
        parse_urdf(f'<robot name="r">{text}</robot>')


BODY = '<body><joint/><geom size="1"/></body>'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"<worldbody>{BODY * 1001}</worldbody>", "bodies, expected at most 1000"),
        (f'<worldbody><replicate count="100000">{BODY}</replicate></worldbody>', "bodies, expected at most 1000"),
        (f'<worldbody><replicate count="1e9">{BODY}</replicate></worldbody>', "bodies, expected at most 1000"),
        (
            '<worldbody><body><composite type="cable" count="100000 1 1"/></body></worldbody>',
            "bodies, expected at most 1000",
        ),
        (
            '<asset><hfield name="h" nrow="30000" ncol="30000" size="1 1 1 1"/></asset>',
            "asks for 9e+08 points of images and height fields",
        ),
        ('<asset><texture name="h" builtin="flat" width="20000" height="20000"/></asset>', "asks for 4e+08 points"),
        ('<size nuser_body="500000000"/>', "asks for 5e+08 reserved numbers, expected at most 10000"),
        ('<size nkey="500000000"/>', "reserved numbers"),
        ('<include file="../secret.xml"/>', "is outside"),
        ('<include file="link.xml"/>', "is outside"),
    ],
)
def test_an_mjcf_file_that_asks_for_too_much_is_refused_before_mujoco_sees_it(tmp_path, text, said):
    (tmp_path / "secret.xml").write_text("<mujoco/>")
    path = tmp_path / "robots" / "robot.xml"
    path.parent.mkdir()
    (path.parent / "link.xml").symlink_to(tmp_path / "secret.xml")
    path.write_text(f"<mujoco>{text}</mujoco>")
    with pytest.raises(FileFormatError, match=re.escape(said)):
        load_mjcf(path)


def test_an_mjcf_file_that_includes_itself_is_refused(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text('<mujoco><include file="robot.xml"/></mujoco>')
    with pytest.raises(FileFormatError, match="MuJoCo cannot read it"):
        load_mjcf(path)


@pytest.mark.parametrize("number", ["1e308", "1e200", "nan"])
def test_numbers_of_an_mjcf_file_that_overflow_are_refused_without_a_warning(tmp_path, number):
    path = tmp_path / "robot.xml"
    path.write_text(
        f'<mujoco><worldbody><body pos="{number} 0 0"><inertial pos="0 {number} 0" mass="1" diaginertia="1 1 1"/>'
        f'<joint pos="0 0 {number}"/></body></worldbody></mujoco>'
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(CatenaryError):
            load_mjcf(path)


def test_images_of_an_mjcf_file_are_not_opened(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(
        '<mujoco><asset><texture name="t" type="2d" file="lost.png"/><material name="m" texture="t"/></asset>'
        '<worldbody><body><joint/><geom size="1" material="m"/></body></worldbody></mujoco>'
    )
    assert load_mjcf(path).n == 1


def _changed(record, place, value):
    *way, last = place
    for step in way:
        record = record[step]
    record[last] = value


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        (["tree", "mass", 0], "1", "valid number"),
        (["tree", "parent", 0], 5, "parents do not come first"),
        (["tree", "parent", 0], 2**90, "whole numbers"),
        (["coupling", 0], [1.0], "rows of different lengths"),
        (["joint_names", 0], 5, "valid string"),
        (["frames", "base"], [99, [[[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]], [0, 0, 0]]], "stands on link 99"),
        (["tip"], "nowhere", "no frame"),
        (["actuation"], 3, "actuation"),
    ],
)
def test_a_record_with_nonsense_is_refused(place, value, said):
    record = robot_record(load_robot("raven2"))
    robot_from_record(record)
    _changed(record, place, value)
    with pytest.raises(FileFormatError, match=re.escape(said)):
        robot_from_record(record)


@pytest.mark.parametrize("content", [None, 3, [], "raven2", {}])
def test_a_record_that_is_no_table_is_refused(content):
    with pytest.raises(FileFormatError, match="the robot in it is damaged"):
        robot_from_record(content)


def test_lengths_that_are_hardly_meant_are_doubted(tmp_path, caplog):
    path = tmp_path / "r.toml"
    for old, new, said in (
        ("d_m = 0", "d_m = 150", "its joint lies 150 m away; lengths are in m"),
        ("com_m = [0, 0, 0.1]", "com_m = [0, 0, 31]", "its centre of mass lies 31 m away"),
    ):
        path.write_text(TABLE.replace(old, new))
        assert said in load_table(path).doubts[0]
        assert said in caplog.text
