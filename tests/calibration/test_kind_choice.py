"""The simplest kind that will do, joint by joint, and a model put together of several kinds."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

import simulated_arm
from catenary.calibration import calibration
from catenary.calibration.evaluate import CrossValidation, Spread
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.fit_recordings import FitResult, fit_logs
from catenary.calibration.kind_choice import CLOSE_RATIO, choose
from catenary.calibration.model_file import load_model, save_model
from catenary.calibration.model_kinds import TRIED
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.recording.logs import read_log
from command_line import catenary
from recordings import short_training

short_networks = pytest.fixture(short_training, scope="module", autouse=True)
KINDS = TRIED


def validation(errors: Any, *, recording: Any = None) -> CrossValidation:
    """Cross-validation of a joint that left these errors, row by row, in five folds."""
    after = np.asarray(errors, dtype=float)[:, None]
    folds = [np.sqrt(np.mean(part**2)) for part in np.array_split(after, 5)]
    spread = Spread("J1", "deg", 5, float(np.mean(folds)), float(np.std(folds, ddof=1)), 1.0, 0.0)
    recording = np.zeros(len(after), dtype=np.int64) if recording is None else recording
    return CrossValidation((spread,), after, after, np.ones(after.shape, dtype=bool), recording)


def tried_kinds(*errors: Any) -> dict[str, CrossValidation]:
    return {kind: validation(each) for kind, each in zip(KINDS, errors, strict=True)}


HARD = np.repeat([1.0, 9.0], 100)  # a hard time after an easy one
NOISE = np.random.default_rng(0).normal(scale=0.2, size=(4, 200))


@pytest.mark.parametrize(
    ("factors", "noise", "chosen"),
    [
        ((1.0, 1.02, 1.01, 1.0), 1.0, "offset"),  # nothing helps
        ((1.0, 0.5, 0.498, 0.497), 1.0, "linear"),  # within 3 % of the best, and within a standard error
        ((1.0, 0.5, 0.495, 0.49), 0.0, "neural"),  # but not within one: it is better on every block
        ((1.0, 0.5, 0.45, 0.446), 1.0, "hysteretic"),
        ((1.0, 0.52, 0.5, 0.6), 1.0, "hysteretic"),
    ],
)
def test_the_simplest_that_will_do_is_chosen(factors: Any, noise: float, chosen: str) -> None:
    kinds = tried_kinds(*(f * HARD * (1.0 + noise * own) for f, own in zip(factors, NOISE, strict=True)))
    (choice,) = choose(kinds)
    assert choice.chosen == chosen
    assert str(choice).startswith(f"J1: {chosen}, ")


@given(st.lists(st.tuples(st.floats(0.01, 10.0), st.floats(0.0, 2.0)), min_size=4, max_size=4))
def test_no_choice_is_far_from_the_best_and_no_simpler_one_is_as_good(found: list[Any]) -> None:
    kinds = tried_kinds(*(size * (1.0 + sd * own) for (size, sd), own in zip(found, NOISE, strict=True)))
    (choice,) = choose(kinds)
    errors = choice.errors
    best = min(errors.values())
    assert errors[choice.chosen] <= CLOSE_RATIO * best * (1.0 + 1e-12)
    for simpler in KINDS[: KINDS.index(choice.chosen)]:
        assert errors[simpler] > best


def test_kinds_that_were_tried_on_different_rows_are_not_compared() -> None:
    other = validation(HARD, recording=np.repeat([0, 1], 100))
    with pytest.raises(InputError, match="different rows"):
        choose({"offset": validation(HARD), "linear": other})


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> MotionLog:
    """An arm whose first joint is off by a constant, and whose others bend as simulated cables do."""
    whole = read_log(simulated_arm.write(tmp_path_factory.mktemp("data") / "day.npz", seed=1))
    assert whole.q_encoder is not None
    truth = whole.q_encoder.copy()
    truth[:, 0] = whole.q_nominal[:, 0] + 0.02 + 1e-4 * np.random.default_rng(0).normal(size=len(truth))
    return replace(whole, q_encoder=truth)


@pytest.fixture(scope="module")
def chosen(log: MotionLog) -> FitResult:
    return fit_logs([log], FitOptions(kind="auto"), FitRun(held_out=0.2))


def test_each_joint_gets_the_bits_of_its_kind(log: MotionLog, chosen: FitResult) -> None:
    kinds = [choice.chosen for choice in chosen.choices]
    assert kinds[0] == "offset"
    assert len(set(kinds)) > 1
    corrected = chosen.model.calibrate(log)
    for j, kind in enumerate(kinds):
        alone = fit_logs([log], FitOptions(kind=kind), FitRun(held_out=0.2, folds=0)).model
        assert_array_equal(corrected[:, j], alone.calibrate(log)[:, j])
        assert chosen.model.largest[j] == max(alone.largest[j], abs(chosen.model.offset[j]))


def test_it_is_saved_with_its_reasons(chosen: FitResult, log: MotionLog, tmp_path: Any) -> None:
    save_model(chosen.model, chosen.card, tmp_path / "arm.npz")
    model, card = load_model(tmp_path / "arm.npz")
    assert [joint["kind"] for joint in card["joints"]] == [choice.chosen for choice in chosen.choices]
    assert card["choice"][0]["errors"].keys() == set(TRIED)
    assert_array_equal(model.calibrate(log), chosen.model.calibrate(log))


def test_without_blocks_nothing_is_chosen(log: MotionLog) -> None:
    with pytest.raises(InputError, match="model auto: is chosen by its errors on folds"):
        fit_logs([log], FitOptions(kind="auto"), FitRun(folds=0))
    with pytest.raises(InputError, match='target "position"'):
        FitOptions(kind="auto", target="position")


@pytest.mark.parametrize("kind", ["auto", "neural"])
def test_arrays_and_the_command_give_the_same_model_to_the_bit(kind: Any, log: MotionLog, tmp_path: Any) -> None:
    assert log.q_encoder is not None
    assert log.time is not None
    np.savez(
        tmp_path / "run.npz", q_des=log.q_nominal, q_act=log.q_encoder, ok=log.ok, t=log.time, units=log.joint_units
    )
    typed = ("--model", kind, "--held-out", "0.2", "--out", tmp_path / "typed.npz")
    assert catenary("fit", tmp_path / "run.npz", *typed).code == 0
    called = calibration.fit(
        log.q_nominal, log.q_encoder, time=log.time, units=log.joint_units, model=kind, held_out=0.2
    )
    called.save(tmp_path / "called.npz")
    with np.load(tmp_path / "typed.npz") as one, np.load(tmp_path / "called.npz") as other:
        assert one.files == other.files
        for name in set(one.files) - {"card"}:  # which names the recording
            assert one[name].tobytes() == other[name].tobytes(), name
    cards = [load_model(tmp_path / name)[1] for name in ("typed.npz", "called.npz")]
    assert cards[0]["errors"] == cards[1]["errors"]
    assert cards[0]["choice"] == cards[1]["choice"]
