"""The joint errors of a real dVRK arm: every model kind of ours, and the peers, on the same held-out rows.

Recordings of a da Vinci PSM, commanded against camera-measured joints (Hwang et al., RA-L 2020): quasi-static poses,
no torque. Trained on the first 80 % of each recording, tested on the rest; `sampled_train` without its camera
failures. The recurrent network takes the four previous commands and the present one of all six joints, the Gaussian
process commands and the step from the previous one.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary import MotionLog
from catenary.arrays import Floats
from catenary.calibration.dataset import calibration_data
from catenary.calibration.evaluate import evaluate
from catenary.calibration.fit_options import PLAY_SHARES, FitOptions
from catenary.calibration.fit_rows import choose_inputs, fit_model
from catenary.calibration.recordings import Recordings
from catenary.recording.logs import read_log
from catenary.units import DISPLAY
from papers.calibration.peers.gaussian_process import fit_gaussian_process
from papers.calibration.peers.recurrent import fit_recurrent
from papers.calibration.peers.rows import Peer, Rows, rows_of_log
from papers.calibration.peers.two_phase import fit_two_phase
from papers.experiment import NOMINAL, Case, Experiment, Outcomes, Report, Result, Scope, run
from papers.figures import legend_below, panels
from papers.kit import by_robot, cells, grid, table

FOLDER = "dvrk_calibration_berkeley"
# camera failures of sampled_train, as the recordings' README bounds them (deg, deg, mm, deg, deg, deg)
SAMPLED_LIMIT = (2.0, 2.0, 5.0, 60.0, 60.0, 70.0)
RECORDINGS: Mapping[str, tuple[float, ...] | None] = {
    "random_train": None,
    "insertion_train": None,
    "peg_transfer_train": None,
    "sampled_train": SAMPLED_LIMIT,
}
JOINTS = ("J1", "J2", "J3", "J4", "J5", "J6")
UNITS = ("deg", "deg", "mm", "deg", "deg", "deg")
HELD_OUT = 0.2
KINDS = {
    "linear": FitOptions(kind="linear"),
    "polynomial": FitOptions(kind="polynomial"),
    "neural, paper": FitOptions(kind="neural", preset="paper"),
    "learned": FitOptions(),
}
RECURRENT, PROCESS, TWO_PHASE = "recurrent (Hwang)", "Gaussian process (Mahler)", "two-phase (Seita)"
PEERS: Mapping[str, Callable[..., Peer]] = {
    RECURRENT: fit_recurrent,
    PROCESS: fit_gaussian_process,
    TWO_PHASE: fit_two_phase,
}


def log_of(recording: str, data: Path) -> MotionLog:
    """Read a recording."""
    return read_log(data / FOLDER / f"{recording}.npz")


def limit_of(recording: str) -> tuple[float, ...] | None:
    """Return the error limits of a recording [deg|mm]: one has camera failures."""
    return RECORDINGS.get(recording)


def variants(kind: str) -> dict[str, FitOptions]:
    """Return a kind of model without memory, and with play states, which the learner has."""
    options = {kind: KINDS[kind]}
    return options if kind == "learned" else options | {f"{kind}, play": replace(KINDS[kind], play=PLAY_SHARES)}


@run(revision=1)
def model_errors(recording: str, kind: str, seed: int, data: Path) -> Result:
    """Fit a kind of ours with and without memory; return RMSE per joint [deg|mm] and the share of rows out of range.

    With them, of the kind `linear`, the raw positions and the fixed offset.
    """
    log = log_of(recording, data)
    results = {}
    for name, options in variants(kind).items():
        chosen = replace(options, seed=seed)
        inputs = choose_inputs(Recordings.of([log]), chosen, held_out=HELD_OUT)
        train, test = calibration_data([log], inputs.features, max_error=_limit(recording)).split_by_time(HELD_OUT)
        joints = evaluate(fit_model(train, inputs, chosen), test).joints
        results[name] = _found([joint.rmse for joint in joints], joints[0].outside_valid_range)
        if name == "linear":
            results["raw"] = _found([joint.raw_rmse for joint in joints])
            results["fixed offset"] = _found([joint.offset_rmse for joint in joints])
    return results


@run(revision=1)
def peer_errors(recording: str, peer: str, seed: int, quick: bool, data: Path) -> Result:
    """Fit a peer to the same rows and test it on the same; return its RMSE per joint [deg|mm]."""
    log = log_of(recording, data)
    rows = rows_of_log(log, ("q",))
    trained, tested = parted(rows, _limit(recording))
    short = {RECURRENT: {"iterations": 100}, PROCESS: {"carried": 100, "chosen": 50}, TWO_PHASE: {"trees": 5}}
    fitted = PEERS[peer](replace(rows, known=trained), seed=seed, **(short[peer] if quick else {}))
    residuals = (rows.error - fitted.correction(rows))[tested] * _shown(log.joint_units)
    return {peer: _found([float(value) for value in np.sqrt(np.mean(residuals**2, axis=0))])}


def parted(rows: Rows, limit: Floats | None) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which rows of a recording a peer is trained on, and on which it is tested: those of the models of ours."""
    usable = rows.known if limit is None else rows.known & (np.abs(rows.error) <= limit).all(axis=1)
    late = np.arange(len(usable)) / len(usable) >= 1.0 - HELD_OUT
    return usable & ~late, usable & late


