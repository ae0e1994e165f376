"""What objects of the public door show of themselves, in the real kernel of a notebook."""

import base64
import io
import re
import shutil
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient
from PIL import Image

import catenary
from notebooks import BESIDE, EXAMPLES, notebook_of
from test_arguments import CALLS, LOG, MODEL, OBJECTS, STATE

PLOT = 'import catenary\ncatenary.plot(catenary.load_robot("two_link"))'
SHOWN = {
    'arm = catenary.load_robot("two_link")\narm': ("RobotModel", "<table>"),
    "catenary.compact_regressor(arm)": ("CompactRegressor", "bmatrix"),
    'catenary.export_function(arm, "gravity", "sympy")': ("SymbolicFunction", "sin"),
    "import numpy as np\nt = np.linspace(0.0, 60.0, 6000)\nq = np.column_stack([np.sin(t), np.cos(1.7 * t)])\n"
    'log = catenary.MotionLog("monday", arm.joint_names, ("rad", "rad"), q, np.ones(6000, bool), q + 0.01 * q**2, t)\n'
    "log": ("MotionLog", "monday"),
    'model = catenary.fit(log, model="linear")\nmodel': ("Calibration", "in intervals [% of rows]"),
    "model.evaluate(log)": ("Evaluation", "of the fixed offset"),
    "from dataclasses import replace\nv, a = np.gradient(q, t, axis=0), np.gradient(np.gradient(q, t, axis=0), t, axis=0)\n"
    "down = (0.0, 0.0, -9.81)\n"
    "moving = replace(log, qd=v, tau=catenary.inverse_dynamics(arm, q, v, a, down))\n"
    "catenary.identify([moving], arm)": ("Identification", "std / value"),
    "plant = catenary.MujocoPlant(arm, start=q[0])\nplant.home()\nplant.state_command('enable')\n"
    "way = catenary.go_to(q[0], q[0] + 0.1, max_velocity=[1.0] * 2, max_acceleration=[1.0] * 2)\n"
    "hold = catenary.GravityPD(arm, kp=[100.0] * 2, kd=[1.0] * 2, gravity=down)\n"
    "catenary.run_loop(plant, hold, way, limits=catenary.TorqueLimits([50.0] * 2))": ("LoopReport", "RMS error"),
}


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


def test_a_figure_shows_in_the_first_cell_and_everything_else_as_a_screen(tmp_path):
    cells = [nbformat.v4.new_code_cell(source) for source in (PLOT, *SHOWN)]
    first, *others = executed(nbformat.v4.new_notebook(cells=cells), tmp_path)
    assert 0.01 < darkness(first[-1]) < 0.9  # not empty
    for outputs, (name, held) in zip(others, SHOWN.values(), strict=True):
        data = outputs[-1].data
        assert held in data["text/html"]
        assert f"<b>{name}</b>" in data["text/html"]
        assert len(data["text/html"]) < 20_000
        assert re.fullmatch(rf"<{name} .{{1,130}}>", data["text/plain"])


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


def public_results() -> dict[str, object]:
    found = {type(one).__name__: one for one in (*OBJECTS, STATE)}
    for name in ("compact_regressor", "export_function", "fit", "evaluate", "check_data", "load_robot", "lock_joints",
                 "fit_wrist_tool", "locate_load", "forward_kinematics", "gravity_kernel"):  # fmt: skip
        found[name] = getattr(catenary, name)(**CALLS[name])
    return found


def test_what_the_public_door_gives_prints_in_few_characters():
    long = {name: len(repr(one)) for name, one in public_results().items() if len(repr(one)) > 600}
    assert not long


@pytest.mark.parametrize("robot", ["panda", "dual_arm_19", "raven2_full"])
def test_a_robot_of_many_joints_prints_on_a_line_and_its_screen_is_bounded(robot):
    arm = catenary.load_robot(robot)
    for one in (arm, catenary.compact_regressor(arm)) if robot == "panda" else (arm,):
        assert len(repr(one)) < 160
        assert "\n" not in repr(one)
        assert len(one._repr_html_()) < 20_000


def test_a_name_of_a_file_is_no_markup():
    from dataclasses import replace

    assert "<script>" not in replace(LOG, name="<script>")._repr_html_()


def test_tables_are_latex_for_booktabs():
    text = MODEL.evaluate(LOG).to_latex()
    assert text.count(r"\begin{tabular}") == text.count(r"\bottomrule") == 1
    assert r"of fixed offset [\%]" in text
    rows = text.partition(r"\midrule")[2].partition(r"\bottomrule")[0].strip().splitlines()
    assert [row.partition(" & ")[0] for row in rows] == list(LOG.joint_names)
    assert len({row.count("&") for row in rows}) == 1
    assert not re.search(r"(?<!\\)[%#_]", text.replace(r"\\", ""))
