from pathlib import Path

import numpy as np
import onnxruntime
import pytest

from command_line import catenary, refusal


@pytest.fixture(scope="module")
def model(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "arm.npz"
    assert catenary("fit", run, "--model", "linear", "--history", "1", "--out", path).code == 0
    return path


def test_export_writes_a_graph_that_runs_and_tells_its_inputs(model: Path, tmp_path: Path) -> None:
    out = tmp_path / "arm.onnx"
    outcome = catenary("export", model, "--onnx", out, "--json")
    assert outcome.json["inputs"] == {"signals": ["rows", 3], "previous": ["rows", 1, 3]}
    assert outcome.json["signals"] == ["q:J1", "q:J2", "q:J3"]
    assert set(outcome.json["outputs"]) == {"correction", "inside", "interval", "previous_next"}
    session = onnxruntime.InferenceSession(out, providers=["CPUExecutionProvider"])
    correction, inside = session.run(
        ["correction", "inside"], {"signals": np.zeros((1, 3)), "previous": np.full((1, 1, 3), np.nan)}
    )
    assert np.isfinite(correction).all()
    assert not inside.any()  # without previous positions
    assert "at the rate of the training rows" in catenary("export", model, "--onnx", out).err


def test_export_at_a_rate_that_does_not_fit_is_refused(model: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.onnx"
    assert "previous positions" in refusal("export", model, "--onnx", out, "--rate-hz", "1")
    assert not out.exists()
