"""Convert a calibration model file to ONNX, and say what a program must know to run it."""

from pathlib import Path
from typing import Any

from catenary.calibration.corrector import decimation_at
from catenary.calibration.files import load_model
from catenary.calibration.onnx import OPSET, save_onnx
from catenary.errors import InputError


def export_onnx(path: Path, out: Path, *, rate_hz: float | None = None) -> dict[str, Any]:
    """Write the model at `path` as an ONNX graph; return a summary, plain data.

    Args:
        path: A model that `save_model` wrote.
        out: File to write.
        rate_hz: How often a program will step the graph [Hz], which matters to models with history only;
            None for the rate of the training rows.

    Raises:
        FileFormatError: `path` is no model, or `out` cannot be written.
        InputError: `out` is `path`, or the model's previous positions do not lie at this rate.
        MissingPackageError: onnx is not installed.
    """
    if out.exists() and out.samefile(path):
        raise InputError(f"{out}: is the model that is read here; expected another file to write")
    model, card = load_model(path)
    decimation = 1 if rate_hz is None else decimation_at(model, rate_hz)
    made = save_onnx(model, card, out, decimation=decimation)
    notes = model.asked_of_reports
    if model.features.history and rate_hz is None:
        trained = "an unknown rate" if model.rate_hz is None else f"{model.rate_hz:g} Hz"
        notes.append(f"the graph is to be stepped at the rate of the training rows, {trained}")
    return {
        "model": str(path),
        "file": str(out),
        "kind": model.kind,
        "opset": OPSET,
        "inputs": {tensor.name: _shape(tensor) for tensor in made.graph.input},
        "outputs": {tensor.name: _shape(tensor) for tensor in made.graph.output},
        "signals": list(model.features.signals),
        "joints": list(model.joint_names),
        "notes": notes,
    }


def _shape(tensor: Any) -> list[int | str]:
    return [size.dim_param or size.dim_value for size in tensor.type.tensor_type.shape.dim]
