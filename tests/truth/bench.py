"""Spoilt recordings through the public commands: what they claim beside what is true, which they never saw.

A fit claims two errors of each joint: between what it lies where training rows lay, and what it is at most from there to
the edge of the valid range; and between what its intervals' coverage lies, over all rows. Where rows lay is seen from
the recordings alone: as near to them, in reported positions and torques, as a fifth of them lies to the other four.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from typer.testing import CliRunner

from catenary.calibration.model_file import load_model
from catenary.cli.main import app
from catenary.errors import CatenaryError, DataError
from catenary.plant import MotionLog
from catenary.recording.import_formats.tracked_pose import deviations
from catenary.recording.logs import write_parquet
from catenary.units import DISPLAY
from tests.truth.recordings import Known
from tests.truth.spoilings import NOTHING, Spoiling

CLOSE = 0.15  # share by which a claim may miss the truth
CLOSE_COVERAGE = 0.05
VAGUE, VAGUE_COVERAGE = 2.0, 0.3  # largest over smallest, and widest range: a claim beyond that says nothing
VAGUE_PROMISE = 4.0  # of two minutes
FEW = 0.05  # share of rows in the margin below which no claim is made there
LEAST = 0.02  # [deg, mm] errors below which nobody cares about 15 per cent
WORSE = 1.05  # times the error before, that a refresh may leave
HOLDS, REFUSED, NAMED, FAILS = "holds", "refused", "named", "FAILS"


@dataclass(frozen=True)
class Outcome:
    """What became of one case: the joint that the claim misses most."""

    case: str
    claimed: str
    true: str
    verdict: str

    @property
    def failed(self) -> bool:
        """Whether a wrong claim was made, or good data were refused."""
        return self.verdict.startswith(FAILS)


def run(*arguments: str | Path) -> tuple[dict[str, Any] | None, str]:
    """Run a command that prints JSON; return that, or None and what it said in refusing."""
    result = CliRunner().invoke(app, [*map(str, arguments), "--json"])
    if isinstance(result.exception, CatenaryError):
        return None, str(result.exception)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    text = result.stdout
    return json.loads(text), text + result.stderr


def written(logs: Sequence[MotionLog], folder: Path) -> list[Path]:
    """Write recordings to files."""
    paths = [folder / f"{log.name}.parquet" for log in logs]
    for log, path in zip(logs, paths, strict=True):
        write_parquet(log, path)
    return paths


def reported(logs: Sequence[MotionLog]) -> np.ndarray:
    """Return what a robot reports on measured rows, positions and torques beside each other."""
    return np.concatenate([np.hstack([log.q_nominal, *([] if log.tau is None else [log.tau])])[log.ok] for log in logs])


def near(trained: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Return which rows (M,) lie no farther from training rows than nineteen of twenty of a fifth do from the rest."""
    from scipy.spatial import KDTree

    spread = np.maximum(trained.std(axis=0), 1e-9)
    fifths = np.array_split(trained / spread, 5)
    apart = [KDTree(np.concatenate(fifths[:k] + fifths[k + 1 :])).query(fifths[k])[0] for k in range(5)]
    found: np.ndarray = KDTree(trained / spread).query(asked / spread)[0] <= np.quantile(np.concatenate(apart), 0.95)
    return found


