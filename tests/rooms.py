"""Write the index of rooms and files, docs/rooms.md, from the first lines of their docstrings: `python -m tests.rooms`."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "catenary"
PAGE = ROOT / "docs" / "rooms.md"
HEAD = """---
search:
  exclude: true
---

# Rooms and files

What is in which file, as the file's first line says. Made by `python -m tests.rooms`; [architecture](architecture.md)
shows how the rooms hang together.
"""


def first_line(path: Path) -> str:
    """Return the first line of a module's docstring, as Markdown."""
    text = (ast.get_docstring(ast.parse(path.read_text())) or "").split("\n", 1)[0]
    return text.replace("|", "\\|").replace("<", "\\<")


def page() -> str:
    """Return the page."""
    parts = [HEAD]
    rooms = sorted(path.parent for path in PACKAGE.glob("*/__init__.py"))
    for room in [PACKAGE, *rooms]:
        files = sorted(path for path in (room.glob if room == PACKAGE else room.rglob)("*.py"))
        name = "The package itself" if room == PACKAGE else room.name
        rows = [
            f"| `{path.relative_to(room).with_suffix('')}` | {first_line(path)} |"
            for path in files
            if path.stem != "__init__"
        ]
        parts.append(
            "\n".join(
                [
                    "",
                    f"## {name}",
                    "",
                    first_line(room / "__init__.py"),
                    "",
                    "| file | what is in it |",
                    "|---|---|",
                    *rows,
                    "",
                ]
            )
        )
    return "".join([*parts, "\n**Read next:** [dynamics](dynamics.md), the recursions.\n"])


if __name__ == "__main__":
    PAGE.write_text(page())
