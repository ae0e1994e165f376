"""Figure 2 of the gravity-regressor paper: from the full Z and s to the compact form, for the paper's arm and others.

The full form has 3 n (n + 1) columns: for every joint, what it carries along the axes of the base and of every frame.
Zero parameters are deleted with their columns; equal ones are merged, their columns added. Zero and equal mean so as
formulas in unknown masses, never as numbers. Beyond the paper: prismatic joints, each with a column for the mass that
it carries; trees; coordinates that move several joints; parameters that load no joint under any gravity go too.

The forms are compared at 20 random configurations under random gravity, with random masses. Lengths are the file's. How
long either takes to evaluate is measured where all joints turn, both traced as straight lines and compiled alike, zeros
of the full one included, so that they differ by their operations alone; times are of the machine that it ran on.
"""

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from catenary import RobotModel, compact_regressor, gravity_regressor
from catenary.arrays import Floats
from catenary.dynamics.recursion import Vector, cross, dot, put, row, times, transpose_times
from catenary.dynamics.symbolic import new_terms, placed
from catenary.kernels.kernel import Kernel
from catenary.kernels.tracing import Line
from catenary.robots.catalog import load_robot, robot_names
from papers.experiment import Case, Experiment, Judgement, Outcomes, Report, Result, Scope, TitledTable, run
from papers.figures import panels
from papers.kit import Missing, by_count, filled, table
from papers.regressor.decomposition import NO_EFFECT, ZERO, decomposition
from papers.regressor.published import COMPACT, FULL_BLOCK, PARAMETERS, PLACES

CALLS = 200  # timed together: a call takes about as long as reading the clock
PLANAR = "planar_3r"
DRAWN = (PLANAR, "dual_arm_19")
FRAMES = ("base", "frame 1", "frame 2", "frame 3")
REPEATS = 50  # of a timed batch
SAME = 1e-9  # [Nm] beyond rounding


def full_line(model: RobotModel) -> Line:
    """Trace the paper's full Z (n, 3 n (n + 1)), row by row, of an arm whose joints all turn; inputs q and gravity.

    A first moment e, along an axis of any frame, asks z . (gravity x e) = e . (z x gravity) of a joint with axis z: so
    z x gravity is turned from the joint's frame to the base, and from there to every frame.
    """
    p = placed(model)
    parents = [int(parent) for parent in p.tree.parent]
    n, m = len(model.tree.parent), len(parents)
    width = 3 * (n + 1)
    g = p.trace.inputs("gravity", 3)
    link_gravity = new_terms(m + 1, 3)
    put(link_gravity, m, (g[0], g[1], g[2]))
    for i, parent in enumerate(parents):
        put(link_gravity, i, transpose_times(p.rotation, i, row(link_gravity, parent)))
    Z = np.full((model.n, n * width), 0.0, dtype=object)
    for k in range(n):
        link = 2 * k + 1  # a joint is two of these links: one stands turned, the other turns
        pull = cross(row(p.tree.axis, link), row(link_gravity, link))
        while link >= 0:
            pull = times(p.rotation, link, pull)
            link = parents[link]
        seen: list[Vector] = []
        for i, parent in enumerate(parents):
            seen.append(transpose_times(p.rotation, i, pull if parent < 0 else seen[parent]))
        block = list(pull)
        for j in range(n):
            block += [dot(row(p.turn[j], along), seen[2 * j + 1]) for along in range(3)]
        for r in np.flatnonzero(model.coupling[k]):
            for c, effort in enumerate(block):
                Z[r, width * k + c] = effort * float(model.coupling[k, r])
    return p.trace.line(list(Z.ravel()))


def full_kernel(model: RobotModel) -> Kernel:
    """Return the compiled full Z of an arm whose joints all turn."""
    n = len(model.tree.parent)
    return Kernel(f"{model.name.replace('_', '-')}-full-regressor", full_line(model), (model.n, 3 * n * (n + 1)))


def medians(calls: list[Callable[[], object]], repeats: int) -> Floats:
    """Return the median time of each call [s], measured in turns."""
    taken = np.empty((repeats, len(calls)))
    for k in range(repeats):
        for c, call in enumerate(calls):
            begin = time.perf_counter()
            for _ in range(CALLS):
                call()
            taken[k, c] = (time.perf_counter() - begin) / CALLS
    result: Floats = np.median(taken, axis=0)
    return result


