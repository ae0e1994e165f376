from pathlib import Path

import numpy as np

from catenary.identification.options import IdentifyOptions
from catenary.reports.identification import excitation_facts, parameter_table, residual_table
from catenary.robots.catalog import load_robot
from catenary.workflows.identify import identify_files
from moving_arm import recorded, write_npz


def test_card_notes_and_tables_hold_what_was_fitted_and_tested(moving_arm_logs: Path) -> None:
    fitted, tested = (moving_arm_logs / f"run{k}.npz" for k in (0, 1))
    result = identify_files([fitted], "raven2", IdentifyOptions(), tests=[tested])
    assert [(entry["log"], entry["use"]) for entry in result.card["data"]] == [
        ("run0", "fitted"),
        ("run1", "tested"),
    ]
    assert all(len(entry["sha256"]) == 64 for entry in result.card["data"])
    assumed = "assumed friction on every joint, a filter of order 4 at 10 Hz"
    assert any(assumed in note for note in result.notes)
    found = result.identification
    rows = residual_table(found).rows
    assert [(row[0], row[-1]) for row in rows] == [("run0", "fitted"), ("run1", "holds")]
    assert len(parameter_table(found).rows) == found.base.count
    rank = f"{found.base.count} of {found.base.count} base parameters"
    assert dict(excitation_facts(found))["rank"] == rank


def test_swapped_torques_in_what_is_fitted_are_noticed(tmp_path: Path) -> None:
    log = recorded(load_robot("raven2"), 0, noise=0.1)
    write_npz(log, tmp_path / "mixed.npz", tau=np.array(log.tau)[:, [1, 0, 2]])
    notes = identify_files([tmp_path / "mixed.npz"], "raven2", IdentifyOptions()).notes
    assert "mixed: axes shoulder and elbow look swapped" in notes
