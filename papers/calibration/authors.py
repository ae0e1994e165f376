"""The authors' own recordings in a simulated robot's place: what a folder of them holds, by its files' names.

Peng et al.'s files have RAVEN-II's 252 columns and the names that their published notebook reads (github
HaonanPeng/RAVEN-2-Feature-Ablation, whose README links the data): `data_record_yz_025.csv` are zig-zags of J2-J3 (axes
x, y, z are J1, J2, J3) at 1/4, `_1` their first repetition, `_hm1` recorded after one homing;
`data_record_rand1200_h3.csv` is random motion in hour 3, `_hm3` after three homings. A folder of files is one session.
A robot is told here by the path of a folder that holds such folders.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np

from catenary import MotionLog
from catenary.errors import InputError
from catenary.recording.import_formats.known_layouts import read_raven
from catenary.trajectories.zigzag import Direction
from papers.calibration.recordings import at_rows

_Found = TypeVar("_Found")
_SPARSITIES = {"05": 2, "03": 3, "025": 4, "02": 5, "016": 6}  # in names, and their denominators
_AXES = {"x": "J1", "y": "J2", "z": "J3"}
_NAME = re.compile(
    r"data_record_(?:(?P<axes>x?y?z?)|rand\d*)(?:_(?P<sparsity>05|03|025|02|016))?"
    r"(?:_(?P<again>\d+))?(?:_h(?P<hour>\d))?(?:_hm(?P<homing>\d))?\.csv"
)


@dataclass
class Folder:
    """Files of one session."""

    path: Path
    zigzags: dict[tuple[Direction, int, int], list[Path]] = field(default_factory=dict)  # denominator, homings before
    hours: dict[int, Path] = field(default_factory=dict)
    homings: dict[int, Path] = field(default_factory=dict)
    random: dict[int, Path] = field(default_factory=dict)  # after zig-zags of that denominator; 0 where none is said

    @property
    def condition(self) -> str:
        """Of six hours: what the arm did, by the folder's name."""
        name = self.path.name
        return "idle" if "idle" in name else "loaded" if "loaded" in name.replace("unloaded", "") else "unloaded"

    def of(self, direction: Direction = "J2-J3", homings: int = 0) -> dict[int, list[Path]]:
        """Return zig-zags of a direction by denominator, the coarsest first."""
        zigzags = {n: paths for (d, n, after), paths in self.zigzags.items() if (d, after) == (direction, homings)}
        return dict(sorted(zigzags.items()))


def folders(root: str) -> list[Folder]:
    """Return the sessions below a folder; refused where there is none."""
    sessions: dict[Path, Folder] = {}
    for path in sorted(Path(root).rglob("data_record_*.csv")):
        match = _NAME.fullmatch(path.name)
        if match is None:
            continue
        one = sessions.setdefault(path.parent, Folder(path.parent))
        n, homing = _SPARSITIES.get(match["sparsity"] or "", 0), int(match["homing"] or 0)
        if match["axes"] and n:
            direction: Direction = "-".join(_AXES[axis] for axis in match["axes"])  # type: ignore[assignment]
            one.zigzags.setdefault((direction, n, homing), []).append(path)
        elif not match["axes"]:
            place, key = (one.homings, homing) if match["homing"] else (one.random, n)
            place, key = (one.hours, int(match["hour"])) if match["hour"] else (place, key)
            place[key] = path
    if not sessions:
        zips = ", ".join(path.name for path in sorted(Path(root).rglob("*.zip"))[:4])
        raise InputError(
            f"{root}: no file is called as the authors' are, data_record_yz_05.csv or data_record_rand1200_h0.csv"
            + (f"; unpack {zips} first" if zips else "")
        )
    return list(sessions.values())


def read(path: Path, columns: Sequence[str] = (), rate: float | None = None) -> MotionLog:
    """Read a file; thinned to about a rate [Hz] where one is given."""
    log = read_raven([path], columns=columns).log
    if rate is None:
        return log
    every = max(1, round(1.0 / (rate * float(np.median(np.diff(np.asarray(log.time)))))))
    return at_rows(log, np.arange(0, len(log), every))


def hours(root: str, condition: str) -> Folder:
    """Return the session of six hours under a condition; refused where there is none, as are those below."""
    matches = (one for one in folders(root) if one.hours and one.condition == condition)
    return _first(matches, f"{root}: no session of six hours, {condition}")


def homed(root: str, seen: int) -> Folder:
    """Return the session of tests after homings, of which training saw `seen`."""
    matches = (one for one in folders(root) if one.homings and bool(one.of(homings=1)) == bool(seen))
    return _first(matches, f"{root}: no session with {seen} homing(s) in training")


def tested(root: str, direction: Direction) -> tuple[Folder, Path]:
    """Return a session with zig-zags of a direction, and the random motion right after."""
    right_after = ((one, [*one.random.values(), one.hours.get(0)][0]) for one in folders(root) if one.of(direction))
    matches = ((one, test) for one, test in right_after if test is not None)
    return _first(matches, f"{root}: no zig-zags of {direction} with a random motion")


def _first(matches: Iterator[_Found], missing: str) -> _Found:
    for one in matches:
        return one
    raise InputError(missing)