@run(revision=1)
def evaluation(robot: str, repeats: int) -> Result:
    """Time both forms of a robot's regressor; return microseconds of each, and full over compact."""
    model = load_robot(robot)
    compact = compact_regressor(model)
    full = full_kernel(compact.model)
    rng = np.random.default_rng(0)
    q, gravity = rng.normal(size=model.n), rng.normal(size=3)
    outs = np.empty(full.shape), np.empty((model.n, len(compact.labels)))
    taken = medians([full.bind(q, gravity, outs[0]), compact.kernel().bind(q, gravity, outs[1])], repeats)
    difference = np.abs(outs[0] - gravity_regressor(model, q, gravity)).max()
    return {
        "full_us": float(1e6 * taken[0]),
        "compact_us": float(1e6 * taken[1]),
        "ratio": float(taken[0] / taken[1]),
        "difference": float(difference),
    }


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot of the catalogue."""
    names = [PLANAR, "raven2"] if scope.quick else sorted(robot_names(), key=lambda name: name != PLANAR)
    turning = [name for name in names if not load_robot(name).tree.prismatic.any()]
    return [
        *(decomposition.case(robot=name) for name in names),
        *(evaluation.case(robot=name, repeats=2 if scope.quick else REPEATS) for name in turning),
    ]


def of(o: Outcomes, robot: str) -> Result:
    """Return a robot's result."""
    for result in o.of(decomposition, robot=robot):
        return result
    raise Missing(robot)


def report(o: Outcomes) -> Report:
    """Return the planar arm's steps as the paper prints them, and every robot's counts."""
    timed = [
        [args["robot"], *(f"{result[key]:.2f}" for key in ("full_us", "compact_us", "ratio"))]
        for args, result in o.items(evaluation)
    ]
    tables = _planar(of(o, PLANAR)) if o.of(decomposition, robot=PLANAR) else []
    tables += [
        table(
            "Every robot of the catalogue",
            "robot | full Z | zero | no effect | merged | difference [Nm]",
            [_counts(args["robot"], result) for args, result in o.items(decomposition)],
        ),
        table(
            "Time of an evaluation, both forms compiled alike, median, on the machine that it ran on",
            "robot | full Z [us] | compact Z [us] | full over compact",
            timed,
        ),
    ]
    caption = "the entries of Z before and after; a colour is a merged parameter, grey what is deleted"
    drawn = [(robot, result) for robot in DRAWN for result in o.of(decomposition, robot=robot)]
    return Report(filled(tables), {f"{robot}: {caption}": _picture(result) for robot, result in drawn})


def _planar(planar: Result) -> list[TitledTable]:
    frames = ["joint", *(f"{frame}, {axis}" for frame in FRAMES for axis in "xyz")]
    blocks = [[str(k), *block] for k, block in enumerate(planar["blocks"], 1)]
    compact = [
        [f"s{k}", ", ".join(row[k - 1] for row in planar["entries"]), label]
        for k, label in enumerate(planar["parameters"], 1)
    ]
    return [
        table("The planar arm: block row of joint k in the full Z, in units of g", frames, blocks),
        table(
            "Its 36 parameters: what is deleted, what is merged", "entry of s | what | formula | step", _steps(planar)
        ),
        table("Its compact form: columns of Z and parameters, g = g_c Z s", " | column of Z | formula", compact),
    ]


def _steps(planar: Result) -> list[list[str]]:
    content = []
    for number, group in enumerate(planar["groups"]):
        if group != ZERO:
            joint, place = divmod(number, 3 * (planar["joints"] + 1))
            text = f"merged into s{group}" if group > 0 else "deleted: no joint feels it"
            where = f"carried by joint {joint + 1}, along {'xyz'[place % 3]} of {FRAMES[place // 3]}"
            content.append([str(number + 1), where, planar["s"][number], text])
    deleted = planar["groups"].count(ZERO)
    return [*content, [f"the {deleted} others", "", "0", "deleted with their columns"]]


def _counts(robot: str, result: Result) -> list[str]:
    groups, (coordinates, width) = result["groups"], result["shape"]
    merged = sum(group > 0 for group in groups)
    return [
        *(robot, f"{coordinates} x {width}", str(groups.count(ZERO)), str(groups.count(NO_EFFECT))),
        *(f"{merged} to {len(result['parameters'])}", f"{result['largest_difference_Nm']:.0e}"),
    ]


def _picture(result: Result) -> Any:
    before, after = patterns(result)
    rows = before.shape[0]
    figure, axes = panels(
        2, 1.7 + 0.1 * rows, width_ratios=(3, 1) if rows > 3 else (6, 1), gridspec_kw={"wspace": 0.05}
    )
    colors = _colors(len(result["parameters"]))
    for axis, pattern, title in zip(axes, (before, after), ("full Z", "compact Z"), strict=True):
        axis.imshow(pattern, aspect="auto", cmap=colors, vmin=-1.5, interpolation="nearest",
                    vmax=len(result["parameters"]) + 0.5)  # fmt: skip
        axis.set_title(f"{title}: {pattern.shape[0]} x {pattern.shape[1]}", fontsize=10)
        axis.set_yticks([0, rows - 1], ["1", str(rows)], fontsize=8)
        axis.set_xlabel("column")
        axis.set_xticks([0, pattern.shape[1] - 1], ["1", str(pattern.shape[1])], fontsize=8)
    axes[0].set_ylabel("row")
    if rows <= 3:
        _write(axes[0], list(result["blocks"]), before)
        _write(axes[1], result["entries"], after)
    return figure


def _write(axes: Any, texts: Sequence[Sequence[str]], pattern: Floats) -> None:
    """Write entries into their cells; a full Z's rows are given as blocks."""
    for line, entries in enumerate(texts):
        first = line * len(entries) if pattern.shape[1] > len(entries) else 0
        for k, text in enumerate(entries):
            if text != "0":
                axes.text(first + k, line, text, ha="center", va="center", fontsize=6, rotation=90)


