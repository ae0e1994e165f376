from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from catenary.trajectories.zigzag import unit_zigzag, zigzag_rows

Floats = NDArray[np.float64]

# name, direction, form, sparsity, rows of the whole file, every how many rows we have
PUBLISHED = [
    ("dir_x_0.25", "J1", "generator", 0.25, 31052, 10),
    ("dir_x_0.3333", "J1", "generator", 0.3333, 21060, 1),
    ("dir_xy_0.25", "J1-J2", "generator", 0.25, 31052, 10),
    ("dir_xy_0.3333", "J1-J2", "generator", 0.3333, 21060, 1),
    ("dir_xyz_0.25", "J1-J2-J3", "files", 0.25, 31052, 10),
]


@pytest.fixture(scope="module")
def published(recordings: Path) -> dict[str, Floats]:
    path = recordings / "raven2_zigzag" / "zigzag_reference.npz"
    if not path.is_file():
        pytest.skip(f"no published trajectories {path}")
    with np.load(path) as archive:
        return dict(archive)


@pytest.mark.parametrize(("name", "direction", "form", "sparsity", "rows", "every"), PUBLISHED)
def test_rows_equal_the_published_file(published, name, direction, form, sparsity, rows, every) -> None:
    ours = zigzag_rows(direction, sparsity, form=form)
    assert len(ours) == rows
    assert_allclose(ours[::every], published[name], rtol=0.0, atol=1e-12)


def test_unit_path_gives_the_controllers_own_file(published: dict[str, Floats]) -> None:
    path = unit_zigzag(0.33)
    degrees = np.array([30.0, 75.0]) + np.array([20.0, 30.0]) * path[:, :2]
    ours = np.column_stack([np.deg2rad(degrees), 0.33 + 0.06 * path[:, 2]])
    assert len(ours) == 26332
    assert_allclose(ours[::10], published["xdir_controller"], rtol=0.0, atol=1e-12)
