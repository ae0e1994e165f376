"""Are commands and measurements alike in another unit than those that a model was trained on?

Slopes do not tell a unit that both share, and without a robot there are no limits; the trained motion tells it.
"""

import numpy as np

from catenary.arrays import Floats
from catenary.plant import MotionLog
from catenary.verdict.finding import Finding
from catenary.verdict.units_and_scale import FACTORS, SPOKEN, units_option

BEYOND = 5.0  # times half the trained range about its middle: a test rarely goes there, degrees and mm nearly always
WITHIN = 2.0  # the same of what it becomes in the other unit


def trained_findings(log: MotionLog, trained: tuple[Floats, Floats]) -> list[Finding]:
    """Find positions far beyond a model's training that lie within it in another unit.

    Args:
        log: The recording.
        trained: Least and largest positions that the model was trained on, each (n,) [rad|m]; infinite where unknown.
    """
    low, high = trained
    least, most = np.percentile(log.q_nominal, [0.5, 99.5], axis=0)
    known = np.isfinite(high - low) & (high > low)
    with np.errstate(invalid="ignore"):
        middle, half = (low + high) / 2.0, (high - low) / 2.0

    def farthest(factor: float) -> Floats:
        with np.errstate(invalid="ignore"):
            away: Floats = np.maximum(abs(least / factor - middle), abs(most / factor - middle)) / half
        return away

    units, beyond = dict[int, str](), []
    for kind in ("rad", "m"):
        of_kind = known & (np.array(log.joint_units) == kind)
        far = of_kind & (farthest(1.0) > BEYOND)
        for name, factor in FACTORS[kind].items():
            if far.any() and (farthest(factor)[far] < WITHIN).all():
                units |= {int(j): name for j in np.flatnonzero(of_kind)}
                beyond += np.flatnonzero(far).tolist()
                break
    if not beyond:
        return []
    says = ", ".join(
        f"{log.joint_names[j]} from {least[j]:.4g} to {most[j]:.4g}, the model was trained between {low[j]:.4g} and "
        f"{high[j]:.4g} {log.joint_units[j]}"
        for j in beyond
    )
    spoken = " and ".join(sorted({SPOKEN[units[j]] for j in beyond}))
    names = tuple(log.joint_names[j] for j in beyond)
    return [Finding("units", names, says, f"numbers in {spoken}", units_option(log, units))]
