"""Make notebooks of the examples: `python -m tests.notebooks FOLDER`; the script stays the one that is written."""

import ast
import sys
from pathlib import Path

import jupytext
import nbformat

EXAMPLES = Path(__file__).parents[1] / "examples"


def notebook_of(script: str) -> nbformat.NotebookNode:
    """Return the notebook of a script: its docstring as text, a cell for each paragraph of code."""
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
    for path in sorted(EXAMPLES.glob("0*.py")):
        nbformat.write(notebook_of(path.read_text()), folder / f"{path.stem}.ipynb")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
