import copy
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.errors import FileFormatError
from catenary.simulation.base_motion import FixedBase
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.firmware_plant import restore_plant, save_plant
from oracles.cable_arms import homed_plant, smooth_motion


@pytest.fixture(scope="module")
def worn() -> CablePlant:
    """An arm that has moved since it was homed."""
    plant = homed_plant(seed=2)
    plant.run(smooth_motion(plant.setpoint_js().q, 3.0))
    plant.state_command("disable")
    return plant


@pytest.fixture(scope="module")
def saved(worn: CablePlant, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("state") / "arm.npz"
    save_plant(worn, path)
    return path


def test_an_arm_put_away_is_disabled_and_goes_on_bit_for_bit(worn: CablePlant, saved: Path) -> None:
    again = CablePlant(seed=2)
    restore_plant(again, saved)
    assert again.operating_state()[:2] == ("DISABLED", True)
    assert again.time == worn.time
    assert_array_equal(again.telemetry()["ext_jpos"], worn.telemetry()["ext_jpos"])
    logs = []
    for plant in (copy.deepcopy(worn), again):
        plant.state_command("enable")
        logs.append(plant.run(smooth_motion(plant.setpoint_js().q, 3.0)))
    assert (logs[0] == logs[1]).all()


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 3},
        {"seed": None},
        {"seed": 2, "side": "right"},
        {"seed": 2, "payload": 0.1},
        {"seed": 2, "base": FixedBase(0.1, 0.0)},
    ],
    ids=str,
)
def test_the_state_of_another_arm_is_refused_and_changes_nothing(saved, other) -> None:
    plant = CablePlant(**other)  # type: ignore[arg-type]
    before = plant.state.q.copy()
    with pytest.raises(FileFormatError, match="of another robot"):
        restore_plant(plant, saved)
    assert_array_equal(plant.state.q, before)


@pytest.mark.parametrize("damage", ["missing", "empty", "text", "half", "array", "other archive"])
def test_missing_and_damaged_states_are_refused(saved: Path, tmp_path: Path, damage: str) -> None:
    path, whole = tmp_path / "state.npz", saved.read_bytes()
    if damage == "array":
        with path.open("wb") as file:
            np.save(file, np.zeros(3))
    elif damage == "other archive":
        np.savez(path, q=np.zeros(3))
    elif damage != "missing":
        path.write_bytes({"empty": b"", "text": b"nonsense", "half": whole[: len(whole) // 2]}[damage])
    message = "no such file" if damage == "missing" else "is no state of a simulated robot"
    with pytest.raises(FileFormatError, match=rf"state\.npz: {message}"):
        restore_plant(CablePlant(seed=2), path)


def test_a_state_that_lacks_what_this_version_writes_says_to_home_again(saved: Path, tmp_path: Path) -> None:
    with np.load(saved) as file:
        arrays = dict(file)
    about = json.loads(str(arrays["about"]))
    del about["base"]
    older = tmp_path / "older.npz"
    np.savez(older, **arrays | {"about": np.array(json.dumps(about))})
    with pytest.raises(FileFormatError, match=r"'base'.*another version.*catenary home PROJECT"):
        restore_plant(CablePlant(seed=2), older)


def test_an_arm_that_was_never_homed_comes_back_without_registered_encoders(tmp_path: Path) -> None:
    save_plant(CablePlant(seed=2), tmp_path / "arm.npz")
    again = CablePlant(seed=2)
    restore_plant(again, tmp_path / "arm.npz")
    assert np.isnan(again.telemetry()["ext_jpos"]).all()
    assert not again.operating_state().is_homed


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("arm.q", np.full(3, np.nan)),
        ("arm.q", np.full(3, 1e300)),
        ("arm.q", np.zeros(4)),
        ("control.counts", np.array(["a"] * 7)),
        ("rig_zero", np.full(3, np.inf)),
        ("control.braked", np.zeros(2)),
        ("about", np.array("[1]")),
        ("about", np.array("[" * 5000)),
    ],
)
def test_a_state_of_nonsense_is_refused_and_changes_nothing(saved: Path, tmp_path: Path, key, value) -> None:
    with np.load(saved) as file:
        np.savez(tmp_path / "arm.npz", **dict(file) | {key: value})
    plant = CablePlant(seed=2)
    before = plant.state.q.copy()
    with pytest.raises(FileFormatError, match=r"arm.npz: is no state.*catenary home PROJECT"):
        restore_plant(plant, tmp_path / "arm.npz")
    assert (plant.state.q == before).all()