def true_errors(
    model_file: Path, logs: Sequence[MotionLog], rows: np.ndarray | slice = slice(None), own: str | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return a model's RMS error on measured rows by joint [deg|mm], and the share that its intervals hold."""
    model, _ = load_model(model_file, own)
    errors, held = [], []
    for log in (model.matched(each) for each in logs):
        assert log.q_encoder is not None
        error = (log.q_encoder - model.calibrate(log))[log.ok]
        errors.append(error * [DISPLAY[unit][1] for unit in log.joint_units])
        if model.intervals is not None:
            held.append(np.abs(error) <= model.half_widths(log)[log.ok])
    rms: np.ndarray = np.sqrt(np.mean(np.concatenate(errors)[rows] ** 2, axis=0))
    return rms, np.mean(np.concatenate(held), axis=0) if held else np.full(len(rms), np.nan)


@dataclass(frozen=True)
class Claims:
    """What is stated of n joints' errors [deg|mm], and of coverage: between two numbers each, often the same one."""

    low: np.ndarray
    high: np.ndarray
    held_low: np.ndarray | None = None
    held_high: np.ndarray | None = None


def judged(
    claims: Claims, true: np.ndarray, found: np.ndarray | None = None, *, vague: float = VAGUE
) -> tuple[str, str, bool]:
    """Return a claim and the truth of the joint where they lie farthest apart, and whether all hold."""
    outside = np.maximum(np.maximum(claims.low - true, true - claims.high), 0.0)
    apart = outside / np.maximum(true, LEAST)
    worst = int(np.argmax(apart + 1e-9 * np.abs(claims.high - true)))
    says, truth = f"q{worst + 1} {_range(claims.low[worst], claims.high[worst], '.3g')}", f"{true[worst]:.3g}"
    held = bool((apart <= CLOSE).all() and (claims.high <= vague * np.maximum(claims.low, LEAST)).all())
    if claims.held_low is not None and claims.held_high is not None and found is not None:
        outside = np.maximum(np.maximum(claims.held_low - found, found - claims.held_high), 0.0)
        least = int(np.argmax(outside + 1e-9 * np.abs(found - claims.held_low)))
        says = f"{says}; {_range(claims.held_low[least], claims.held_high[least], '.0%')}"
        truth = f"{truth}; q{least + 1} {found[least]:.0%}"
        held = held and bool((outside <= CLOSE_COVERAGE).all())
        most = VAGUE_COVERAGE if np.isfinite(vague) else 1.0
        held = held and bool((claims.held_high - claims.held_low <= most).all())
    return says, truth, held


def _range(low: float, high: float, form: str) -> str:
    return f"{low:{form}}" if low == high else f"{low:{form}} to {high:{form}}"


def fitted(known: Known, spoiling: Spoiling, folder: Path, kind: str = "polynomial") -> Outcome:
    """Fit a model to spoilt recordings; hold what it claims of itself against unspoilt ones."""
    case = f"fit: {known.name}: {spoiling.name}"
    if kind != "polynomial":
        case = f"fit: {known.name}, {kind}: {spoiling.name}, other kinds"
    paths = written([spoiling.spoil(log) for log in known.logs], folder)
    out = folder / "model.npz"
    robot = ("--robot", known.robot) if known.robot else ()
    found, said = run("fit", *paths, *robot, "--model", kind, "--out", out)
    if found is None:
        wrong = spoiling is NOTHING
        return Outcome(case, said.splitlines()[0], "", f"{FAILS}: refused" if wrong else REFUSED)
    joints = found["cross_validation"]
    columns = [[joint[name] for joint in joints] for name in ("rmse_low", "rmse_high", "held_low", "held_high")]
    low, high, *shares = (np.array(column, dtype=float) for column in columns)
    claims = Claims(low, high) if None in columns[2] else Claims(low, high, *shares)
    there = near(reported(known.logs), reported(known.again))
    own = kind if ":" in kind else None
    coverage = true_errors(out, known.again, own=own)[1]
    # of zeros that differ by recordings a claim is between what holds when that of a new one is known, and before
    vague = np.inf if any("zeros of recordings differ" in note for note in found["notes"]) else VAGUE
    says, truth, held = judged(claims, true_errors(out, known.again, there, own)[0], coverage, vague=vague)
    if np.mean(~there) > FEW:
        margin = np.array([joint["rmse_margin"] for joint in joints])
        beyond = true_errors(out, known.again, ~there, own)[0]
        worst = int(np.argmax(beyond / margin))
        says, truth = f"{says}; margin q{worst + 1} {margin[worst]:.3g}", f"{truth}; {beyond[worst]:.3g}"
        held = held and bool((beyond <= (1.0 + CLOSE) * margin).all())
    named = any(word in note for word in spoiling.named_by for note in found["notes"])
    return Outcome(case, says, truth, HOLDS if held else NAMED if named else FAILS)


OWN = ("sklearn.linear_model:Ridge", "sklearn.ensemble:HistGradientBoostingRegressor", "tests.truth.bench:by_gravity")


def by_gravity(X: np.ndarray) -> np.ndarray:
    """Return what stiff cables of a RAVEN-II would stretch by [rad, rad, m], of positions and torques (N, 6)."""
    return X[:, 3:6] * [-1e-3, -1e-3, -1e-5]


def evaluated(known: Known, spoiling: Spoiling, folder: Path) -> Outcome:
    """Hold a model of good recordings against spoilt ones; its error there against its error before they were spoilt."""
    case = f"evaluate: {known.name}: {spoiling.name}"
    try:
        model = _model_of(known.logs, folder, "polynomial")
    except DataError as error:
        return Outcome(case, f"no model: {str(error).splitlines()[0]}", "", f"{FAILS}: refused")
    tests = [replace(log, name=f"test-{log.name}") for log in known.again]
    found, said = run("evaluate", model, *written([spoiling.spoil(log) for log in tests], folder))
    if found is None:
        wrong = spoiling is NOTHING
        return Outcome(case, said.splitlines()[0], "", f"{FAILS}: refused" if wrong else REFUSED)
    true, _ = true_errors(model, tests)
    error = np.array([joint["rmse"] for joint in found["joints"]])
    says, truth, held = judged(Claims(error, error), true)
    named = any(word in note for word in spoiling.named_by for note in found["notes"])
    return Outcome(case, says, truth, HOLDS if held else NAMED if named else FAILS)


def cut(log: MotionLog, first: int, last: int, name: str) -> MotionLog:
    """Return some rows of a log."""
    return replace(log.part(first, last), name=name, signals={}, signal_units={}, sha256=None)


def windows(log: MotionLog, seconds: float) -> Iterator[tuple[int, int]]:
    """Yield first and last row of each whole window of time."""
    assert log.time is not None
    edges = np.arange(log.time[0], log.time[-1], seconds)
    rows = [int(row) for row in np.searchsorted(log.time, edges)]
    yield from pairwise(rows)


def checked(known: Known, seconds: float, folder: Path) -> Outcome:
    """Check each window of untouched recordings: none may be refused, or said to have a zero that moves."""
    count, wrong = 0, []
    for log in known.logs:
        for first, last in windows(log, seconds):
            path = written([cut(log, first, last, f"window-{count}")], folder)[0]
            found, said = run("check", path, *(("--robot", known.robot) if known.robot else ()))
            wrongly = [f for f in (found or {}).get("findings", ()) if f["refuses"] or f["name"] in ("jump", "drift")]
            refused = said if found is None else next(map(str, wrongly), None)
            count, wrong = count + 1, wrong + ([f"{first}: {refused}"] if refused else [])
    says = f"{len(wrong)} of {count} refused or doubted" + (f", such as {wrong[0][:160]}" if wrong else "")
    return Outcome(f"check: {known.name}: windows of {seconds / 60:g} min", says, "0", FAILS if wrong else HOLDS)


def refreshed(name: str, train: MotionLog, day: MotionLog, folder: Path, first: int, last: int) -> Outcome:
    """Refresh a model with minutes of another day; hold it against all the others of that day."""
    case = f"refresh: {name}: rows {first} to {last}"
    model, new = _model_of((train,), folder, "linear"), folder / "refreshed.npz"
    path = written([cut(day, first, last, "minutes")], folder)[0]
    found, said = run("refresh", model, path, "--out", new)
    if found is None:
        told = "too local" in said
        return Outcome(case, said.splitlines()[0], "", NAMED if told else f"{FAILS}: refused")
    rest = (
        [part for part in (cut(day, 0, first, "a"), cut(day, last, len(day), "b")) if len(part)]
        if 0 < first
        else [cut(day, last, len(day), "b")]
    )
    before, after = true_errors(model, rest)[0], true_errors(new, rest)[0]
    low, high = (np.array([joint[name] for joint in found["joints"]]) for name in ("rmse_low", "rmse_high"))
    says, truth, held = judged(Claims(low, high), after, vague=VAGUE_PROMISE)
    worst = int(np.argmax(after / np.maximum(before, LEAST)))
    harmed = after[worst] > WORSE * max(before[worst], LEAST)
    told = any("too local" in note for note in found["notes"])
    truth = f"{truth}; q{worst + 1} {before[worst]:.3g} -> {after[worst]:.3g}"
    return Outcome(case, says, truth, FAILS if harmed else HOLDS if held else NAMED if told else FAILS)


# counts a second, and the day at which a clock reads zero; None of one that no computer has
CLOCKS: dict[str, tuple[float, str | None]] = {
    "Unix ms": (1e3, "1970-01-01"), "FILETIME": (1e7, "1601-01-01"), ".NET ticks": (1e7, "0001-01-01"),
    "NTP": (1.0, "1900-01-01"), "Excel": (1 / 86_400, "1899-12-30"), "MATLAB datenum": (1 / 86_400, "-001-12-31"),
    "a counter of 4 kHz": (4e3, None), "a counter of .1 ms": (1e4, None), "ms since a start": (1e3, None),
}  # fmt: skip


def clocked(clock: str, folder: Path) -> Outcome:
    """Import a minute whose time is a clock's; hold its length against the true one. Unknown units are to be asked."""
    case, (count, zero), time = f"clock: {clock}", CLOCKS[clock], np.arange(6000) / 100.0
    since = 20.0 if zero is None else 1.77e9 - float(np.datetime64(zero, "s").astype(np.int64))
    stamps = [round((since + t) * count) for t in time] if count >= 1e3 else ((since + time) * count).tolist()
    rows = [f"{stamp!r},{np.sin(t):.9f},{np.cos(t):.9f}" for stamp, t in zip(stamps, time, strict=True)]
    path = folder / "clock.csv"
    path.write_text("\n".join(["time,q1,q2", *rows]) + "\n")
    found, said = run("import", path, "--map", "q_nominal=q1,q2@rad", "--out", folder / "clock.parquet")
    if found is None:
        return Outcome(case, said.splitlines()[0], "59.99 s", REFUSED if zero is None else f"{FAILS}: refused")
    held = zero is not None and abs(found["seconds"] - time[-1]) < 1e-3
    return Outcome(case, f"{found['seconds']:.6g} s", "59.99 s", HOLDS if held else FAILS)


_MODELS: dict[tuple[str, ...], Path] = {}


def _model_of(logs: Sequence[MotionLog], folder: Path, kind: str) -> Path:
    """Fit a model to good recordings, once."""
    key = (kind, *(log.name for log in logs))
    if key not in _MODELS:
        path = folder / f"{'-'.join(key)}.npz"
        found, said = run("fit", *written(logs, folder), "--model", kind, "--out", path)
        if found is None:
            raise DataError(said, [])
        _MODELS[key] = path
    return _MODELS[key]


def told_together(names: str, log: MotionLog, folder: Path) -> Outcome:
    """Check a recording with several faults: each is named, the gravest first."""
    wanted = names.strip().split(", ")
    found, said = run("check", *written([log], folder))
    seen = dict.fromkeys(each["name"] for each in (found or {}).get("findings", ()))
    told = ", ".join(name for name in seen if name in wanted) if found else said
    return Outcome(f"check: faults together: {names}", told, names, HOLDS if told == names.strip() else FAILS)


def told_of_hours(known: Known, seconds: float, folder: Path) -> Outcome:
    """Import, check and fit a recording of hours: all say one delay, which holds the true one."""
    (path,) = written(known.logs, folder)
    imported, seen, fit = (
        run("import", path, "--out", folder / "imported.parquet")[0],
        run("check", path)[0],
        run("fit", path, "--model", "linear", "--out", folder / "model.npz"),
    )
    assert imported is not None
    assert seen is not None
    says, delay = str(imported["delay"]).partition(";")[0], seen["facts"]["delay"]
    same = says in " ".join([*seen["remarks"], *seen["faults"]]) and says in fit[1]
    held = delay["low"] < seconds < delay["high"] and (delay["sure"] == "certain") == (abs(seconds) > 0.0)
    return Outcome(f"check: {known.name}", says, f"{seconds:g} s", HOLDS if same and held else FAILS)


def tracked(robot: str, seen: tuple[Any, ...], noise: np.ndarray, match: str) -> Outcome:
    """Hold joints from poses near a singularity against the truth: none errs by more than five standard deviations."""
    model, q, found, notes = seen
    ok = np.isfinite(found).all(axis=1)
    times = np.abs(found - q)[ok] / deviations(model, found[ok], None, match, noise)
    says = f"{ok.mean():.0%} of rows ok; {'singularity named' if 'singularity' in notes[0] else 'none named'}"
    case = f"check: poses of {robot} near a singularity, noise {1e3 * noise[0]:g} mm"
    held = times.max() < 5.0 and "too near a singularity" in notes[0]
    return Outcome(case, says, f"at most {times.max():.1f} standard deviations off", HOLDS if held else FAILS)
