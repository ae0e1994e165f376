import numpy as np
import pytest
import trimesh

from catenary.view.tubes import grown, joined, tube


def as_trimesh(mesh):
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)


def test_tube_of_two_points_is_a_closed_capsule_seen_from_outside() -> None:
    mesh = as_trimesh(tube([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]], 0.5))
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    whole = np.pi * 0.5**2 * 2.0 + 4.0 / 3.0 * np.pi * 0.5**3
    assert mesh.volume == pytest.approx(whole, rel=0.08)  # 16 sides; positive: faces look outwards


@pytest.mark.parametrize("axis", np.vstack([np.eye(3), -np.eye(3)]))
def test_tube_reaches_beyond_its_ends_by_its_radius_and_no_farther(axis: np.ndarray) -> None:
    vertices = tube([np.zeros(3), axis], 0.1).vertices
    assert (vertices @ axis).max() == pytest.approx(1.1)
    assert (vertices @ axis).min() == pytest.approx(-0.1)
    assert np.linalg.norm(vertices - np.outer(vertices @ axis, axis), axis=1).max() <= 0.1 + 1e-12


def test_tube_along_an_arc_has_the_volume_of_a_bent_cylinder() -> None:
    angles = np.linspace(0.0, np.pi / 2.0, 40)
    mesh = as_trimesh(tube(np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles]), 0.1))
    # Pappus: area times the way of its centre
    whole = np.pi * 0.1**2 * np.pi / 2.0 + 4.0 / 3.0 * np.pi * 0.1**3
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(whole, rel=0.05)


def test_joined_meshes_keep_their_volumes() -> None:
    a, b = tube([[0.0, 0, 0], [1.0, 0, 0]], 0.1), tube([[0.0, 1, 0], [1.0, 1, 0]], 0.2)
    assert as_trimesh(joined([a, b])).volume == pytest.approx(as_trimesh(a).volume + as_trimesh(b).volume)


def test_grown_tube_is_a_thicker_one() -> None:
    line = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.1]]
    assert as_trimesh(grown(tube(line, 0.1), 0.02)).volume == pytest.approx(
        as_trimesh(tube(line, 0.12)).volume, rel=0.01
    )
