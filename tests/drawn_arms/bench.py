"""Errors of models on drawn arms, and their ratio to the best of an afternoon's baselines."""

from collections.abc import Mapping

import numpy as np

from catenary.calibration.calibration import Calibration, check_data, fit
from drawn_arms import baselines
from drawn_arms.arm import Arm, Moved

_FIRST_S = 5.0  # that do not count: play states find their places


def rmse(moved: Moved, correction: np.ndarray) -> np.ndarray:
    """Return the RMSE (n,) [rad|m] of corrections (N, n) of a motion against the truth."""
    counted = moved.log.time - moved.log.time[0] >= _FIRST_S
    return np.sqrt(np.mean((moved.error - correction)[counted] ** 2, axis=0))


def learned(arm: Arm, minutes: float | None = None) -> Calibration:
    """Return the learner's model of an arm's training motion; what is odd of its recordings is accepted."""
    logs = [each.log for each in arm.training(minutes)]
    accepted = {finding.name for finding in check_data(logs) if finding.refuses}
    return fit(logs, folds=0, accept=tuple(accepted))


def of_baselines(arm: Arm, minutes: float | None = None) -> dict[str, np.ndarray]:
    """Return the least error (n,) of the baselines on each test motion of an arm."""
    logs, tests = [each.log for each in arm.training(minutes)], arm.tests()
    found = [baselines.fit(logs, kind) for kind in baselines.KINDS]
    return {name: np.min([rmse(test, fit(test.log)) for fit in found], axis=0) for name, test in tests.items()}


def of_model(model: Calibration, arm: Arm) -> dict[str, np.ndarray]:
    """Return a model's error (n,) on each test motion of an arm."""
    tests = arm.tests()
    return {name: rmse(test, model.predict(test.log) - test.log.q_nominal) for name, test in tests.items()}


def summary(ratios: Mapping[str, np.ndarray]) -> str:
    """Return a table: median, worst, shares of joints over 5 % worse and better, by test motion."""
    rows = ["| test | median | worst | over 5 % worse | better |", "|---|---|---|---|---|"]
    for name, found in ratios.items():
        worse, better = np.mean(found > 1.05), np.mean(found < 1.0)
        rows.append(f"| {name} | {np.median(found):.2f} | {found.max():.2f} | {worse:.0%} | {better:.0%} |")
    return "\n".join(rows)
