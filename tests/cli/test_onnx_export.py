from pathlib import Path

import numpy as np
import onnxruntime
import pytest

from command_line import catenary, refusal


@pytest.fixture(scope="module")
def model(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "arm.npz"
    assert catenary("fit", run, "--model", "linear", "--play", "0.1", "--out", path).code == 0
    return path


def test_export_writes_a_graph_that_runs_and_tells_its_inputs(model: Path, tmp_path: Path) -> None:
    out = tmp_path / "arm.onnx"
    outcome = catenary("export", model, "--onnx", out, "--json")
    assert outcome.json["inputs"] == {"signals": ["rows", 3], "play": ["rows", 3]}
    assert outcome.json["signals"] == ["q:J1", "q:J2", "q:J3"]
    assert set(outcome.json["outputs"]) == {"correction", "inside", "interval", "play_next"}
    session = onnxruntime.InferenceSession(out, providers=["CPUExecutionProvider"])
    correction, inside = session.run(
        ["correction", "inside"], {"signals": np.full((1, 3), 1e3), "play": np.full((1, 3), np.nan)}
    )
    assert np.isfinite(correction).all()
    assert not inside.any()  # so far away


def test_a_graph_has_no_rate(model: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.onnx"
    assert "goes with --c" in refusal("export", model, "--onnx", out, "--rate-hz", "1")
    assert not out.exists()
