import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.collision.obstacles import box_at, floor_at, mesh_at
from catenary.errors import FileFormatError, InputError


def test_obstacles_stand_where_they_were_put(tmp_path):
    assert floor_at(-0.2).pose.position[2] == -0.2
    box = box_at(3, [1, 2, 3, 0.1, 0.2, 0.3])
    assert box.name == "box 3"
    assert tuple(box.form) == (0.1, 0.2, 0.3)
    (tmp_path / "table.stl").write_text("solid")
    assert_array_equal(mesh_at(tmp_path / "table.stl", [1, 2, 3]).pose.position, [1, 2, 3])


def test_what_cannot_stand_anywhere_is_refused(tmp_path):
    with pytest.raises(InputError, match="floor: height nan"):
        floor_at(np.nan)
    with pytest.raises(InputError, match="box 1: expected six numbers"):
        box_at(1, [1, 2, 3])
    with pytest.raises(InputError, match="box 1: size 0, expected above zero"):
        box_at(1, [1, 2, 3, 1, 0, 1])
    with pytest.raises(FileFormatError, match="no such mesh"):
        mesh_at(tmp_path / "none.stl", [0, 0, 0])
