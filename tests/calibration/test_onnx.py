import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.arrays import Floats
from catenary.calibration import arithmetic
from catenary.calibration.corrector import Corrector
from catenary.calibration.intervals import Intervals
from catenary.calibration.model import CalibrationModel
from catenary.calibration.onnx import OPSET, save_onnx, to_onnx
from catenary.errors import FileFormatError, MissingPackageError
from oracles.calibration_models import MIXED, PREDICTORS, random_model, ticked

CARD = {"robot": "räven"}
CLOSE = {"rtol": 1e-9, "atol": 1e-9}  # sums of some hundred terms of order one to ten, in another order


def session_of(model: CalibrationModel, **options: Any) -> onnxruntime.InferenceSession:
    made = to_onnx(model, CARD, **options)
    onnx.checker.check_model(made, full_check=True)
    return onnxruntime.InferenceSession(made.SerializeToString(), providers=["CPUExecutionProvider"])


def run(session: onnxruntime.InferenceSession, **inputs: Floats) -> dict[str, np.ndarray]:
    names = [output.name for output in session.get_outputs()]
    return dict(zip(names, session.run(names, inputs), strict=True))


def step_through(session: onnxruntime.InferenceSession, signals: Floats, q: Floats) -> tuple[Floats, np.ndarray]:
    """Corrections and flags of a motion, the graph's memory carried from step to step."""
    memory = {
        name: np.full((1, *tensor.shape[1:]), np.nan)
        for tensor in session.get_inputs()
        if (name := tensor.name) in ("midline", "play", "friction")
    }
    wants_q = any(tensor.name == "q_nominal" for tensor in session.get_inputs())
    corrections, flags = [], []
    for k in range(len(signals)):
        given = {"q_nominal": q[k : k + 1]} if wants_q else {}
        out = run(session, signals=signals[k : k + 1], **given, **memory)
        memory = {name: out[f"{name}_next"] for name in memory}
        corrections.append(out["correction"][0])
        flags.append(out["inside"][0])
    return np.array(corrections), np.array(flags)


def rows_within_and_outside(rng: np.random.Generator, signals: Floats, count: int = 400) -> Floats:
    middle, reach = signals.mean(axis=0), np.ptp(signals, axis=0) / 2.0
    return middle + rng.uniform(-1.4, 1.4, size=(count, signals.shape[1])) * reach


@pytest.mark.parametrize(("target", "per_joint"), [("error", True), ("position", False)])
@pytest.mark.parametrize("kind", [*PREDICTORS, MIXED])
def test_graph_gives_the_correction_of_every_kind_of_model(kind: str, per_joint: bool, target: Any) -> None:
    rng = np.random.default_rng([len(kind), per_joint, len(target)])
    signals = rng.normal(size=(200, 5))
    model = random_model(kind, signals, rng, joints=3, torques=2, target=target, per_joint=per_joint)
    X, q = rows_within_and_outside(rng, signals), rng.normal(size=(400, 3))
    session = session_of(model)
    given = run(session, signals=X, **({"q_nominal": q} if target == "position" else {}))
    inside = model.inside(X)
    assert 0.0 < inside.mean() < 1.0
    assert (given["inside"] == inside).all()
    assert_allclose(given["correction"], model.correction(X, q), **CLOSE)


