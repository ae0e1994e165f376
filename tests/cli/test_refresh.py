import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from catenary.calibration.corrector import Corrector
from catenary.calibration.model_file import load_model
from catenary.files import sha256_of
from catenary.plant import MotionLog
from catenary.recording.logs import read_log, write_parquet
from command_line import catenary

MAY_14, MAY_15 = 1778716800.0, 1778803200.0  # [s since 1970] midnight of these days of 2026, UTC


def a_day(path: Path, begin: float, seed: int, zero: float) -> Path:
    rng = np.random.default_rng(seed)
    t = np.arange(1800) / 30.0
    q = np.column_stack([np.sin(0.7 * t), 0.1 * np.cos(1.3 * t)])
    error = np.column_stack([0.03 * q[:, 0], zero + 0.02 * q[:, 1]]) + 1e-4 * rng.standard_normal(q.shape)
    log = MotionLog(path.stem, ("J1", "J2"), ("rad", "m"), q, np.ones(len(q), bool), q + error, begin + t)
    write_parquet(log, path)
    return path


@pytest.fixture
def days(tmp_path: Path) -> tuple[Path, Path]:
    monday = a_day(tmp_path / "monday.parquet", MAY_14, 0, 0.0)
    assert catenary("fit", str(monday), "--model", "linear", "--out", str(tmp_path / "arm.npz")).code == 0
    return tmp_path / "arm.npz", a_day(tmp_path / "tuesday.parquet", MAY_15, 1, 0.00098)


def test_the_command_says_what_moved_since_when_and_the_card_of_what_it_was_made(days: tuple[Path, Path]) -> None:
    model, tuesday = days
    out = model.with_name("new.npz")
    result = catenary("refresh", str(model), str(tuesday), "--out", str(out))
    assert result.code == 0
    assert "moved: J2 +0.98 mm since 14 May 2026" in result.out
    (entry,) = load_model(out)[1]["refreshed"]
    assert entry["model_sha256"] == sha256_of(model)
    assert entry["recordings"] == [{"name": "tuesday", "sha256": sha256_of(tuesday)}]
    assert entry["recorded"] == "2026-05-15"
    assert [joint["change"] for joint in entry["joints"]] == ["nothing", "zero"]


def test_a_refreshed_model_runs_in_a_loop_and_is_exported(days: tuple[Path, Path]) -> None:
    model, tuesday = days
    out = model.with_name("new.npz")
    shown = json.loads(catenary("refresh", str(model), str(tuesday), "--out", str(out), "--json").out)
    assert shown["moved"] == "J2 +0.98 mm since 14 May 2026"
    new, log = load_model(out)[0], replace(read_log(tuesday), q_encoder=None)
    assert (Corrector(new).run(log.q_nominal, log.q_nominal)[0] == new.calibrate(log)).all()
    assert catenary("export", str(out), "--onnx", str(model.with_name("new.onnx"))).code == 0


def test_a_recording_that_the_model_knows_is_refused(days: tuple[Path, Path]) -> None:
    model, tuesday = days
    out = model.with_name("new.npz")
    result = catenary("refresh", str(model), str(tuesday.with_name("monday.parquet")), "--out", str(out))
    assert result.code == 2
    assert "expected one of a new day" in result.err
    assert not out.exists()
