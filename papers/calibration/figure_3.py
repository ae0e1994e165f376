"""Figure 3 of the calibration paper: zig-zags in joint space, seven directions, and sparsities of J2-J3.

No robot moves: these are the paths themselves, corners sharp, in the box J1 20..60, J2 55..110 deg, J3 0.33..0.42 m.
Durations are those of the paths that the calibrations here drive: corners rounded, sparsities one after another, and
the way from one to the next. The speed is the one at which the three alone add up to the paper's 1013 s.

"Sparsity in the direction of a joint" is shown by how evenly the path's rows lie over that joint's range, in fifty
bins: the share of bins with at least half of an even share. The path's volume is that of its convex hull, as a share
of the box. The largest hole is twice the greatest distance from a point of that hull to the path, the box's sides
being of length one.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, Delaunay, KDTree

from catenary import zigzag
from catenary.arrays import Floats
from catenary.trajectories.zigzag import CALIBRATION_LOWER, CALIBRATION_UPPER, DIRECTIONS, Direction, zigzag_rows
from papers.calibration.published import BOX_SHARES, DURATIONS
from papers.calibration.recordings import SPARSITIES
from papers.experiment import Case, Experiment, Judgement, Outcomes, Report, Result, Scope, run
from papers.figures import panels
from papers.kit import IN_UNITS, JOINTS, Missing, as_text, by_count, grid, rounded, table

DENOMINATORS = (2, 3, 4, 5, 6)
COMBINATIONS = ((1 / 2, 1 / 3), SPARSITIES)
DRAWN: tuple[Direction, ...] = ("J1", "J1-J2", "J2-J3", "J1-J2-J3")
PAPERS_CHOICE: Direction = "J2-J3"
BINS = 50
EVEN = 0.5  # of an even share of rows, that a bin needs to count as covered
GRID = 21  # points along each side of the box where holes are looked for
DISPLAYED = np.array([180.0 / np.pi, 180.0 / np.pi, 1e3])  # to deg, deg, mm
# criteria
CENTRE = 0.05  # of the box, from its middle
VOLUME = 0.10  # of the seven directions' median
RANGE = 0.10  # of the published share of a joint's range: the paths end 5 % beyond the cube
SECONDS = 0.05
MINUTES = 0.10
CALIBRATION = (8.0, 21.0)  # [min], the paper's whole calibration, shortest and longest
BESIDE = {"homing": 2.0, "data processing": 1.0, "training": 1.0}  # [min], its limits for what is no recording, II-A
SWEPT, SPARSE = 0.9, 0.5  # evenly covered shares of a joint that is swept, and of one with a sparsity


@run(revision=2)
def path(direction: Direction, sparsities: Sequence[float]) -> Result:
    """Return what a zig-zag covers.

    Returns:
        `seconds`; by joint, of the box: `low` and `high`, `even`, the evenly covered share of its range, and
        `reversals`; `volume` of the convex hull; `hole`, the largest; and `corners` in deg, deg, mm.
    """
    parts = [zigzag_rows(direction, sparsity) for sparsity in sparsities]
    rows = np.concatenate(parts)
    unit = (rows - CALIBRATION_LOWER) / (CALIBRATION_UPPER - CALIBRATION_LOWER)
    return {
        "seconds": round(zigzag(direction, sparsities).duration, 1),
        "low": rounded(unit.min(axis=0), 4),
        "high": rounded(unit.max(axis=0), 4),
        "even": [even_share(column) for column in unit.T],
        "reversals": [sum(reversals(part[:, j]) for part in parts) for j in range(3)],
        "volume": round(float(ConvexHull(unit[corners(unit)]).volume), 4),
        "hole": round(largest_hole(unit), 4),
        "corners": [rounded(corner * DISPLAYED, 2) for part in parts for corner in part[corners(part)]],
    }


def reversals(positions: Floats) -> int:
    """Return how often a joint turns back: positions (N,), moves of less than 1e-9 are rest."""
    steps = np.diff(positions)
    way = np.sign(steps[np.abs(steps) > 1e-9])
    return int(np.count_nonzero(np.diff(way)))


def corners(rows: Floats) -> NDArray[np.int64]:
    """Return the indices of rows (N, 3) where a path of straight lines turns, its ends included."""
    turns = np.abs(np.diff(rows, 2, axis=0)).max(axis=1) > 1e-9
    return np.flatnonzero(np.concatenate([[True], turns, [True]]))


def even_share(positions: Floats) -> float:
    """Return the share of a joint's own range, in fifty bins, that has at least half of an even share of the rows."""
    counts, _ = np.histogram(positions, BINS)
    return float(np.mean(counts >= EVEN * len(positions) / BINS))


def largest_hole(unit: Floats) -> float:
    """Return twice the greatest distance of a point to a path (N, 3) in whose convex hull it lies, on a grid."""
    axis = np.linspace(0.0, 1.0, GRID)
    grid = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    inside = grid[Delaunay(unit[corners(unit)]).find_simplex(grid) >= 0]
    distances, _ = KDTree(unit[::10]).query(inside)
    return 2.0 * float(np.max(distances))


