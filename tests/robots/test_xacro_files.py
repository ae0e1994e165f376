import sys
from types import SimpleNamespace

import pytest

from catenary.errors import FileFormatError, MissingPackageError
from catenary.robots.catalog import load_robot

URDF = """<robot name="expanded"><link name="root"/><link name="a"><inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0"
iyy="1" iyz="0" izz="1"/></inertial></link><joint name="j" type="continuous"><parent link="root"/><child link="a"/></joint></robot>"""


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)  # not importable
    path = tmp_path / "arm.urdf.xacro"
    path.write_text("<robot/>")
    return path


def test_xacro_that_is_not_installed_is_asked_for(file):
    with pytest.raises(MissingPackageError, match="is a xacro file, and xacro is not installed: pip install xacro"):
        load_robot(file)


def test_the_package_expands_it_or_says_why_not(file, monkeypatch):
    document = SimpleNamespace(toxml=lambda: URDF)
    monkeypatch.setitem(sys.modules, "xacro", SimpleNamespace(process_file=lambda name: document))
    made = load_robot(file)
    assert (made.name, made.joint_names) == ("expanded", ("j",))
    assert made.sources[0].startswith("arm.urdf.xacro, sha256 ")
    monkeypatch.setitem(sys.modules, "xacro", SimpleNamespace(process_file=lambda name: 1 / 0))
    with pytest.raises(FileFormatError, match="xacro cannot expand it: division by zero"):
        load_robot(file)
