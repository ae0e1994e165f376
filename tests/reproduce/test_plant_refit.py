import shutil
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
from numpy.testing import assert_allclose

from catenary.jobs.paper_table import TABLE_1
from catenary.reproduce.plant_refit import FREE, TARGETS, with_factors, write_arm, write_refit_page
from catenary.simulation.cable_parameters import load_cable_arm


def test_targets_are_the_papers_and_never_the_networks() -> None:
    assert set(TARGETS) == {"raw", "offset", "linear"}
    assert TARGETS["offset"] == TABLE_1["fixed offset"] == (0.859, 1.095, 0.492)


def test_fitted_numbers_are_written_and_everything_else_stays(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    with as_file(files("catenary.simulation") / "data" / "raven2.toml") as packaged:
        shutil.copy(packaged, path)
    before = load_cable_arm(path)
    factors = np.linspace(0.9, 1.1, len(FREE))
    write_arm(with_factors(before, factors), path)
    after = load_cable_arm(path)
    fitted = {free.field for free in FREE}
    for free, factor in zip(FREE, factors, strict=True):
        old, new = getattr(before.cable, free.field), getattr(after.cable, free.field)
        assert_allclose(new[free.joint], factor * old[free.joint], rtol=1e-5)  # six digits are written
    for name in set(before.cable._fields) - fitted:
        assert_allclose(getattr(after.cable, name), getattr(before.cable, name), rtol=0)
    assert [entry.origin for entry in after.file.cable.values()] == [
        entry.origin for entry in before.file.cable.values()
    ]


def test_only_numbers_marked_as_fitted_are_free() -> None:
    entries = load_cable_arm().file.cable
    assert {entries[free.field].origin for free in FREE} == {"fitted"}


def test_the_page_shows_target_against_reached(tmp_path: Path) -> None:
    reached = {key: np.array(values) * 1.01 for key, values in TARGETS.items()}
    write_refit_page(tmp_path / "results", reached, np.ones(len(FREE)))
    html = (tmp_path / "results" / "plant_refit.html").read_text()
    assert "2.124" in html
    assert "2.103" in html
    assert "Simulated" in html
