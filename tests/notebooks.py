"""Make notebooks of the examples and labs: `python -m tests.notebooks FOLDER`; the script stays what is written."""

import ast
import shutil
import sys
from pathlib import Path

import jupytext
import nbformat

EXAMPLES = Path(__file__).parents[1] / "examples"
LABS = EXAMPLES / "labs"
BESIDE = (EXAMPLES / "ur5e.urdf", LABS / "checks.py")  # files that they read


def notebook_of(script: str) -> nbformat.NotebookNode:
    """Return the notebook of a script: its docstring as text, a cell for each paragraph of code."""
    script = script.replace("__file__", '"this notebook"')  # which has none
    tree = ast.parse(script)
    head = tree.body[0]
    notebook = jupytext.reads("\n".join(script.splitlines()[head.end_lineno :]).strip(), fmt="py:light")
    title, _, text = (ast.get_docstring(tree) or "").partition("\n")
    notebook.cells.insert(0, nbformat.v4.new_markdown_cell(f"# {title}\n{text}"))
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return notebook


def main(folder: Path) -> None:
    """Write a notebook of each numbered example."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in sorted([*EXAMPLES.glob("0*.py"), *LABS.glob("[0-9]*.py")]):
        name = path.stem if path.parent == EXAMPLES else f"lab_{path.stem}"
        nbformat.write(notebook_of(path.read_text()), folder / f"{name}.ipynb")
    for path in BESIDE:
        shutil.copy(path, folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
