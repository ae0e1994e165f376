import json
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pytest

import catenary
from catenary.calibration import neural
from catenary.calibration.card import model_card
from catenary.calibration.dataset import calibration_data
from catenary.calibration.evaluate import cross_validate, evaluate
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.fit_rows import choose_inputs, fit_model
from catenary.calibration.model import Card
from catenary.calibration.recordings import Recordings
from recordings import fitted, recording, short_training

quick = pytest.fixture(scope="module", autouse=True)(short_training)


def card_of(log: Any = None, *, held_out: bool = True, folds: int = 3, **options: Any) -> Card:
    log = recording(np.random.default_rng(0), rows=60, sha256="ab" * 32) if log is None else log
    asked = FitOptions(**{"kind": "linear"} | options)
    inputs = choose_inputs(Recordings.of([log]), asked)
    early, late = calibration_data([log], inputs.features).split_by_time(0.2)
    model = fit_model(early, inputs, asked)
    spread = cross_validate(early, lambda rows, _: fit_model(rows, inputs, asked), folds=folds).spread if folds else ()
    return model_card(
        model,
        early,
        asked,
        run=FitRun(robot="raven2", held_out=0.2, folds=folds),
        spread=spread,
        held_out=evaluate(model, late) if held_out else None,
        notes=("one thing was assumed",),
    )


KINDS = [
    {"kind": "offset"},
    {"kind": "linear", "play": (0.1,)},
    {"kind": "polynomial", "target": "position"},
    {"kind": "neural"},
    {"kind": "learned"},
    {"inputs": {"J1": ("q:J1",)}},
]


@pytest.mark.parametrize("options", KINDS, ids=str)
def test_card_of_every_kind_is_plain_json(options: dict[str, Any]) -> None:
    def refuse(constant: str) -> None:
        raise ValueError(constant)

    card = card_of(folds=0, **options)
    assert json.loads(json.dumps(card), parse_constant=refuse).keys() == card.keys()


def test_card_says_what_was_not_estimated_and_describes_the_network() -> None:
    log = recording(np.random.default_rng(0), rows=60, error=np.zeros_like)
    assert [joint["percent_of_offset"] for joint in card_of(log)["errors"]["held_out"]] == [None] * 3
    card = card_of(kind="neural", preset="paper", folds=0, held_out=False)
    assert (card["errors"]["cross_validation"], card["errors"]["held_out"]) == (None, None)
    assert card["settings"]["network"] == asdict(neural.PAPER)


def test_card_names_robot_joints_inputs_and_data() -> None:
    log = recording(np.random.default_rng(0), rows=60, sha256="ab" * 32)
    card = card_of(log, seed=7)
    assert (card["robot"], card["rows"], card["notes"]) == ("raven2", 48, ["one thing was assumed"])
    units = {"J1": "rad", "J2": "rad", "J3": "m"}
    assert {joint["name"]: joint["unit"] for joint in card["joints"]} == units
    expected = (log.q_encoder - log.q_nominal)[:48].mean(axis=0)
    assert [joint["fixed_offset"] for joint in card["joints"]] == pytest.approx(list(expected))
    assert [(one["name"], one["unit"]) for one in card["inputs"]] == [(f"q:{j}", unit) for j, unit in units.items()]
    source = card["data"][0]
    told = (source["name"], source["sha256"], source["rows"])
    assert told == ("run", "ab" * 32, 60)
    for flag in (True, False):
        assert card_of(replace(log, simulated=flag), folds=0)["simulated"] is flag
    asked = {"held_out": 0.2, "folds": 3, "max_error": None, "accept": [], "coverage": 0.9}
    assert card["run"] == {"seed": 7} | asked
    assert card["version"]["catenary"] == catenary.__version__
    assert card["version"]["numpy"] == np.__version__
    assert card_of(kind="polynomial", play=(0.1,))["settings"]["ridge"] == 10.0
    errors = card["errors"]
    assert errors["unit"] == {"J1": "deg", "J2": "deg", "J3": "mm"}
    spread = errors["cross_validation"]["joints"][2]
    assert (spread["joint"], spread["folds"]) == ("J3", 3)
    assert spread["rmse_mean"] > spread["rmse_sd"] > 0.0


def test_an_inputs_valid_range_is_where_no_joint_that_takes_it_falls_back() -> None:
    log = recording(np.random.default_rng(0), rows=200)
    asked = FitOptions("polynomial", inputs={"J1": ("q:J1", "q:J2")}, play=(0.1,), ridge=1.0)
    model = fitted(log, kind="polynomial", inputs={"J1": ("q:J1", "q:J2")}, play=(0.1,), ridge=1.0)
    data = calibration_data([log], model.features)
    card = model_card(model, data, asked, run=FitRun(), spread=(), held_out=None)
    assert [joint["widened_by"] for joint in card["joints"]] == [1.5, 1.5, 1.5]
    for entry in card["inputs"][:3]:  # play states cannot leave theirs
        column = model.features.names.index(entry["name"])
        X = data.X[:1].repeat(4, axis=0)
        low, high = entry["valid"]["lower"], entry["valid"]["upper"]
        X[:, column] = low - 1e-9, low + 1e-9, high - 1e-9, high + 1e-9
        box = [
            (group.valid_range.lower <= X[:, group.watched]) & (X[:, group.watched] <= group.valid_range.upper)
            for group in model.groups
        ]
        assert np.all([each.all(axis=1) for each in box], axis=0).tolist() == [False, True, True, False]
