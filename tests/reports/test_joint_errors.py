from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import simulated_arm
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.reports import joint_errors
from catenary.reports.page import Picture
from catenary.workflows.calibration_model import fit_calibration


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
