import base64
import io
import re
from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import simulated_arm
from catenary.calibration.evaluate import Evaluation, Spread, error_table, evaluate
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.fit_recordings import FitResult
from catenary.reports.calibration import JointGain, headline, recommendation, write_calibration_report
from catenary.reports.joint_errors import error_blocks, window_table
from catenary.workflows.calibration_model import fit_calibration
from view.browser import looked_at_empty

NAME = "<b>J1</b> & co"
Result = tuple[FitResult, Evaluation]


def page_of(result: FitResult, evaluation: Evaluation, path: Path, **changes: object) -> str:
    options = {"tested_on": "the rest", "spread": result.spread, "notes": ["one note"]}
    write_calibration_report(path, result.model, {**result.card, **changes}, evaluation, **options)
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """A model fitted to half of a recording, and its errors on the other half."""
    path = simulated_arm.write(tmp_path_factory.mktemp("report") / "run.npz", joint_names=[NAME, "J2", "J3"])
    result = fit_calibration([path], FitOptions(kind="linear"), FitRun(held_out=0.5))
    assert result.held_out is not None
    return result, result.held_out


@pytest.fixture(scope="module")
def page(result: Result, tmp_path_factory: pytest.TempPathFactory) -> str:
    return page_of(*result, tmp_path_factory.mktemp("page") / "page.html")


def drawn(png: str) -> bool:
    """Whether something can be seen on a picture."""
    return bool(matplotlib.image.imread(io.BytesIO(base64.b64decode(png, validate=True))).std() > 0.01)


@pytest.mark.usefixtures("undrawn")
def test_the_page_says_what_intervals_hold_and_a_model_without_says_so(
    result: Result, page: str, tmp_path: Path
) -> None:
    fit, evaluation = result
    assert "Intervals" in page
    assert "half-width" in page
    assert f"actual {100.0 * evaluation.joints[0].coverage:.1f} %" in page
    without = replace(fit, model=replace(fit.model, intervals=None))
    text = page_of(without, evaluate(without.model, evaluation.data), tmp_path / "without.html", simulated=True)
    assert "The model has no intervals" in text
    assert "Dashed" not in text
    assert ["Simulated: no real robot was measured" in each for each in (page, text)] == [False, True]


def test_the_page_needs_nothing_else_and_has_a_picture_of_every_joint(page: str) -> None:
    assert not re.search(r"https?://|<script|<link|@import|url\(", page)
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    kinds = [source.partition(",")[0] for source in sources]
    assert sorted(kinds) == ["data:image/png;base64"] * 3
    pictures = [source.partition(",")[2] for source in sources if source.startswith("data:image/png")]
    assert all(drawn(picture) for picture in pictures)


def test_joints_stand_in_order_with_their_worst_moment(result: Result, page: str) -> None:
    _, evaluation = result
    captions = re.findall(r"<figcaption>(.*?): RMSE .*?, at worst (\S+) \S+ at (\d+) s \(circle\)", page)
    assert [name for name, _, _ in captions] == ["&lt;b&gt;J1&lt;/b&gt; &amp; co", "J2", "J3"]
    for j, (_, worst, at) in enumerate(captions):
        errors = evaluation.after_model[:, j] * (1e3 if evaluation.joints[j].unit == "mm" else 180.0 / np.pi)
        assert abs(float(worst)) == pytest.approx(np.abs(errors).max(), abs=1e-3)
        near = np.abs(evaluation.data.time - float(at)) <= 1.0
        assert np.abs(errors[near]).max() == pytest.approx(np.abs(errors).max())


