from pathlib import Path

import numpy as np
import pytest

from catenary.errors import InputError
from catenary.identification.files import save_identification
from catenary.identification.options import IdentifyOptions
from catenary.reports.identification import excitation_facts, parameter_table, residual_table
from catenary.robots.catalog import load_robot
from catenary.workflows.identify import identify_files, part_of
from catenary.workflows.payload import payload_of_files
from moving_arm import recorded, write_npz

ARM = load_robot("raven2")
PLACE = (0.02, -0.1, 0.05)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recordings")
    write_npz(recorded(ARM, 0, noise=0.1), path / "a.npz")
    write_npz(recorded(ARM, 1, noise=0.1), path / "b.npz")
    return path


@pytest.fixture(scope="module")
def result(folder: Path):
    return identify_files([folder / "a.npz"], "raven2", IdentifyOptions(), tests=[folder / "b.npz"])


def test_the_card_holds_the_hashes_of_what_was_fitted_and_tested(result) -> None:
    assert [(entry["log"], entry["use"]) for entry in result.card["data"]] == [
        ("a", "fitted"),
        ("b", "tested"),
    ]
    assert all(len(entry["sha256"]) == 64 for entry in result.card["data"])


def test_a_filter_that_was_assumed_is_said(result) -> None:
    assert any(
        "assumed friction on every joint, a filter of order 4 at 10 Hz" in note for note in result.notes
    )


def test_tables_have_a_row_per_recording_and_parameter(result) -> None:
    found = result.identification
    assert [row[0] for row in residual_table(found).rows] == ["a", "b"]
    assert [row[-1] for row in residual_table(found).rows] == ["fitted", "holds"]
    assert len(parameter_table(found).rows) == found.base.count
    assert (
        dict(excitation_facts(found))["rank"] == f"{found.base.count} of {found.base.count} base parameters"
    )


def test_swapped_torques_in_what_is_fitted_are_noticed(folder: Path) -> None:
    log = recorded(ARM, 0, noise=0.1)
    path = folder / "mixed.npz"
    write_npz(log, path, tau=np.array(log.tau)[:, [1, 0, 2]])
    notes = identify_files([path], "raven2", IdentifyOptions()).notes
    assert "mixed: axes shoulder and elbow look swapped" in notes


def test_rows_that_are_not_there_are_refused() -> None:
    log = recorded(ARM, 0, seconds=2.0)
    assert len(part_of(log, (100, 300))) == 200
    for rows in ((-1, 5), (5, 5), (0, 401)):
        with pytest.raises(InputError, match="has rows 0 to 400"):
            part_of(log, rows)


def test_a_payload_of_files_is_that_of_their_recordings(result, folder: Path) -> None:
    model, loaded = folder / "arm.npz", folder / "loaded.npz"
    save_identification(result.identification, result.card, model)
    write_npz(recorded(ARM.with_payload("wrist", 0.2, PLACE), 2, noise=0.1), loaded)
    known = payload_of_files([loaded], model, at=("wrist", PLACE), unloaded=[folder / "b.npz"])
    assert known.payload.mass == pytest.approx(0.2, abs=0.01)
    assert known.candidates == ()
    anywhere = payload_of_files([loaded], model)
    assert anywhere.payload.link == "insertion"
    assert len(anywhere.candidates) == 2
    assert anywhere.summary()["mass"] == pytest.approx(0.2, abs=0.02)
