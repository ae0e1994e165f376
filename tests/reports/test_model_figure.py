"""The picture of a delay: the fastest joint's lines lie apart before, and upon each other after."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.recording.logs import write_parquet
from catenary.reports.joint_errors import overlay
from catenary.verdict.corrections import Mend
from command_line import catenary
from tests.truth.spoilings import late
from tests.verdict.test_delay import cable_arm

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
