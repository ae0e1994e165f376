import base64
import io
import re
from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

import simulated_arm
from catenary.calibration.evaluate import Evaluation
from catenary.calibration.fit import FitOptions
from catenary.reports import calibration
from catenary.reports.calibration import error_table, percent, window_table, write_calibration_report
from catenary.reports.joint_picture import joint_picture
from catenary.reports.page import Picture
from catenary.workflows.fit import FitResult, FitRun, fit_calibration

NAME = "<b>J1</b> & co"


def fitted(path: Path, **changes: object) -> FitResult:
    changes = {"joint_names": [NAME, "J2", "J3"], **changes}
    return fit_calibration(
        [simulated_arm.write(path, **changes)], FitOptions(kind="linear"), FitRun(held_out=0.5)
    )


def page_of(result: FitResult, path: Path) -> str:
    assert result.held_out is not None
    write_calibration_report(
        path,
        result.model,
        result.card,
        result.held_out,
        tested_on="the rest",
        spread=result.spread,
        notes=["one note"],
    )
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> FitResult:
    return fitted(tmp_path_factory.mktemp("report") / "run.npz")


@pytest.fixture(scope="module")
def page(result: FitResult, tmp_path_factory: pytest.TempPathFactory) -> str:
    return page_of(result, tmp_path_factory.mktemp("page") / "page.html")


@pytest.fixture(scope="module")
def evaluation(result: FitResult) -> Evaluation:
    assert result.held_out is not None
    return result.held_out


def pictures(page: str) -> list[np.ndarray]:
    texts = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    return [matplotlib.image.imread(io.BytesIO(base64.b64decode(text, validate=True))) for text in texts]


def test_the_page_needs_nothing_else(page: str) -> None:
    assert not re.search(r"https?://|<script|<link|@import|url\(", page)
    assert all(source.startswith("data:") for source in re.findall(r'(?:src|href)="([^"]*)"', page))


def test_every_joint_has_a_picture(page: str) -> None:
    drawn = pictures(page)
    assert len(drawn) == 3
    for image in drawn:
        assert image.std() > 0.01  # something is drawn on it


def test_names_are_escaped(page: str) -> None:
    assert "&lt;b&gt;J1&lt;/b&gt; &amp; co" in page
    assert "<b>J1" not in page


def test_table_notes_and_card_stand_on_the_page(page: str) -> None:
    assert "one note" in page
    assert "Cross-validation over blocks of time" in page
    assert "The whole card" in page
    assert "Tested on the rest: 200 rows." in page


def test_real_data_are_not_marked_as_simulated(page: str) -> None:
    assert "no real robot was measured" not in page


def test_simulated_data_are_marked(
    result: FitResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(calibration, "joint_picture", lambda *_: Picture("", ""))
    simulated = replace(result, card={**result.card, "simulated": True})
    assert "Simulated: no real robot was measured" in page_of(simulated, tmp_path / "page.html")


@pytest.mark.parametrize("t", [None, np.tile(np.arange(2000.0), 5)])
def test_long_recordings_are_drawn_too(tmp_path: Path, t: np.ndarray | None) -> None:
    result = fitted(tmp_path / "run.npz", rows=10_000, t=t)
    assert result.held_out is not None
    drawn = joint_picture(result.held_out, result.model, 0)
    assert "the median over each of about 300 stretches" in drawn.caption
    assert matplotlib.image.imread(io.BytesIO(base64.b64decode(drawn.png))).std() > 0.01


def test_tables_have_one_cell_per_column(evaluation: Evaluation) -> None:
    for table in (error_table(evaluation), window_table(evaluation)):
        assert {len(row) for row in table.rows} == {len(table.header)}


def test_the_error_table_shows_the_evaluation(evaluation: Evaluation) -> None:
    row, joint = error_table(evaluation).rows[2], evaluation.joints[2]
    errors = [f"{value:.3f}" for value in (joint.raw_rmse, joint.offset_rmse, joint.rmse)]
    assert list(row[:5]) == ["J3", "mm", *errors]


def test_a_percentage_of_nothing_is_a_dash() -> None:
    assert (percent(12.345, 1), percent(float("nan"), 1)) == ("12.3 %", "-")