@settings(max_examples=12, deadline=None)
@given(
    kind=st.sampled_from([*PREDICTORS, MIXED]),
    plays=st.integers(0, 2),
    coupled=st.sampled_from([0, 2]),
    midlines=st.booleans(),
    target=st.sampled_from(["error", "position"]),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_graph_stepped_through_a_motion_is_the_corrector(
    kind: str, plays: int, coupled: int, midlines: bool, target: Any, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    motion = np.cumsum(0.2 * rng.normal(size=(60, 3)), axis=0)
    model = random_model(
        kind, motion, rng, joints=2, torques=1, plays=plays, coupled=coupled, midlines=midlines, target=target,
    )  # fmt: skip
    motion[rng.random(motion.shape) < 0.02] = np.nan  # a signal that is missing for a moment
    q = motion[:, :2].copy()
    expected, flags = ticked(Corrector(model), q, motion)
    correction, inside = step_through(session_of(model), motion, q)
    known = np.isfinite(q)  # where the position itself is missing there is nothing to correct
    assert (inside & known == flags).all()
    assert_allclose((q + correction)[known], expected[known], **CLOSE)


def test_a_graph_carries_friction_states_bit_for_bit() -> None:
    rng = np.random.default_rng(8)
    model = random_model("linear", rng.normal(size=(50, 3)), rng, joints=3, coupled=3)
    motion = np.cumsum(rng.choice([0.01, 0.3, 2.0], (80, 1)) * rng.normal(size=(80, 3)), axis=0)
    motion[40, 1] = np.nan
    session, state = session_of(model), np.full((1, 12), np.nan)
    memory = model.features.memory()
    for row in motion:
        arrays = (memory, np.empty((1, len(model.features.names))), np.ones(1), np.zeros(1, dtype=bool))
        arithmetic.run(model.features.row_steps(row[None], *arrays))
        state = run(session, signals=row[None], friction=state)["friction_next"]
        assert_array_equal(state[0], memory.friction[0])


def test_metadata_say_what_goes_in_and_hold_the_card() -> None:
    rng = np.random.default_rng(5)
    model = random_model("linear", rng.normal(size=(50, 4)), rng, joints=3, torques=1, plays=1)
    made = to_onnx(model, CARD)
    props = {prop.key: prop.value for prop in made.metadata_props}
    assert json.loads(props["card"]) == CARD
    about = json.loads(props["catenary"])
    assert about["signals"] == ["q:j0", "q:j1", "q:j2", "tau:j0"]
    assert about["joint_units"] == ["rad", "rad", "m"]
    assert about["play"] == [{"position": f"q:j{k}", "half_width": 0.1} for k in range(3)]
    assert [(entry.domain, entry.version) for entry in made.opset_import] == [("", OPSET)]


def test_what_cannot_be_written_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(7)
    model = random_model("linear", rng.normal(size=(50, 3)), rng, joints=3)
    with pytest.raises(FileFormatError, match="cannot be written: No such file or directory"):
        save_onnx(model, CARD, tmp_path / "nowhere" / "a.onnx")
    monkeypatch.setitem(sys.modules, "onnx", None)  # what Python itself puts there to forbid an import
    with pytest.raises(MissingPackageError, match=r"pip install .*onnx"):
        to_onnx(model, CARD)


@pytest.mark.parametrize("target", ["error", "position"])
def test_half_widths_are_those_of_the_model_also_far_outside_and_where_an_input_is_missing(target: Any) -> None:
    rng = np.random.default_rng(7)
    signals = rng.normal(size=(200, 5))
    made = random_model("linear", signals, rng, joints=3, torques=2, per_joint=True, target=target)
    made = replace(made, intervals=Intervals(0.9, np.array([0.1, 0.2, 0.3]), np.array([0.4, 0.2, 0.7])))
    rows = signals * rng.choice([0.1, 1.0, 5.0, 300.0], size=(200, 1))
    rows[rng.integers(0, 200, 40), rng.integers(3, 5, 40)] = np.nan
    given = {"q_nominal": rows[:, :3]} if target == "position" else {}
    found = run(session_of(made), signals=rows, **given)["interval"]
    assert_allclose(found, made.correct(rows, rows[:, :3])[2], **CLOSE)


def test_rows_of_a_batch_keep_their_own_memory() -> None:
    rng = np.random.default_rng(3)
    motions = np.cumsum(0.2 * rng.normal(size=(2, 40, 3)), axis=1)
    model = random_model("tanh", motions[0], rng, joints=3, plays=2, coupled=3)
    session = session_of(model)
    together = {"play": np.full((2, 6), np.nan)}
    together["friction"] = np.full((2, 3 + 3 * 3), np.nan)
    corrections = []
    for k in range(40):
        out = run(session, signals=motions[:, k], **together)
        together = {name: out[f"{name}_next"] for name in together}
        corrections.append(out["correction"])
    for i in range(2):
        alone, _ = step_through(session, motions[i], motions[i])
        assert_allclose(np.array(corrections)[:, i], alone, **CLOSE)
