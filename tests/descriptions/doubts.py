"""python -m tests.descriptions.doubts FOLDER...: what is doubted in each public robot below some folders.

Prints a table of docs/public-robots.md: one file a robot (a folder that holds descriptions below it), with its joints,
its moving mass, whether it states friction or rotors, and what `catenary check` doubts. URDFs, and MJCFs called
robot.xml.
"""

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

from catenary.errors import CatenaryError
from catenary.gravity.mass_plausibility import mass_doubts
from catenary.robots.actuation import joint_drives
from catenary.robots.catalog import load_robot

SHOWN = 2  # doubts of a robot
LONGEST = 220  # characters of one
FOLDERS = ("urdf", "robots", "srdf")  # that are no robot's name


def robots(folder: Path) -> dict[str, Path]:
    """Return the first description of every robot below a folder."""
    found: dict[str, Path] = {}
    for path in sorted([*folder.rglob("*.urdf"), *folder.rglob("robot.xml")]):
        names = [part for part in path.relative_to(folder).parts[:-1] if part not in FOLDERS]
        found.setdefault(names[-1] if names else path.stem, path)
    return found


def row(path: Path) -> tuple[str, bool]:
    """Return a robot's row, and whether anything is doubted or refused."""
    name = f"{path.parent.name}/{path.name}" if path.name == "robot.xml" else path.name
    try:
        model = load_robot(path)
    except CatenaryError as error:
        why = " ".join(str(error).replace(str(path), "").strip(": ").split())
        return f"| {name} | - | - | - | refused: {_short(why)} |", True
    drives = None if model.actuation is None else joint_drives(model.actuation, model.n)
    stated = [
        word
        for word, values in zip(("friction", "damping", "rotors"), drives[:3] if drives else (), strict=False)
        if values.any()
    ]
    doubts = [*([f"no mass of {', '.join(model.missing_inertia)}"] if model.missing_inertia else []), *model.doubts]
    doubts += mass_doubts(model)
    said = "; ".join(_short(doubt) for doubt in doubts[:SHOWN])
    said += f"; and {len(doubts) - SHOWN} more" if len(doubts) > SHOWN else ""
    mass = f"{model.tree.mass.sum():.3g}"
    return f"| {name} | {model.n} | {mass} | {', '.join(stated) or '-'} | {said or '-'} |", bool(doubts)


def _short(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    made = argparse.ArgumentParser(prog="python -m tests.descriptions.doubts", description=__doc__)
    made.add_argument("folders", type=Path, nargs="+")
    told = made.parse_args(arguments)
    logging.getLogger("catenary").setLevel(logging.ERROR)  # doubts are in the table
    rows = [row(path) for folder in told.folders for path in robots(folder).values()]
    print(f"{len(rows)} robots, {sum(doubted for _, doubted in rows)} of them doubted or refused.\n")
    print("| file | joints | moving mass kg | states | doubted |\n|---|---|---|---|---|")
    print("\n".join(text for text, _ in rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