def _limit(recording: str) -> Floats | None:
    limit = RECORDINGS[recording]
    return None if limit is None else np.array(limit) / _shown(("rad", "rad", "m", "rad", "rad", "rad"))


def _shown(units: Sequence[str]) -> Floats:
    return np.array([DISPLAY[unit][1] for unit in units])


def _found(rmse: Sequence[float], outside: float = 0.0) -> dict[str, object]:
    return {"rmse": [float(value) for value in rmse], "outside": float(outside)}


def cases(scope: Scope) -> list[Case]:
    """Return a case for every recording, kind of model and training."""
    recordings = ("insertion_train",) if scope.quick else tuple(RECORDINGS)
    planned, seeds = [], scope.networks_of(NOMINAL)
    for recording in recordings:
        for kind in ("linear",) if scope.quick else KINDS:
            trained = seeds if kind.startswith("neural") else (0,)
            planned += grid(model_errors, {"seed": trained}, recording=recording, kind=kind)
        planned += grid(peer_errors, {"peer": PEERS, "seed": seeds}, recording=recording, quick=scope.quick)
    return planned


def errors(o: Outcomes, recording: str, what: str = "rmse") -> dict[str, Floats]:
    """Return the RMSE of every model on a recording, (trainings, 6), in the tables' order; or shares `outside`."""
    entries: dict[str, list[Any]] = {}
    for result in (*o.of(model_errors, recording=recording), *o.of(peer_errors, recording=recording)):
        for name, entry in result.items():
            entries.setdefault(name, []).append(entry[what])
    first = [name for name in ("raw", "fixed offset") if name in entries]
    return {name: by_robot(entries[name]) for name in dict.fromkeys([*first, *entries])}


def present(o: Outcomes) -> list[str]:
    """Return the recordings that have results."""
    return [name for name in RECORDINGS if o.of(peer_errors, recording=name)]


def report(o: Outcomes) -> Report:
    """Return a table of all models for each recording, and the picture of the wrist's errors."""
    header = ["model", *(f"{j} {u}" for j, u in zip(JOINTS, UNITS, strict=True)), "outside range"]
    tables = []
    for recording in present(o):
        shares = errors(o, recording, "outside")
        ours = {name for result in o.of(model_errors, recording=recording) for name in result}
        content = [
            [name, *cells(values), f"{100.0 * shares[name].mean():.1f} %" if name in ours else "-"]
            for name, values in errors(o, recording).items()
        ]
        tables.append(table(f"{recording}: RMSE on the last fifth", header, content))
    caption = "RMSE over the fixed offset's, geometric mean over recordings; bars from least to greatest recording"
    return Report(tables, {caption: _picture(o)} if tables else {})


SHOWN = {
    "linear": "#4b6b94",
    "neural, paper": "#d9622b",
    "linear, play": "#7fa3cf",
    "learned": "#2f8f6b",
    RECURRENT: "#8455a8",
    PROCESS: "#c9a227",
    TWO_PHASE: "#8a94a3",
}


def _picture(o: Outcomes) -> Any:
    figure, (panel,) = panels(1, 3.6)
    by_recording = [errors(o, recording) for recording in present(o)]
    for k, (name, color) in enumerate(SHOWN.items()):
        shares = [each[name].mean(axis=0) / each["fixed offset"].mean(axis=0) for each in by_recording if name in each]
        if shares:
            middle = np.exp(np.mean(np.log(shares), axis=0))
            spread = np.abs(np.array([np.min(shares, axis=0), np.max(shares, axis=0)]) - middle)
            places = np.arange(len(JOINTS)) + 0.12 * (k - (len(SHOWN) - 1) / 2)
            panel.bar(places, 100.0 * middle, 0.11, color=color, label=name)
            panel.errorbar(places, 100.0 * middle, 100.0 * spread, fmt="none", ecolor="#1c2430", elinewidth=0.8)
    panel.axhline(100.0, color="#b8bfc9", linewidth=0.8)
    panel.set_xticks(range(len(JOINTS)), JOINTS)
    panel.set_ylabel("RMSE [% of fixed offset]")
    legend_below(figure, panel, columns=4)
    return figure


EXPERIMENT = Experiment(
    "calibration-dvrk", "II-K, on a real arm",
    "Joint errors of a real dVRK arm, ours beside the methods that the paper names", __doc__,
    cases, report, minutes=21.0, drawn=0, simulated=False, needs_data=True,
)  # fmt: skip
