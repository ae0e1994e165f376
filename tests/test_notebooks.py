"""What objects of the public door show of themselves, in the real kernel of a notebook and to the last of their kinds."""

import base64
import io
import re
import shutil
from dataclasses import replace
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient
from PIL import Image

import catenary
from catenary.tables import OnScreen
from moving_arm import recorded
from notebooks import BESIDE, EXAMPLES, notebook_of
from test_arguments import ARM, CALLS, LOG, OBJECTS, STATE, Q


def executed(notebook: nbformat.NotebookNode, folder: Path) -> list[list[nbformat.NotebookNode]]:
    """Run a notebook in a kernel of its own; return the outputs of each code cell."""
    for path in BESIDE:
        shutil.copy(path, folder)
    client = NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(folder)}})
    return [cell.outputs for cell in client.execute().cells if cell.cell_type == "code"]


def darkness(output: nbformat.NotebookNode) -> float:
    """Return the share of a picture that is drawn on."""
    drawn = np.asarray(Image.open(io.BytesIO(base64.b64decode(output.data["image/png"]))).convert("L"))
    assert min(drawn.shape) > 300
    return float(np.mean(drawn < 250))


def test_a_figure_shows_in_the_first_cell_and_an_object_as_a_screen(tmp_path):
    cells = ['import catenary\narm = catenary.load_robot("two_link")\ncatenary.plot(arm)', "arm"]
    made = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in cells])
    drawn, shown = executed(made, tmp_path)
    assert 0.01 < darkness(drawn[-1]) < 0.9  # not empty
    assert shown[-1].data == {"text/plain": repr(ARM), "text/html": ARM._repr_html_()}


@pytest.mark.parametrize(
    "path",
    [pytest.param(p, marks=[] if p.name[:2] == "01" else pytest.mark.slow) for p in sorted(EXAMPLES.glob("0*.py"))],
    ids=lambda p: p.stem,
)
def test_an_example_runs_as_a_notebook(path, tmp_path):
    notebook = notebook_of(path.read_text())
    assert notebook.cells[0].cell_type == "markdown"
    outputs = [one for outputs in executed(notebook, tmp_path) for one in outputs]
    assert any(one.output_type == "stream" and one.name == "stdout" and one.text.strip() for one in outputs)


HELD = {"CompactRegressor": "stands for", "SymbolicFunction": "sin", "Calibration": "largest correction", "LoopReport": "RMS error",
        "Evaluation": "of the fixed offset", "Identification": "std / value", "MotionLog": "RMS error"}  # fmt: skip


def test_what_the_public_door_gives_prints_in_few_characters_and_shows_a_screen():
    found = [
        *OBJECTS,
        STATE,
        replace(LOG, name="<script>" * 100),
        *map(catenary.load_robot, ("panda", "dual_arm_19", "raven2_full")),
    ]
    found += [catenary.compact_regressor(found[-3]), catenary.identify([recorded(ARM, 0, seconds=12.0)], ARM)]
    for name in ("export_function", "evaluate", "check_data", "lock_joints", "fit_wrist_tool", "locate_load",
                 "forward_kinematics", "gravity_kernel"):  # fmt: skip
        found.append(getattr(catenary, name)(**CALLS[name]))
    plant = catenary.MujocoPlant(ARM, start=Q)
    plant.home()
    plant.state_command("enable")
    found.append(catenary.run_loop(**CALLS["run_loop"] | {"plant": plant}))
    assert [one for one in map(repr, found) if len(one) > 600] == []
    screens = [one for one in found if isinstance(one, OnScreen)]
    assert all(any(isinstance(one, kind) for one in screens) for kind in OnScreen.__subclasses__())
    for one in screens:
        name, html = type(one).__name__, one._repr_html_()
        assert re.fullmatch(rf"<{name} .{{1,130}}>", repr(one))
        assert len(html) < 20_000
        assert f"<b>{name}</b>" in html
        assert HELD.get(name, "<table>") in html
        assert "<script>" not in html
        assert one.to_latex().count(r"\begin{tabular}") == one.to_latex().count(r"\bottomrule")
    assert "bmatrix" in catenary.compact_regressor(ARM)._repr_html_()
