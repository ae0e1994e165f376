from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from catenary.sensing.mounting import load_mounting
from catenary.workflows.sense import read_still
from command_line import catenary, refusal
from oracles.manual_time import BoardTime
from oracles.shaken_imu import Shaken, X, rock
from oracles.simulated_board import SimulatedBoard


@pytest.fixture
def board(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[SimulatedBoard]:
    """A level board that speaks at 100 Hz."""
    board = SimulatedBoard(tmp_path / "board", gyroscope=False)
    time = BoardTime(board, lambda: board.line((0.0, 0.0, 9.81 + 0.001 * (board.count % 7))), board.hello)
    time.rule(monkeypatch, "catenary.workflows.sense")
    yield board
    board.close()


def test_a_simulated_sensor_is_shown_with_its_tilt():
    outcome = catenary("sense", "--simulated", "--base-tilt-deg", "10,-5", "--duration", "2")
    assert outcome.code == 0
    lines = outcome.out.split("\n")
    assert "0.0 s  gravity" in lines[0]
    assert "live" in lines[0]
    assert any(line.startswith("roll +") and "pitch -" in line for line in lines)
    assert "mean of 2.0 s" in outcome.out
    data = catenary("sense", "--simulated", "--base-tilt-deg", "20,0", "--duration", "0.5", "--json").json
    assert data["status"] == "live"
    assert data["tilt_deg"]["roll"] == pytest.approx(20.0, abs=1.0)
    assert data["magnitude"] == pytest.approx(9.81, abs=0.15)


def test_a_base_that_hangs_must_be_told_of():
    hanging = ("sense", "--simulated", "--base-tilt-deg", "0,180", "--duration", "1")
    outcome = catenary(*hanging)
    assert outcome.code == 1
    assert "upside_down" in outcome.out
    assert "no valid sample was measured" in outcome.out
    assert catenary(*hanging, "--hanging").code == 0


def test_a_simulated_tumble_writes_a_mounting_file_that_sense_takes(tmp_path: Path):
    path = tmp_path / "m.toml"
    data = catenary("sense", "--simulated", "--tumble", "--out", path, "--json").json
    assert data["mounting"] == str(path)
    assert data["faults"] == []
    assert data["readings"] == 12
    assert load_mounting(path).scale == pytest.approx(1.0, abs=0.01)
    assert catenary("sense", "--simulated", "--mounting", path, "--duration", "1").code == 0


def test_a_board_is_read_over_its_port(board: SimulatedBoard):
    data = catenary("sense", "--port", board.link, "--duration", "0.5", "--json").json
    assert data["gravity"] == pytest.approx([0.0, 0.0, -9.81], abs=0.02)
    assert data["faults"] == {}
    assert data["link"]["samples"] == 60  # and of a tenth of a second before
    assert data["link"]["damaged"] == 0


def test_a_tumble_asks_for_all_attitudes_and_refuses_a_board_at_rest(board, tmp_path, monkeypatch):
    monkeypatch.setattr("catenary.cli.sense._enter_pressed", lambda: True)
    monkeypatch.setattr("catenary.workflows.sense.read_still", partial(read_still, seconds=0.15))
    outcome = catenary("sense", "--port", board.link, "--tumble", "--out", tmp_path / "m.toml")
    assert outcome.code == 2
    assert "12/12" in outcome.err
    assert "all directions are parallel" in outcome.err
    assert not (tmp_path / "m.toml").exists()


def test_a_tumble_without_a_keyboard_is_refused(board: SimulatedBoard):
    assert "standard input has ended" in refusal("sense", "--port", board.link, "--tumble")


def _logged(kind: str, folder: Path) -> tuple[Path, tuple[str, ...]]:
    """Write readings of a base that rolls by 10 degrees at 0.4 Hz, as a logger does, and return what names its columns."""
    t, _, force, rates = Shaken(((X, rock(10.0, 0.4)),)).samples(8.0, 1)
    header, columns, options = {
        "x-io Fusion": (
            ["Time (s)", *(f"Gyroscope {a} (deg/s)" for a in "XYZ"), *(f"Accelerometer {a} (g)" for a in "XYZ")],
            [t, *np.degrees(rates).T, *force.T / 9.80665], (),
        ),
        "KITTI oxts": (
            ["time", "lat", "lon", "alt", "roll", "pitch", "yaw", "vf", "vl", "vu", "ax", "ay", "az", "wx", "wy", "wz"],
            [t, *np.tile([49.0, 8.4, 112.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], (len(t), 1)).T, *force.T, *rates.T],
            ("--columns", "ax,ay,az,wx,wy,wz"),
        ),
        "phone": (
            [*(f"ACCELEROMETER {a} (m/s2)" for a in "XYZ"), *(f"GYROSCOPE {a} (rad/s)" for a in "XYZ"), "Time (ms)"],
            [*force.T, *rates.T, 1000.0 * t], ("--time", "Time (ms)@ms"),
        ),
    }[kind]  # fmt: skip
    path = folder / "imu.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=",".join(header), comments="", fmt="%.6f")
    return path, options


@pytest.mark.parametrize("kind", ["x-io Fusion", "KITTI oxts", "phone"])
def test_public_loggers_files_are_replayed(tmp_path: Path, kind: str):
    path, options = _logged(kind, tmp_path)
    data = catenary("sense", "--replay", path, *options, "--json").json
    assert data["status"] == "live"
    assert data["gravity"] == pytest.approx([0.0, 0.0, -9.81], abs=1.8)  # the amplitude is 1.7
    assert data["magnitude"] == pytest.approx(9.81, abs=0.15)
    assert data["faults"] == {}