def cases(scope: Scope) -> list[Case]:
    """Return a case for every direction with three sparsities, and for the sparsities of J2-J3; one for a drawing."""
    if scope.quick:
        return [path.case(direction=PAPERS_CHOICE, sparsities=(1 / 2,))]
    single = [(1 / n,) for n in DENOMINATORS]
    return [
        *grid(path, {"direction": DIRECTIONS}, sparsities=SPARSITIES),
        *grid(path, {"direction": DRAWN}, sparsities=(1 / 3,)),
        *grid(path, {"sparsities": (*single, *COMBINATIONS)}, direction=PAPERS_CHOICE),
    ]


def written(sparsities: Sequence[float]) -> str:
    """Return sparsities as the paper writes them, 1/2 + 1/3."""
    return " + ".join(f"1/{round(1.0 / sparsity)}" for sparsity in sparsities)


def of(o: Outcomes, *sparsities: float) -> Result:
    """Return what the zig-zags of J2-J3 at some sparsities cover."""
    for result in o.of(path, direction=PAPERS_CHOICE, sparsities=list(sparsities)):
        return result
    raise Missing(written(sparsities))


def report(o: Outcomes) -> Report:
    """Return the table of paths and the paper's picture."""
    header = ["direction", "sparsity", "time [s]", *(f"reversals {joint}" for joint in JOINTS), *IN_UNITS]
    header += [*(f"even {joint}" for joint in JOINTS), "volume", "largest hole"]
    content = []
    for of_path, result in o.items(path):
        low, high = (
            (CALIBRATION_LOWER + np.array(result[end]) * (CALIBRATION_UPPER - CALIBRATION_LOWER)) * DISPLAYED
            for end in ("low", "high")
        )
        content.append([
            *(of_path["direction"], written(of_path["sparsities"]), f"{result['seconds']:.0f}"),
            *(f"{count}" for count in result["reversals"]),
            *(f"{a:.1f} to {b:.1f}" for a, b in zip(low, high, strict=True)),
            *(f"{100.0 * share:.0f} %" for share in result["even"]),
            *(f"{result['volume']:.3f}", f"{result['hole']:.2f}"),
        ])  # fmt: skip
    paths = table("Time, reversals, range, and evenly covered share of it, by joint", header, content)
    return Report([paths], {"Directions (top), sparsities (bottom)": _picture(o)})


def _picture(o: Outcomes) -> Any:
    shown: list[tuple[Direction, float]] = [(each, 1 / 3) for each in DRAWN]
    shown += [(PAPERS_CHOICE, 1 / n) for n in (2, 3, 4, 6)]
    figure, axes = panels(4, 6.0, rows=2, subplot_kw={"projection": "3d"})
    for number, (panel, (direction, sparsity)) in enumerate(zip(axes, shown, strict=True)):
        results = o.of(path, direction=direction, sparsities=[sparsity])
        title = direction if number < len(DRAWN) else f"{direction}, sparsity {written([sparsity])}"
        panel.set_title(title, fontsize=9)
        low, high = CALIBRATION_LOWER * DISPLAYED, CALIBRATION_UPPER * DISPLAYED
        panel.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        for label, name in zip((panel.set_xlabel, panel.set_ylabel, panel.set_zlabel), IN_UNITS, strict=True):
            label(name, fontsize=8, labelpad=-4)
        panel.locator_params(nbins=3)
        panel.tick_params(labelsize=8, pad=-2)
        panel.set_box_aspect((1.0, 1.0, 1.0), zoom=0.86)
        if results:
            line = np.array(results[0]["corners"])
            panel.plot(*line.T, color="#4b6b94" if number < len(DRAWN) else "#d9622b", linewidth=0.9)
    return figure


def _directions(o: Outcomes) -> dict[str, Result]:
    """Return what each direction covers with three sparsities."""
    results = {args["direction"]: result for args, result in o.items(path, sparsities=list(SPARSITIES))}
    if len(results) < len(DIRECTIONS):
        raise Missing("directions")
    return results


EXPERIMENT = Experiment(
    "calibration-figure-3", "figure 3", "Zig-zags in joint space", __doc__, cases, report, minutes=1.0, drawn=0
)


@EXPERIMENT.claim(
    "All trajectories have the same centre",
    "II-B",
    "equations 4 and 5",
    f"the middle of every joint's range within {100.0 * CENTRE:.0f} % of the box from its middle, for all seven "
    "directions; same direction: for more than half",
)
def _centre(o: Outcomes) -> Judgement:
    middles = {name: (np.array(one["low"]) + np.array(one["high"])) / 2.0 for name, one in _directions(o).items()}
    away = {name: float(np.max(np.abs(middle - 0.5))) for name, middle in middles.items()}
    return by_count([distance <= CENTRE for distance in away.values()], f"from the box's middle: {as_text(away)}")