def test_the_page_is_printed_on_two_sheets(result: Result, tmp_path: Path) -> None:
    page_of(*result, tmp_path / "page.html")
    with looked_at_empty() as looked:
        looked.page.goto(f"file://{tmp_path / 'page.html'}")
        printed = looked.page.pdf(format="A4", prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page\b(?!s)", printed)) == 2


def test_the_page_says_all_of_its_model_by_one_name_and_escapes_names(result: Result, page: str) -> None:
    for words in (
        "one note", "Cross-validation", "The whole card", "Tested on the rest: 200 rows, recording without a date.",
        "&lt;b&gt;J1&lt;/b&gt; &amp; co", ": linear</title>", ">linear RMSE [deg|mm]<", "after linear",
        "RMSE of linear over time", "Page made on", "Unknown: name a robot whose tip", "H. Peng, A. Lewis",
        "Outside: share of rows",
    ):  # fmt: skip
        assert words in page
    assert "<b>J1" not in page
    assert re.search(r'class="verdict">[^<]*recommended for', page)
    assert not any("model RMSE" in str(block) for block in error_blocks(result[1], "recommended"))


def test_the_error_table_shows_the_evaluation(result: Result) -> None:
    _, evaluation = result
    for table in (error_table(evaluation), window_table(evaluation)):
        assert {len(row) for row in table.rows} == {len(table.header)}
    row, joint = error_table(evaluation).rows[2], evaluation.joints[2]
    errors = [f"{value:.3f}" for value in (joint.raw_rmse, joint.offset_rmse, joint.rmse)]
    assert list(row[:5]) == ["J3", "mm", *errors]


def test_every_number_of_the_page_stands_under_its_unit(page: str) -> None:
    units = re.compile(r"\[[^\]]+\]")
    words = {"joint", "unit", "joints", "recording", "rows", "blocks", "verdict", "model"}
    for table in re.findall(r"<table>.*?</table>", page, re.S):
        heads = re.findall(r"<th [^>]*>(.*?)</th>", table)
        assert all(units.search(head) or head in words for head in heads), heads
        if "[deg|mm]" in table:
            assert "unit" in heads


@pytest.fixture(scope="module")
def evaluation(result: Result) -> Evaluation:
    return with_joint(result[1], 0, name="J1")


def with_joint(evaluation: Evaluation, number: int, **changes: object) -> Evaluation:
    joints = list(evaluation.joints)
    joints[number] = replace(joints[number], **changes)  # type: ignore[arg-type]
    return replace(evaluation, joints=tuple(joints))


def test_the_headline_has_the_numbers_of_the_table(evaluation: Evaluation) -> None:
    said = headline(evaluation)
    for name, unit, raw, _, after, *_ in error_table(evaluation).rows:
        assert f"from {raw} to {after} {unit} ({name})" in said
    assert said.count(".") == len(re.findall(r"\d\.\d", said)) + 1  # one sentence


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rmse": 2.0, "offset_rmse": 1.0}, "worse than the fixed offset"),
        ({"rmse": 1.0, "offset_rmse": 1.0}, "no better than the fixed offset"),
        ({"rmse": 0.1, "offset_rmse": 1.0, "outside_valid_range": 0.5}, "50% of rows are outside its trained range"),
    ],
)  # fmt: skip
def test_a_joint_that_gains_nothing_is_not_recommended(
    evaluation: Evaluation, changes: dict[str, float], words: str
) -> None:
    fine = {"rmse": 0.1, "offset_rmse": 1.0, "outside_valid_range": 0.0}
    for number in range(3):
        evaluation = with_joint(evaluation, number, **fine)
    said = headline(with_joint(evaluation, 1, **changes))
    assert f"recommended for 2 of 3 joints (J2: {words})" in said
    assert "recommended for every joint" in headline(evaluation)


def test_errors_on_training_data_are_no_verdict(evaluation: Evaluation) -> None:
    said = headline(evaluation, unseen=False)
    assert said.startswith("No test")
    assert "recommended" not in said
    spread = [Spread(f"J{j}", "deg", 5, 0.25, 0.01, 0.75, 0.01) for j in range(3)]
    said = headline(evaluation, unseen=False, spread=spread)
    assert said.startswith("On data that it did not see")
    assert "after the fixed offset from 0.750 to 0.250 deg (J0)" in said
    assert "recommended for every joint" in said


NAMES = st.lists(st.text(min_size=1, max_size=9), min_size=2, max_size=9)


@given(NAMES, st.randoms(use_true_random=False))
def test_every_joint_is_counted_whatever_its_name(names: list[str], rng: object) -> None:
    against = [rng.choice(["", "worse than the fixed offset"]) for _ in names]  # type: ignore[attr-defined]
    gains = [JointGain(n, "deg", 1.0, 0.5, a) for n, a in zip(names, against, strict=True)]
    said, good = recommendation(gains), against.count("")
    if good == len(names):
        assert said == "recommended for every joint"
    else:
        assert said.startswith(f"recommended for {good or 'none'} of {len(names)} joints (")
        refused = [name for name, reason in zip(names, against, strict=True) if reason]
        assert all(name in said for name in refused[:6])
