"""Fit the simulated RAVEN-II to two papers and a recording, once; then its numbers are frozen.

Tools first, to how they follow their setpoints in the recording of 2018; then the arm, to its friction and following
errors there and to the calibration paper's errors (targets.py). What may move, and how far, stands in the data file,
which is rewritten: numbers of origin "fitted" between `least` and `most`. Run it with `make refit`.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.optimize import lsq_linear

from catenary.arrays import Floats
from catenary.simulation.cable_parameters import CableArm, load_cable_arm
from papers.plant.circles import Circles, Followed, drawn_by, followed, read_circles
from papers.plant.evaluation import mean_errors
from papers.plant.targets import TARGETS, Free, free_numbers, shares_of, with_shares

# weight of the middle of a number's range, in shares of it, against relative errors: where the range is two standard
# deviations either side, an error of a tenth weighs as much as one
PRIOR, MIDDLE = 0.4, 0.5
STEP = 0.05  # of the finite differences, in shares of the range
# of relative errors, about one over how well the papers determine them
WEIGHTS = {"raw": 3.0, "fixed offset": 3.0, "linear": 2.0, "polynomial": 1.0}
FRICTION = 5.0  # the same of friction in the recording
FIT_SECONDS = 600.0  # of each test motion
Misses = Callable[[CableArm], Floats]


def fitted(arm: CableArm, free: list[Free], misses: Misses, rounds: int) -> CableArm:
    """Return the arm whose misses are least: Gauss-Newton between the bounds, kept up to date by Broyden's rule."""
    shares = shares_of(arm, free)
    here = misses(arm)
    steps = STEP * np.where(shares > 0.5, -1.0, 1.0)
    jacobian = np.column_stack([(misses(with_shares(arm, free, shares + e)) - here) / e.sum() for e in np.diag(steps)])
    best, damping = arm, PRIOR
    for _ in range(rounds):
        n = len(free)
        system = np.vstack([jacobian, PRIOR * np.eye(n), damping * np.eye(n)])
        target = np.concatenate([-here, PRIOR * (MIDDLE - shares), np.zeros(n)])
        step = lsq_linear(system, target, (-shares - 1e-12, 1.0 - shares + 1e-12)).x
        there = misses(with_shares(arm, free, np.clip(shares + step, 0.0, 1.0)))
        print(f"  {here @ here:.4f} -> {there @ there:.4f}, a step of {np.abs(step).max():.3f}", flush=True)
        jacobian = jacobian + np.outer(there - here - jacobian @ step, step) / (step @ step)
        moved = np.clip(shares + step, 0.0, 1.0)
        if _cost(there, moved) < _cost(here, shares):
            shares, here, damping = moved, there, 0.5 * damping
            best = with_shares(arm, free, shares)
        else:
            damping = 3.0 * max(damping, 0.05)
    return best


def _cost(misses: Floats, shares: Floats) -> float:
    return float(misses @ misses + PRIOR**2 * np.sum((shares - MIDDLE) ** 2))


def tool_misses(circles: Circles, real: Followed) -> Misses:
    """Return how far tools are from the recording's: relative errors of what they miss, and of its correlations."""

    def misses(arm: CableArm) -> Floats:
        here = drawn_by(arm, circles)
        return np.concatenate([np.log(here.error[3:] / real.error[3:]), here.likeness - real.likeness])

    return misses


def arm_misses(circles: Circles, real: Followed) -> Misses:
    """Return how far an arm is from its targets, as logarithms."""

    def misses(arm: CableArm) -> Floats:
        here, errors = drawn_by(arm, circles), mean_errors(arm, FIT_SECONDS)
        print("  " + "; ".join(f"{name} {np.round(values, 3)}" for name, values in errors.items()), flush=True)
        missed = [WEIGHTS[name] * np.log(errors[name] / np.array(TARGETS[name])) for name in TARGETS]
        missed += [FRICTION * np.log(here.friction / real.friction), np.log(here.error[:3] / real.error[:3])]
        return np.concatenate(missed)

    return misses


def write_arm(arm: CableArm, path: Path) -> None:
    """Write the fitted numbers into the data file, leaving everything else as it stands."""
    lines = path.read_text(encoding="utf-8").splitlines()
    written = {(each.table, each.field) for each in free_numbers(arm)}
    table = field = ""
    for i, line in enumerate(lines):
        if line.startswith("["):
            table, _, field = line.strip("[]").partition(".")
        if line.startswith("value =") and (table, field) in written:
            numbers = ", ".join(repr(float(f"{value:.6g}")) for value in getattr(arm, table)[field])
            lines[i] = f"value = [{numbers}]"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def main(path: Path, recording: Path, rounds: int) -> None:
    """Refit, and rewrite the data file."""
    circles, arm = read_circles(recording), load_cable_arm(path)
    real = followed(arm.firmware, circles)
    free = free_numbers(arm)
    tools = [each for each in free if each.field.startswith("tool_")]
    arm = fitted(arm, tools, tool_misses(circles, real), rounds)
    write_arm(arm, path)
    arm = fitted(arm, [each for each in free if each not in tools], arm_misses(circles, real), rounds)
    write_arm(arm, path)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="python -m papers.plant.refit", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("data", type=Path, help="the robot's data file, which is rewritten")
    parser.add_argument("recording", type=Path, help="raven_state_circle.npz of the recording of 2018")
    parser.add_argument("rounds", nargs="?", type=int, default=8, help="of fitting; by default 8")
    args = parser.parse_args()
    main(args.data, args.recording, args.rounds)
