"""Standard errors of the base parameters that a motion lets one expect, beside those of motions nobody designed."""

from dataclasses import dataclass

import numpy as np

from catenary.arrays import Floats
from catenary.identification.base_parameters import BaseParameters
from catenary.identification.excitation import Excitation
from catenary.identification.fourier import free_poses, shrunk_motion
from catenary.identification.fourier_series import FourierSeries
from catenary.identification.motion_limits import MotionLimits

RANDOM = 10  # motions, of which the middle one is told
HIDDEN = 1e-7  # of the largest singular value: directions that a motion does not show
PARTLY = 1e-6  # of a parameter along such a direction: it is not shown
NOISE = 0.01  # of the torque limit, where none is given
ATTEMPTS = 20  # at a random motion that keeps all limits


@dataclass(frozen=True)
class Expected:
    """What one motion shows."""

    motion: str  # designed, random, single joints
    condition: float  # of the regressor, columns scaled to length one; inf where parameters are not shown
    errors: Floats  # (b,) standard errors in the parameters' units; inf of what is not shown

    @property
    def hidden(self) -> int:
        """How many base parameters it does not show."""
        return int(np.isinf(self.errors).sum())

    def times(self, other: "Expected") -> tuple[float, float]:
        """Return how many times as large its errors are as another's: geometric mean, and of the worst parameter."""
        with np.errstate(invalid="ignore"):
            ratio = self.errors / other.errors
        ratio = np.where(np.isnan(ratio), np.inf, ratio)
        return float(np.exp(np.log(ratio).mean())), float(ratio.max())


@dataclass(frozen=True)
class Comparison:
    """A designed motion beside others of equal length, rows and limits."""

    base: BaseParameters
    noise: Floats  # (n,) standard deviation of the torques' noise, from row to row independent [Nm or N]
    designed: Expected
    random: Expected | None  # the one with the middle condition; None where none kept the limits
    single: Expected | None


def torque_noise(limits: MotionLimits, given: float | None) -> Floats:
    """Return the noise of the torques (n,): as given, or a hundredth of their limits, or 1 where there are none."""
    if given is not None:
        return np.full(limits.model.n, given)
    effort = limits.model.effort_limit
    return np.where(np.isfinite(effort), NOISE * np.where(np.isfinite(effort), effort, 1.0), 1.0)


def compare(limits: MotionLimits, design: Excitation, noise: Floats, rng: np.random.Generator) -> Comparison:
    """Compare a designed motion with random ones, and with one joint moving after the other.

    All last as long, have as many rows, and keep the same limits: random ones are Fourier motions as the search draws
    them, shrunk until they do.
    """
    assert design.series is not None
    base = design.base
    rows = design.q, design.qd, design.qdd
    designed = expected("designed", base, rows, limits.gravity, noise)
    period, harmonics = design.series.period, len(design.series.a)
    centres = free_poses(limits, rng)
    random = []
    for _ in range(ATTEMPTS):
        coefficients = rng.normal(size=(2, harmonics, limits.model.n))
        found = shrunk_motion(
            coefficients,
            rng.uniform(0.6, 1.0, limits.model.n),
            centres[rng.integers(len(centres))],
            period,
            limits,
        )
        if found is not None:
            rows = found[0].sample(design.time)
            random.append(expected("random", base, rows, limits.gravity, noise))
        if len(random) == RANDOM:
            break
    random.sort(key=lambda one: one.condition)
    turns = _one_after_another(limits, design, centres[0], rng)
    single = None if turns is None else expected("single joints", base, turns, limits.gravity, noise)
    return Comparison(base, noise, designed, random[len(random) // 2] if random else None, single)


def expected(
    motion: str, base: BaseParameters, rows: tuple[Floats, Floats, Floats], gravity: Floats, noise: Floats
) -> Expected:
    """Return the condition and the standard errors of the base parameters that least squares has of some rows.

    cov = (sum_rows Y' W Y)^-1 with W = diag(1 / noise^2).
    """
    Y = base.regressor(*rows, gravity)
    weighed = (Y / noise[:, None]).reshape(-1, base.count)
    plain = Y.reshape(-1, base.count)
    size, unit = np.linalg.norm(weighed, axis=0), np.linalg.norm(plain, axis=0)
    condition = float(np.linalg.cond(plain / np.where(unit > 0.0, unit, 1.0)))
    _, s, V = np.linalg.svd(weighed / np.where(size > 0.0, size, 1.0), full_matrices=False)
    seen = s > HIDDEN * s[0]
    blind = np.zeros(base.count) if seen.all() else np.linalg.norm(V[~seen], axis=0)
    errors = np.sqrt(((V[seen] / s[seen, None]) ** 2).sum(axis=0)) / np.where(size > 0.0, size, 1.0)
    hidden = (blind > PARTLY) | (size == 0.0)
    return Expected(motion, np.inf if hidden.any() else condition, np.where(hidden, np.inf, errors))


def _one_after_another(
    limits: MotionLimits, design: Excitation, pose: Floats, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats] | None:
    """Return rows in which one joint moves after the other, the others resting in a pose, over equal times."""
    assert design.series is not None
    n, harmonics = limits.model.n, len(design.series.a)
    period = design.series.period / n
    parts: list[tuple[Floats, Floats, Floats]] = []
    moving = np.minimum((design.time / period).astype(np.int64), n - 1)
    for joint in range(n):
        share = np.zeros(n)
        share[joint] = 1.0
        found = shrunk_motion(rng.normal(size=(2, harmonics, n)), share, pose, period, limits)
        if found is None:
            return None
        series: FourierSeries = found[0]
        parts.append(series.sample(design.time[moving == joint] - joint * period))
    q, qd, qdd = (np.concatenate([part[k] for part in parts]) for k in range(3))
    return q, qd, qdd