@EXPERIMENT.claim(
    "All trajectories cover the same volume of the normalised joint space",
    "II-B",
    "equations 4 and 5",
    f"volume of the convex hull within {100.0 * VOLUME:.0f} % of the seven directions' median, for all; same "
    "direction: for more than half",
    "the authors' generator stretches J1-J2-J3 until it fills the range of every joint, which the six others do not",
)
def _volume(o: Outcomes) -> Judgement:
    volumes = {name: one["volume"] for name, one in _directions(o).items()}
    middle = float(np.median(list(volumes.values())))
    return by_count([abs(volume / middle - 1.0) <= VOLUME for volume in volumes.values()], as_text(volumes))


@EXPERIMENT.claim(
    "A single direction has 1/sqrt 3 of a joint's range, a double sqrt 2/sqrt 3, the triple all of it",
    "II-B",
    "0.58, 0.82, 1.00",
    f"the ranges of the joints in the direction's name within {100.0 * RANGE:.0f} %, for all seven; same direction: "
    "for more than half",
)
def _ranges(o: Outcomes) -> Judgement:
    holds, texts = [], []
    for direction, one in _directions(o).items():
        named = direction.split("-")
        shares = (np.array(one["high"]) - one["low"])[[JOINTS.index(joint) for joint in named]]
        holds.append(bool((np.abs(shares / BOX_SHARES[len(named)] - 1.0) <= RANGE).all()))
        texts.append(f"{direction} {' '.join(f'{share:.2f}' for share in shares)}")
    return by_count(holds, f"share of the swept joints' ranges: {', '.join(texts)}")


@EXPERIMENT.claim(
    "There is sparsity across the sweeps only, none along them",
    "II-B, figure 3",
    "-",
    f"of the single directions, at least {100.0 * SWEPT:.0f} % of the swept joint's range is evenly covered, and less "
    f"than {100.0 * SPARSE:.0f} % of the two others'; same direction: more than half of nine",
)
def _sparsity_across(o: Outcomes) -> Judgement:
    even = {joint: dict(zip(JOINTS, _directions(o)[joint]["even"], strict=True)) for joint in JOINTS}
    holds = [
        share >= SWEPT if other == joint else share < SPARSE
        for joint, shares in even.items()
        for other, share in shares.items()
    ]
    texts = [f"{joint}: {', '.join(f'{100.0 * share:.0f} %' for share in of.values())}" for joint, of in even.items()]
    return by_count(holds, f"evenly covered of J1, J2, J3; {'; '.join(texts)}")


@EXPERIMENT.claim(
    "Smaller sparsity covers better and takes longer",
    "II-B, figure 3",
    "-",
    "from 1/2 to 1/6, each takes longer than the one before and has a smaller largest hole; same direction: more than "
    "half of these",
)
def _sparser(o: Outcomes) -> Judgement:
    paths = {n: of(o, 1 / n) for n in DENOMINATORS}
    seconds, holes = ([one[name] for one in paths.values()] for name in ("seconds", "hole"))
    text = ", ".join(f"1/{n} {one['seconds']:.0f} s, {one['hole']:.2f}" for n, one in paths.items())
    return by_count([*(np.diff(seconds) > 0.0), *(np.diff(holes) < 0.0)], f"time and largest hole: {text}")


@EXPERIMENT.claim(
    "Recording takes 209 s at 1/2, 537 s at 1/2 + 1/3, 1013 s at 1/2 + 1/3 + 1/4",
    "II-F",
    "209, 537, 1013 s",
    f"within {100.0 * SECONDS:.0f} %; same direction: two of three",
)
def _seconds(o: Outcomes) -> Judgement:
    times = {sparsities: of(o, *sparsities)["seconds"] for sparsities in DURATIONS}
    holds = [abs(seconds / DURATIONS[each] - 1.0) <= SECONDS for each, seconds in times.items()]
    return by_count(holds, ", ".join(f"{written(each)} {seconds:.0f} s" for each, seconds in times.items()))


@EXPERIMENT.claim(
    "Calibration takes 8 to 21 minutes, of which recording takes 4 to 17",
    "abstract, II-A",
    "8 to 21 minutes: recording 4 to 17, homing below 2, data processing and training below 1 each",
    "recording at 1/2 and at 1/2 + 1/3 + 1/4, to which the paper's limits for all else are added, within "
    f"{100.0 * MINUTES:.0f} % of both ends; data processing is measured nowhere here",
)
def _calibration(o: Outcomes) -> Judgement:
    recording = [of(o, *sparsities)["seconds"] / 60.0 for sparsities in ((1 / 2,), SPARSITIES)]
    whole = [minutes + sum(BESIDE.values()) for minutes in recording]
    holds = [abs(ours / paper - 1.0) <= MINUTES for ours, paper in zip(whole, CALIBRATION, strict=True)]
    text, of_which = (" to ".join(f"{minutes:.1f}" for minutes in each) for each in (whole, recording))
    return by_count(holds, f"{text} min, of which recording {of_which}")
