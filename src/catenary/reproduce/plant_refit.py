"""Fit the simulated RAVEN-II's free parameters to the calibration paper's errors, once; then they are frozen.

Targets: table I of Peng et al. for direction J2-J3 (raw, fixed offset, linear), never the network's. Conditions:
box J1 20..60, J2 55..110 deg, J3 0.33..0.42 m; zig-zag J2-J3 at 1/2 + 1/3 + 1/4; test on 20 minutes of independent
random motion; state at 30 Hz, encoders at 100 Hz. Run it with `make refit`; it rewrites simulation/data/raven2.toml and
prints targets, bounds and what was reached.
"""

import json
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from catenary import __version__
from catenary.arrays import Floats
from catenary.calibration.dataset import calibration_data
from catenary.calibration.evaluate import evaluate
from catenary.calibration.fit import FitOptions, choose_inputs, fit
from catenary.jobs.paper_table import TABLE_1
from catenary.jobs.simulated_recording import record_simulated
from catenary.page import Heading, Table, write_page
from catenary.plant import MotionLog
from catenary.simulation.cable_parameters import Cable, CableArm, load_cable_arm
from catenary.simulation.cable_plant import CablePlant
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.trajectories.zigzag import Direction, zigzag

SPARSITIES = (1 / 2, 1 / 3, 1 / 4)
TEST_SECONDS = 1200.0
START = (0.5, 1.5, 0.40)  # where the nominal arm wakes up [rad, rad, m]
SEED = 7
TARGETS = {"raw": TABLE_1["raw"], "offset": TABLE_1["fixed offset"], "linear": TABLE_1["linear"]}


class Free(NamedTuple):
    """One number that is fitted: where it stands, and how far it may go as a factor of where it starts."""

    field: str
    joint: int
    factor: float  # the largest, up or down
    step: float  # of the finite differences, as a share


# ratios and couplings are well determined; run-outs and hysteresis are kept within a factor of 1.5
FREE = (
    *(Free("ratio_error", j, 1.25, 0.02) for j in (0, 1)),
    *(Free("coupling", j, 1.25, 0.02) for j in range(3)),
    *(Free("capstan_runout", j, 1.5, 0.1) for j in range(3)),
    *(Free("pulley_runout", j, 1.5, 0.1) for j in (0, 1)),
    *(Free("hysteresis_width", j, 1.5, 0.1) for j in range(3)),
    *(Free("stiffness", j, 1.5, 0.05) for j in range(3)),
)
PRIOR = 0.15  # weight of staying where the parameters started, against relative errors of the targets


def with_factors(arm: CableArm, factors: Floats) -> CableArm:
    """Give the arm with its free parameters multiplied."""
    values = {name: getattr(arm.cable, name).copy() for name in Cable._fields}
    for free, factor in zip(FREE, factors, strict=True):
        values[free.field][free.joint] *= factor
    return arm._replace(cable=Cable(**values))


def recordings(arm: CableArm, direction: Direction = "J2-J3") -> tuple[MotionLog, MotionLog]:
    """Home the arm, record the calibration motion and the test motion."""
    rng = np.random.default_rng(SEED)
    plant = CablePlant(arm, start=START, substeps=1)
    plant.home()
    train = record_simulated(plant, zigzag(direction, SPARSITIES), "zigzag", rng)
    return train, record_simulated(plant, random_sinusoids(rng, TEST_SECONDS), "random", rng)


def errors(train: MotionLog, test: MotionLog) -> dict[str, Floats]:
    """RMSE on the test motion: raw, after the fixed offset, after the linear model with the paper's 16 inputs."""
    reached: dict[str, Floats] = {}
    for kind in ("offset", "linear"):
        options = FitOptions(kind=kind, inputs=("all",))
        inputs = choose_inputs([train], options)
        model = fit(calibration_data([train], inputs.features), inputs, options)
        joints = evaluate(model, calibration_data([test], inputs.features)).joints
        reached["raw"] = np.array([joint.raw_rmse for joint in joints])
        reached[kind] = np.array([joint.rmse for joint in joints])
    return reached


