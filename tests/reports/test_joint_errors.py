from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

import simulated_arm
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.recording.logs import write_parquet
from catenary.reports import joint_errors
from catenary.reports.joint_errors import overlay
from catenary.reports.page import Picture
from catenary.verdict.corrections import Mend
from catenary.workflows.calibration_model import fit_calibration
from command_line import catenary
from tests.truth.spoilings import late
from tests.verdict.test_delay import cable_arm


def drawn(
    path: Path, monkeypatch: pytest.MonkeyPatch, name: str | None = None, *, folds: int = 0, **changes: Any
) -> tuple[Figure, Picture]:
    """The figure of the first joint of a recording, and its picture."""
    result = fit_calibration(
        [simulated_arm.write(path, **changes)], FitOptions(kind="linear"), FitRun(held_out=0.5, folds=folds)
    )
    assert result.held_out is not None
    kept: list[Figure] = []

    def keep(figure: Figure, caption: str, alt: str = "") -> Picture:
        kept.append(figure)
        return Picture("", caption, alt)

    monkeypatch.setattr(joint_errors, "picture", keep)
    block = joint_errors.joint_picture(result.held_out, result.model, 0, name=name)
    return kept[0], block


def line(figure: Figure) -> np.ndarray:
    return np.asarray(figure.axes[0].get_lines()[0].get_xydata())


@pytest.mark.parametrize("rows", [400, 9000])
def test_no_line_crosses_where_rows_are_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: int) -> None:
    ok = np.ones(rows, dtype=bool)
    ok[int(0.7 * rows) : int(0.8 * rows)] = False
    whole = line(drawn(tmp_path / "whole.npz", monkeypatch, rows=rows)[0])
    points = line(drawn(tmp_path / "run.npz", monkeypatch, rows=rows, ok=ok)[0])
    assert np.isfinite(whole).all()
    (gap,) = np.flatnonzero(np.isnan(points[:, 1]))
    assert points[gap - 1, 0] <= 0.7 * rows / simulated_arm.RATE
    assert points[gap + 1, 0] >= 0.8 * rows / simulated_arm.RATE - 1e-6


def test_a_pause_of_the_clock_breaks_the_line_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    t = np.arange(400) / 30.0 + np.where(np.arange(400) < 300, 0.0, 60.0)
    points = line(drawn(tmp_path / "run.npz", monkeypatch, t=t)[0])
    assert np.isnan(points[:, 1]).sum() == 1


def test_the_legend_lies_off_the_data_and_long_names_are_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name = "neural, preset best, with a name that nobody would type but somebody might choose"
    figure, _ = drawn(tmp_path / "run.npz", monkeypatch, name)
    figure.draw_without_rendering()  # type: ignore[no-untyped-call]
    (legend,) = figure.legends
    box = legend.get_window_extent()
    assert not any(box.overlaps(axes.get_window_extent()) for axes in figure.axes)
    assert name in [text.get_text().replace("\n", " ") for text in legend.get_texts()]
    assert box.x0 >= 0.0


def test_one_wild_error_does_not_flatten_the_others_and_is_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = simulated_arm.arrays(rows=4000)
    content["q_act"][3500, 0] += 3.0  # [rad]
    figure, block = drawn(tmp_path / "run.npz", monkeypatch, rows=4000, q_act=content["q_act"])
    assert "outside the plot: 1." in block.caption
    assert figure.axes[0].get_ylim()[1] < 90.0


def test_an_interval_far_narrower_than_raw_errors_is_seen_close_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = simulated_arm.arrays(rows=4000)
    content["q_act"][:, 0] += 1.0  # [rad], a thousand times the interval
    figure, _ = drawn(tmp_path / "run.npz", monkeypatch, folds=5, rows=4000, q_act=content["q_act"])
    whole, close = figure.axes[0], next(axes for axes in figure.axes if axes.collections)
    (band,) = close.collections
    low, high = np.quantile(band.get_paths()[0].vertices[:, 1], [0.25, 0.75])
    assert high - low > 0.2 * np.ptp(close.get_ylim())
    assert high - low < 0.02 * np.ptp(whole.get_ylim())
    assert "interval, 90 %" in [text.get_text() for text in figure.legends[0].get_texts()]


LATE = 0.15


def test_lines_fall_together_once_re_timed() -> None:
    figure = overlay(late(cable_arm(slack=(0.0, 0.0, 0.0)), LATE), 0.0, -LATE)
    left = []
    for axes in figure.axes:
        command, seen = (line.get_xydata() for line in axes.lines)
        inside = np.isfinite(seen[:, 1]) & (seen[:, 0] >= command[0, 0]) & (seen[:, 0] <= command[-1, 0])
        error = seen[inside, 1] - np.interp(seen[inside, 0], *command.T)
        left.append(float(error.std()))
    assert left[1] < 0.1 * left[0]


def test_a_log_that_was_re_timed_is_drawn_as_it_was_recorded_too() -> None:
    log = late(cable_arm(), LATE)
    before = overlay(log, 0.0, -LATE)
    after = overlay(Mend(delay=LATE)(log), LATE, 0.0)
    assert [axes.get_title(loc="left") for axes in after.axes] == ["as recorded", "re-timed by +0.15 s"]
    for one, other in zip(before.axes, after.axes, strict=True):
        x, y = (axes.lines[1].get_xydata() for axes in (one, other))
        inside = (y[:, 0] > x[0, 0]) & (y[:, 0] < x[-1, 0]) & np.isfinite(y[:, 1])
        assert_allclose(np.interp(y[inside, 0], *x.T), y[inside, 1], atol=0.8)  # each less its own median


def test_check_draws_it(tmp_path: Path) -> None:
    write_parquet(late(cable_arm(), LATE), tmp_path / "late.parquet")
    assert catenary("check", tmp_path / "late.parquet", "--picture", tmp_path / "late.svg").code == 1
    assert b"<svg" in (tmp_path / "late.svg").read_bytes()[:2000]


@pytest.mark.usefixtures("undrawn")
def test_the_page_of_a_fit_holds_it(tmp_path: Path) -> None:
    write_parquet(late(cable_arm(), LATE), tmp_path / "late.parquet")
    page = tmp_path / "late.html"
    options = ("--delay", "0.15", "--model", "offset", "--out", tmp_path / "late.npz", "--report", page)
    assert catenary("fit", tmp_path / "late.parquet", *options).code == 0
    assert "Where the lines turn at different times, a delay remains." in page.read_text()
