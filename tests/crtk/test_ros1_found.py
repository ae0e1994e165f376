"""Where rospy is looked for."""

import importlib.util
import sys
from pathlib import Path

import pytest

from catenary.crtk.ros1 import find_rospy
from catenary.crtk.ros1.find_rospy import make_rospy_importable
from catenary.errors import MissingPackageError


@pytest.fixture
def without_rospy(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A system without rospy; the folder where Debian would have it."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(find_rospy, "_FOLDERS", (tmp_path,))
    monkeypatch.setattr(sys, "path", list(sys.path))
    return tmp_path


def test_a_system_without_rospy_is_told_how_to_get_it(without_rospy: Path) -> None:
    with pytest.raises(MissingPackageError, match=r"apt install python3-rospy.*loopback"):
        make_rospy_importable()


@pytest.mark.parametrize("fits", [True, False])
def test_the_systems_packages_come_last_where_versions_agree(without_rospy, monkeypatch, fits) -> None:
    (without_rospy / "rospy").mkdir()
    (without_rospy / "rospy" / "__init__.py").touch()
    before = list(sys.path)
    monkeypatch.setattr(find_rospy, "_system_python", lambda: sys.version_info[:2] if fits else (3, 8))
    if fits:
        make_rospy_importable()
        assert sys.path == [*before, str(without_rospy)]
    else:
        with pytest.raises(MissingPackageError, match="not found for Python"):
            make_rospy_importable()
