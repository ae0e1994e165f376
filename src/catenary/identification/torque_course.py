"""Torques out of step with their motion, or that change along a recording, where nobody expects it.

Each recording is fitted once more: with torques read a time later, and with a zero of one axis that drifts or leaps, a
sign that turns, or a load that comes or goes. A change is told by what it leaves unexplained of all axes. A fit without
it averages what was before and after, and its residual looks like friction.
"""

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.torque_regressor import PER_LINK, torque_regressor
from catenary.identification.identification import Identification, carrying
from catenary.identification.samples import Samples
from catenary.units import TORQUE_UNIT
from catenary.verdict.delay import CERTAIN, LOOKS
from catenary.verdict.finding import Finding

LEFT = 0.4  # of the product of all axes' mean squares, at most; untouched runs of four real arms keep 0.74 or more
REACH, LAGS = 0.2, 41  # [s] by which torques may be late or early, and how many such times are tried
TOLERANCE = 0.012  # [s]: intervals of those arms' delays contain zero, and are about 10 ms wide at best
EDGES = np.linspace(0.15, 0.85, 15)  # of the recording, at which a change is tried
ROWS = 600  # that are looked at
LEAST = 1e-3  # relative residual that counts as none
SEEN = 1e-5  # smallest singular value, columns scaled to one, of what the recording shows
LOAD = 4  # parameters of a load, whose inertia about its own centre is small: mass and moment


def course_findings(result: Identification, samples: Samples) -> list[Finding]:
    """Note torques that are late or early, or whose zero, sign or load changes; nothing of poses at rest."""
    steps = np.diff(samples.time, prepend=samples.time[0])
    time = np.cumsum(np.where(steps >= 0.0, steps, 0.0))  # of joined recordings too, whose stamps go back
    span = float(time[-1])
    inside = np.abs(time - span / 2.0) <= span / 2.0 - min(REACH, span / 10.0)
    places = np.flatnonzero(inside)[:: int(inside.sum()) // ROWS + 1]
    few = samples.rows(np.isin(np.arange(len(samples)), places), samples.name)
    n, b, gravity = few.q.shape[1], result.base.count, np.array(result.options.gravity)
    if result.options.terms == "static" or len(few) < 2 * (b + n):
        return []
    heard = carrying(result.base, result.beta, [few], gravity)[0]
    explained = np.concatenate([Y for _, Y in result.base.chunks(heard, gravity)])
    rotors = few.qdd[:, :, None] * np.eye(n)
    onto = _flat(np.concatenate([explained, rotors], axis=2), result.weights)
    U, sizes, _ = np.linalg.svd(onto / np.maximum(np.linalg.norm(onto, axis=0), 1e-300), full_matrices=False)
    U = U[:, sizes > SEEN * sizes[0]]
    least = np.maximum((LEAST * result.weights) ** 2 * np.sum(few.tau**2, axis=0), 1e-300)[:, None]

    def rest(columns: Floats) -> Floats:
        """Return what the fit leaves (N n, k) of columns (N, n, k)."""
        flat = _flat(columns, result.weights)
        left: Floats = flat - U @ (U.T @ flat)
        return left

    def misfit(left: Floats) -> Floats:
        """Return the sum of the logarithms of all axes' squares (k,)."""
        squares = np.square(left.reshape(len(few), n, -1)).sum(axis=0)
        return np.asarray(np.log(np.maximum(squares, least)).sum(axis=0), dtype=np.float64)

    y = rest(few.tau[:, :, None])
    before = misfit(y)[0]
    lags = np.linspace(-1.0, 1.0, LAGS) * min(REACH, span / 10.0)
    whole = (samples.tau + samples.known).T
    read = [np.column_stack([np.interp(time[places] + lag, time, axis) for axis in whole]) for lag in lags]
    cost = misfit(rest(np.stack(read, axis=2) - few.known[:, :, None]))
    best = lags[np.argmin(cost)]
    if np.abs(lags[LOOKS * (cost - cost.min()) <= CERTAIN**2]).min() > TOLERANCE:
        word, shown = "late" if best > 0.0 else "early", "" if abs(best) < lags[-1] else " or more"
        says = f"torques come {abs(best) * 1e3:.0f} ms{shown} too {word} for the motion: what is printed is off"
        return [Finding("delay", (), says, "two clocks, or positions and velocities filtered otherwise", refuses=False)]
    along = np.linspace(0.0, 1.0, len(few))
    after = (along[:, None] > EDGES).astype(float)
    zeros = np.column_stack([along, after])[:, None, :, None] * np.eye(n)[None, :, None, :]  # (N, n, way, axis)
    left = rest(zeros.reshape(len(few), n, -1))
    sizes = (left.T @ y)[:, 0] / np.maximum(np.square(left).sum(axis=0), 1e-300)
    turned = few.tau[:, :, None, None] * (1.0 - 2.0 * after[:, None, :, None] * np.eye(n)[None, :, None, :])
    link = slice(PER_LINK * result.model.frame(result.model.tip).link, None)
    motion = (few.q, few.qd, few.qdd, few.gravity_rows(gravity), few.base_motion())
    load = torque_regressor(result.model, *motion)[:, :, link][:, :, :LOAD]
    loads = [rest(load * step[:, None, None]) for step in after.T]
    ways = {
        "zero": misfit(y - left * sizes),
        "sign": misfit(rest(turned.reshape(len(few), n, -1))),
        "load": np.concatenate([misfit(y - X @ np.linalg.lstsq(X, y, rcond=SEEN)[0]) for X in loads]),
    }
    way = min(ways, key=lambda name: ways[name].min())
    place = int(np.argmin(ways[way]))
    if ways[way][place] - before > np.log(LEFT):
        return []
    shape, axis = divmod(place, n) if way != "load" else (place, -1)
    drifts = way == "zero" and shape == 0
    at = few.time[np.searchsorted(along, EDGES[max(0, shape - (way == "zero"))])]
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


def _flat(columns: Floats, weights: Floats) -> Floats:
    """Return weighted columns (N n, k) of (N, n, k)."""
    flat: Floats = (columns * weights[:, None]).reshape(-1, columns.shape[2])
    return flat
