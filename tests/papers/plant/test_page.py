from pathlib import Path

import numpy as np
import pytest

from catenary.reports.page import Table
from catenary.simulation.cable_parameters import load_cable_arm
from papers.plant import page
from papers.plant.page import Fitted, Section, verdict, write_plant_page
from papers.plant.targets import DRIFT, FREE, FRICTION

FACTORS = (np.ones(len(parameters)) for parameters in (FRICTION, FREE, DRIFT))
FITTED = Fitted(*FACTORS, np.array([0.001, 0.0, -0.002]))


def test_what_is_within_15_percent_is_reached() -> None:
    assert verdict(np.array([1.1, 1.9, 3.0]), (1.0, 2.0, 3.0)) == "reached"


def test_what_is_not_reached_is_named_with_how_far_it_is_off() -> None:
    assert verdict(np.array([1.5, 2.0, 1.5]), (1.0, 2.0, 3.0)) == "J1 +50%, J3 -50%"


def test_every_free_parameter_is_listed_with_its_bounds() -> None:
    rows = FITTED.table().rows
    assert len(rows) == len(FRICTION) + len(FREE) + len(DRIFT)
    assert rows[0][-1] == f"{1.0 / FRICTION[0].factor:.2f} to {FRICTION[0].factor:.2f}"


def test_the_page_shows_target_verdict_and_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table = Table(["RMSE", "paper", "reached"], [["linear", "0.527", "0.515"]])
    section = Section("Drift", table, ["Since."])
    monkeypatch.setattr(page, "sections", lambda _: [section])
    path = tmp_path / "results" / "refit.html"
    write_plant_page(path, load_cable_arm(), FITTED)
    html = path.read_text()
    for text in ("0.527", "0.515", "Since.", "capstan_runout", "Simulated"):
        assert text in html