def _colors(count: int) -> Any:
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    hues = colormaps["turbo"](np.linspace(0.08, 0.92, count) if count > 1 else [0.3])
    pale = 0.55 * hues[:, :3] + 0.45
    return ListedColormap([(0.72, 0.74, 0.78), (1.0, 1.0, 1.0), *map(tuple, pale)])


def patterns(result: Result) -> tuple[Floats, Floats]:
    """Return the entries of the full and the compact Z as numbers: 0 zero, -1 deleted, else the parameter's number."""
    coordinates, width = result["shape"]
    before = np.zeros((coordinates, width))
    joints = result["joints"]
    block = 3 * (joints + 1)
    for column, (group, used) in enumerate(zip(result["groups"], result["columns_used"], strict=True)):
        if not used:
            continue
        in_block = column < block * joints
        rows = result["rows"][column // block] if in_block else range(coordinates)
        before[rows, column] = group if group > 0 else -1
    after = np.array(result["compact_rows"]) * np.arange(1, len(result["parameters"]) + 1)
    return before, after.astype(float)


EXPERIMENT = Experiment(
    "regressor-figure-2", "figure 2", "From the full gravity regressor to the compact one", __doc__,
    cases, report, minutes=1.0, drawn=0,
)  # fmt: skip


@EXPERIMENT.claim(
    "The full Z and s of the planar arm",
    "figure 2",
    "Z_k: 1 0 0 c1 -s1 0 c12 -s12 0 c123 -s123 0; s1 once, s2 twice, s3 three times",
    "every entry of the three block rows as printed, and each parameter where the figure has it",
)
def _is_full(o: Outcomes) -> Judgement:
    planar = of(o, PLANAR)
    same = [tuple(block) == FULL_BLOCK for block in planar["blocks"]]
    places = {number: tuple(k for k, group in enumerate(planar["groups"]) if group == number) for number in (1, 2, 3)}
    text = f"blocks {' '.join(planar['blocks'][0])}; s1, s2, s3 at {', '.join(str(p) for p in places.values())}"
    return by_count([*same, tuple(places.values()) == PLACES], text)


@EXPERIMENT.claim(
    "Its compact form",
    "figure 2, section II-C",
    "g = g_c Z s with Z = [c1 c12 c123; 0 c12 c123; 0 0 c123], s = [l1 (m2+m3)+lg1 m1; l2 m3+lg2 m2; lg3 m3]",
    "every entry and every parameter as printed",
)
def _is_compact(o: Outcomes) -> Judgement:
    planar = of(o, PLANAR)
    entries = [tuple(row) for row in planar["entries"]] == list(COMPACT)
    return by_count(
        [entries, tuple(planar["parameters"]) == PARAMETERS],
        "Z " + "; ".join(" ".join(row) for row in planar["entries"]) + ", s " + ", ".join(planar["parameters"]),
    )


@EXPERIMENT.claim(
    "The full regressor is n x 3n(n+1)",
    "section II-A",
    "n x 3n(n+1)",
    "for every robot of the catalogue whose joints all turn, n the joints of its tree",
)
def _size(o: Outcomes) -> Judgement:
    of_turning = [
        (args["robot"], result["shape"][1], result["joints"])
        for args, result in o.items(decomposition)
        if result["prismatic"] == 0
    ]
    text = ", ".join(f"{robot} {width}" for robot, width, _ in of_turning)
    return by_count([width == 3 * n * (n + 1) for _, width, n in of_turning], f"columns: {text}")


@EXPERIMENT.claim(
    "The generalised form holds regardless of dimension and structure of the robot",
    "abstract, section II-B",
    "any robot of revolute joints, multi-arms included",
    "full and compact form give the same torques to 1e-9 Nm, for every robot of the catalogue",
)
def _any_robot(o: Outcomes) -> Judgement:
    worst = [result["largest_difference_Nm"] for result in o.of(decomposition)]
    return by_count([each < SAME for each in worst], f"at most {max(worst, default=0.0):.0e} Nm")


@EXPERIMENT.claim(
    "Deleting and merging reduces the computation time",
    "section II-C",
    "36 columns to 3; of time no number",
    "the full Z takes longer to evaluate than the compact one, both compiled alike, medians in one process, for every "
    "robot of the catalogue whose joints all turn; same direction: for more than half of them",
)
def _faster(o: Outcomes) -> Judgement:
    widths = [(result["shape"][1], len(result["parameters"])) for result in o.of(decomposition)]
    ratios = {args["robot"]: result["ratio"] for args, result in o.items(evaluation)}
    shares = [after / before for before, after in widths]
    text = (
        f"full over compact: {', '.join(f'{robot} {ratio:.1f}' for robot, ratio in ratios.items())}; of the columns "
        f"{100 * min(shares):.0f} to {100 * max(shares):.0f} % are left"
    )
    return by_count([ratio > 1.0 for ratio in ratios.values()], text)