def refit(arm: CableArm, rounds: int) -> tuple[CableArm, dict[str, Floats], Floats]:
    """Fit the free parameters: bounded least squares on the logarithms of the errors' ratios to the targets."""

    def residual(shifted: Floats) -> Floats:
        logs = shifted - 1.0  # least_squares takes its steps as shares of the variable
        reached = errors(*recordings(with_factors(arm, np.exp(logs))))
        misses = np.concatenate([np.log(reached[key] / np.array(TARGETS[key])) for key in TARGETS])
        print(
            "  " + json.dumps({key: np.round(value, 3).tolist() for key, value in reached.items()}),
            flush=True,
        )
        return np.concatenate([misses, PRIOR * logs])

    bound = np.log([free.factor for free in FREE])
    best = least_squares(
        residual,
        np.ones(len(FREE)),
        bounds=(1.0 - bound, 1.0 + bound),
        diff_step=[free.step for free in FREE],
        x_scale=bound,
        max_nfev=rounds,
    )
    factors: Floats = np.exp(best.x - 1.0)
    fitted = with_factors(arm, factors)
    return fitted, errors(*recordings(fitted)), factors


def write_arm(arm: CableArm, path: Path) -> None:
    """Write the fitted numbers into the data file, leaving everything else as it stands."""
    lines = path.read_text(encoding="utf-8").splitlines()
    table = ""
    for i, line in enumerate(lines):
        if line.startswith("["):
            table = line.strip("[]")
        name = table.removeprefix("cable.")
        if (
            line.startswith("value =")
            and table.startswith("cable.")
            and name in {free.field for free in FREE}
        ):
            numbers = ", ".join(repr(float(f"{value:.6g}")) for value in getattr(arm.cable, name))
            lines[i] = f"value = [{numbers}]"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_refit_page(folder: Path, reached: dict[str, Floats], factors: Floats) -> None:
    """Write plant_refit.html: target against reached, and how far each parameter went."""
    folder.mkdir(parents=True, exist_ok=True)
    errors_table = Table(
        ["RMSE", "J1 [deg]", "paper", "J2 [deg]", "paper", "J3 [mm]", "paper"],
        [
            [key, *(cell for j in range(3) for cell in (f"{reached[key][j]:.3f}", f"{target[j]:.3f}"))]
            for key, target in TARGETS.items()
        ],
    )
    parameters = Table(
        ["parameter", "joint", "factor", "allowed"],
        [
            [free.field, f"J{free.joint + 1}", f"{factor:.3f}", f"{1 / free.factor:.2f} to {free.factor:.2f}"]
            for free, factor in zip(FREE, factors, strict=True)
        ],
    )
    write_page(
        folder / "plant_refit.html",
        "The simulated RAVEN-II: target against reached",
        "Nine targets of Peng et al., table I, direction J2-J3; sixteen free numbers held near where they started.",
        [Heading("Errors"), errors_table, Heading("Parameters"), parameters],
        footer=f"catenary {__version__}",
        simulated=True,
    )


def main(path: Path, rounds: int, folder: Path | None) -> None:
    """Refit and rewrite the data file; write the page into `folder`, if given."""
    fitted, reached, factors = refit(load_cable_arm(path), rounds)
    write_arm(fitted, path)
    if folder is not None:
        write_refit_page(folder, reached, factors)
    for key, target in TARGETS.items():
        shown = ", ".join(
            f"{value:.3f} (paper {wanted})" for value, wanted in zip(reached[key], target, strict=True)
        )
        print(f"{key}: {shown}")
    for free, factor in zip(FREE, factors, strict=True):
        print(f"{free.field}[{free.joint}]: x {factor:.3f} (allowed 1/{free.factor} to {free.factor})")


if __name__ == "__main__":
    arguments = sys.argv[1:]
    main(
        Path(arguments[0]),
        int(arguments[1]) if len(arguments) > 1 else 4,
        Path(arguments[2]) if len(arguments) > 2 else None,
    )
