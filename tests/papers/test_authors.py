"""The calibration paper's experiments on files in its authors' layout, whose errors are known."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError
from papers import authors
from papers.__main__ import main
from papers.calibration import authors as files
from papers.calibration import figure_5, homings, six_hours, table_1
from recordings import short_training

MIDDLE, HALF = np.array([0.7, 1.44, 0.375]), np.array([0.35, 0.48, 0.045])  # [rad, rad, m]
SHARE = np.array([[0.02, 0.01, 0.0], [0.0, -0.03, 0.02], [0.001, 0.0, 0.01]])  # of positions in errors
SHOWN = np.array([np.rad2deg(1.0), np.rad2deg(1.0), 1e3])


def write(path: Path, rng: np.random.Generator, zero: np.ndarray, rows: int = 900) -> np.ndarray:
    """Write rows of 252 columns as the authors' notebook reads them; return the errors (N, 3) [rad, rad, m]."""
    path.parent.mkdir(parents=True, exist_ok=True)
    t = np.arange(rows) / 30.0
    q = MIDDLE + HALF * np.sin(np.outer(t, rng.uniform(0.2, 0.6, 3)) + rng.uniform(0.0, 6.3, 3))
    error = zero + (q - MIDDLE) @ SHARE.T
    table = 1e-3 * rng.normal(size=(rows, 252))
    table[:, 0], table[:, 1:4], table[:, 4], table[:, 12] = t, q + error, t, 1.6e9 + t
    table[:, 13:16] = np.rad2deg(q)  # metres of insertion times 180 / pi, too
    table[:, 17:21] = 5.0 * np.sin(np.outer(t, [0.3, 0.4, 0.5, 0.6]))  # the tool
    table[:, [29, 30, 31, 32, 33]] = 3
    np.savetxt(path, table, delimiter=",", fmt="%.17g")
    return error


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, np.ndarray]]:
    """Six unloaded hours, homings with one seen, and zig-zags of J1 and of J2-J3; errors by file."""
    folder, rng, zero = tmp_path_factory.mktemp("authors"), np.random.default_rng(0), np.array([0.02, -0.03, 0.002])
    names = [f"six_unloaded/data_record_yz_{n}_1" for n in ("05", "03", "025", "02", "016")]
    names += [f"six_unloaded/data_record_rand1200_h{k}" for k in range(6)]
    names += [f"with_homing/data_record_yz_{n}" for n in ("05_hm0", "03_hm1", "025_hm1")]
    names += [f"with_homing/data_record_rand1200_hm{k}" for k in range(3)]
    names += [f"one/data_record_{name}" for name in ("x_05", "x_03", "x_025", "rand1200")]
    return folder, {name: write(folder / f"{name}.csv", rng, zero + 0.01 * ("_h5" in name)) for name in names}


hurried = pytest.fixture(short_training)


def rmse(error: np.ndarray, offset: np.ndarray) -> np.ndarray:
    return SHOWN * np.sqrt(np.mean((error - offset) ** 2, axis=0))


def case(root: Path, function: object, **told: object) -> dict:
    """A planned case of a function, with fewer models."""
    found = [one for each in authors.planned(root) for one in each.cases if one.load() is function]
    arguments = found[0].arguments | {name: value for name, value in told.items() if name in found[0].arguments}
    return function(**arguments)


def test_six_hours_have_the_errors_that_the_files_were_made_with(root) -> None:
    folder, errors = root
    found = case(folder, six_hours.six_hours, sets=["1/2+1/3"], models=["linear"])
    trained = np.vstack([errors[f"six_unloaded/data_record_yz_{n}_1"] for n in ("05", "03")])
    for hour in range(6):
        error = errors[f"six_unloaded/data_record_rand1200_h{hour}"][::15]  # twice a second
        shift = 0.01 * (hour == 5)
        assert_allclose(found["raw"]["1/2+1/3"][hour]["errors"], rmse(error, 0.0), rtol=2e-3)
        offset = found["fixed offset"]["1/2+1/3"][hour]["errors"]
        assert_allclose(offset, rmse(error, trained.mean(axis=0)), rtol=2e-3)
        assert_allclose(found["linear"]["1/2+1/3"][hour]["errors"], shift * SHOWN, atol=2e-3)


@pytest.mark.usefixtures("hurried")
def test_directions_sparsities_and_homings_have_them_too(root) -> None:
    folder, errors = root
    test = errors["one/data_record_rand1200"]
    trained = np.vstack([errors[f"one/data_record_x_{n}"] for n in ("05", "03", "025")])
    of_x = case(folder, table_1.direction_errors, networks=[0])
    of_set = case(folder, figure_5.sparsity_errors, networks=[0])
    homed = case(folder, homings.homing_errors, networks=[0], ours=[])
    assert_allclose(of_x["fixed offset"], rmse(test, trained.mean(axis=0)), rtol=2e-3)
    assert max(of_x["linear"]) < 0.01
    after = errors["six_unloaded/data_record_rand1200_h0"]
    offset = rmse(after, errors["six_unloaded/data_record_yz_05_1"].mean(axis=0))
    assert_allclose(of_set["fixed offset"][0], offset, rtol=2e-3)
    assert list(homed) == ["one seen"]
    assert np.array(homed["one seen"]["linear"]).shape == (2, 3, 3)  # combinations that the files allow, tests, joints
    assert np.max(homed["one seen"]["linear"]) < 0.01


@pytest.mark.usefixtures("hurried")
def test_the_command_writes_what_the_folder_holds_as_measured_on_a_real_arm(root, tmp_path: Path) -> None:
    only = tmp_path / "only"
    (only / "one").mkdir(parents=True)
    for path in (root[0] / "one").iterdir():
        (only / "one" / path.name).symlink_to(path)
    assert main(["authors", str(only), "--quick", "--out", str(tmp_path / "out")]) == 0
    (written,) = (tmp_path / "out").glob("authors-*/*.json")
    content = json.loads(written.read_text())
    assert (content["name"], content["simulated"], content["missing"]) == ("calibration-table-1", False, 0)
    assert [row[0] for row in content["tables"][0]["rows"]] == ["J1"]
    assert not any(claim.get("fitted") for claim in content["claims"])


def test_a_folder_without_such_files_is_refused(tmp_path: Path) -> None:
    (tmp_path / "data.zip").write_bytes(b"")
    with pytest.raises(InputError, match=r"data_record_yz_05.csv.*unpack data.zip first"):
        files.folders(str(tmp_path))
