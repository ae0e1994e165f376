import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import simulated_arm
from catenary.calibration.evaluate import Evaluation, Spread
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.reports.error_tables import error_table
from catenary.reports.headline import MOST_JOINTS, JointGain, headline, recommendation
from catenary.workflows.calibration_model import fit_calibration


@pytest.fixture(scope="module")
def evaluation(tmp_path_factory: pytest.TempPathFactory) -> Evaluation:
    path = simulated_arm.write(tmp_path_factory.mktemp("headline") / "run.npz")
    found = fit_calibration([path], FitOptions(kind="linear"), FitRun(held_out=0.5)).held_out
    assert found is not None
    return found


def with_joint(evaluation: Evaluation, number: int, **changes: object) -> Evaluation:
    joints = list(evaluation.joints)
    joints[number] = replace(joints[number], **changes)  # type: ignore[arg-type]
    return replace(evaluation, joints=tuple(joints))


def test_the_headline_has_the_numbers_of_the_table(evaluation: Evaluation) -> None:
    said = headline(evaluation)
    for name, unit, raw, _, after, *_ in error_table(evaluation).rows:
        assert f"from {raw} to {after} {unit} ({name})" in said
    assert said.count(".") == len(re.findall(r"\d\.\d", said)) + 1  # one sentence


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rmse": 2.0, "offset_rmse": 1.0}, "worse than the fixed offset"),
        ({"rmse": 1.0, "offset_rmse": 1.0}, "no better than the fixed offset"),
        ({"rmse": 0.1, "offset_rmse": 1.0, "outside_valid_range": 0.5}, "50% of rows are outside its trained range"),
    ],
)  # fmt: skip
def test_a_joint_that_gains_nothing_is_not_recommended(
    evaluation: Evaluation, changes: dict[str, float], words: str
) -> None:
    fine = {"rmse": 0.1, "offset_rmse": 1.0, "outside_valid_range": 0.0}
    for number in range(3):
        evaluation = with_joint(evaluation, number, **fine)
    said = headline(with_joint(evaluation, 1, **changes))
    assert f"recommended for 2 of 3 joints (J2: {words})" in said
    assert "recommended for every joint" in headline(evaluation)


def test_errors_on_training_data_are_no_verdict(evaluation: Evaluation) -> None:
    said = headline(evaluation, unseen=False)
    assert said.startswith("No test")
    assert "recommended" not in said
    spread = [Spread(f"J{j}", "deg", 5, 0.25, 0.01, 0.75, 0.01) for j in range(3)]
    said = headline(evaluation, unseen=False, spread=spread)
    assert said.startswith("On blocks of time that it did not see")
    assert "after the fixed offset from 0.750 to 0.250 deg (J0)" in said
    assert "recommended for every joint" in said


NAMES = st.lists(st.text(min_size=1, max_size=60), min_size=2, max_size=30)


@given(NAMES, st.randoms(use_true_random=False))
def test_every_joint_is_counted_whatever_its_name(names: list[str], rng: object) -> None:
    against = [rng.choice(["", "worse than the fixed offset"]) for _ in names]  # type: ignore[attr-defined]
    gains = [JointGain(n, "deg", 1.0, 0.5, a) for n, a in zip(names, against, strict=True)]
    said, good = recommendation(gains), against.count("")
    if good == len(names):
        assert said == "recommended for every joint"
    else:
        assert said.startswith(f"recommended for {good or 'none'} of {len(names)} joints (")
        refused = [name for name, reason in zip(names, against, strict=True) if reason]
        assert all(name in said for name in refused[:MOST_JOINTS])
