"""What changes along a recording of torques: a zero of one axis that drifts or leaps, a sign that turns, another load.

A change is told by what it leaves unexplained of all axes. A fit without it averages what was before and after, and its
residual looks like friction.
"""

from functools import partial

import numpy as np

from catenary.arrays import Floats, spread
from catenary.identification.identification import Identification, carrying
from catenary.identification.least_squares import SINGULAR_RATIO, flattened, left_beside, log_squares
from catenary.identification.samples import Samples
from catenary.units import TORQUE_UNIT
from catenary.verdict.finding import Finding

_NO_RESIDUAL = 1e-3  # relative residual that counts as none
_LOOKED_ROWS = 600  # that are looked at
# of the product of all axes' mean squares, at most; untouched runs of four real arms keep 0.74 or more
_COURSE_LEFT_SHARE = 0.4
_CHANGE_TIMES = np.linspace(0.15, 0.85, 15)  # of the recording, at which a change is tried
_LOAD_PARAMETERS = 4  # parameters of a load, whose inertia about its own centre is small: mass and moment


def course_findings(result: Identification, samples: Samples) -> list[Finding]:
    """Note torques whose zero, sign or load changes; nothing of poses at rest."""
    few = samples.rows(np.isin(np.arange(len(samples)), spread(len(samples), _LOOKED_ROWS)), samples.name)
    n, b = few.q.shape[1], result.base.count
    if result.options.terms == "static" or len(few) < 2 * (b + n):
        return []
    heard = carrying(result.base, result.beta, [few])[0]
    explained = np.concatenate([Y for _, Y in result.base.chunks(heard)])
    rotors = few.qdd[:, :, None] * np.eye(n)
    beside = left_beside(flattened(np.concatenate([explained, rotors], axis=2), result.weights))
    least = np.maximum((_NO_RESIDUAL * result.weights) ** 2 * np.sum(few.tau**2, axis=0), 1e-300)
    misfit = partial(log_squares, least=least)

    def rest(columns: Floats) -> Floats:
        """Return what the fit leaves (N n, k) of columns (N, n, k)."""
        return beside(flattened(columns, result.weights))

    y = rest(few.tau[:, :, None])
    before = misfit(y)[0]
    along = np.linspace(0.0, 1.0, len(few))
    after = (along[:, None] > _CHANGE_TIMES).astype(float)
    zeros = np.column_stack([along, after])[:, None, :, None] * np.eye(n)[None, :, None, :]  # (N, n, way, axis)
    left = rest(zeros.reshape(len(few), n, -1))
    sizes = (left.T @ y)[:, 0] / np.maximum(np.square(left).sum(axis=0), 1e-300)
    turned = few.tau[:, :, None, None] * (1.0 - 2.0 * after[:, None, :, None] * np.eye(n)[None, :, None, :])
    load = few.body_torques(result.model, result.model.frame().link)[:, :, :_LOAD_PARAMETERS]
    loads = [rest(load * step[:, None, None]) for step in after.T]
    ways = {
        "zero": misfit(y - left * sizes),
        "sign": misfit(rest(turned.reshape(len(few), n, -1))),
        "load": np.concatenate([misfit(y - X @ np.linalg.lstsq(X, y, rcond=SINGULAR_RATIO)[0]) for X in loads]),
    }
    way = min(ways, key=lambda name: ways[name].min())
    place = int(np.argmin(ways[way]))
    if ways[way][place] - before > np.log(_COURSE_LEFT_SHARE):
        return []
    shape, axis = divmod(place, n) if way != "load" else (place, -1)
    drifts = way == "zero" and shape == 0
    at = few.time[np.searchsorted(along, _CHANGE_TIMES[max(0, shape - (way == "zero"))])]
    size = f"{sizes[place]:+.2g} {TORQUE_UNIT[result.model.joint_units[axis]]}"
    says, culprit = {
        "zero": (f"the zero of its torque {'drifts' if drifts else 'leaps'} by {size}", "a sensor, or a push"),
        "sign": ("the sign of its torque turns", "a drive or a recorder that was set up anew"),
        "load": (f"the load on {result.model.tip} changes", "something taken up, put down or touched"),
    }[way]
    where = "along the recording" if drifts else f"at about {at:.3g} s"
    says = f"{says} {where}: what is printed is a mean of before and after"
    joints = () if way == "load" else (result.model.joint_names[axis],)
    return [Finding("drift" if drifts else "jump", joints, says, culprit, refuses=False)]
