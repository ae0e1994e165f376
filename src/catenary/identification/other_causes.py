"""What else than a load or a push may explain torques that an identified arm does not: a drive's gain, a tilted base.

Each cause is fitted beside the load and a zero of every joint's torque; one that leaves little of what these leave is
named, as the load or push beside it is wrong.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from catenary.arrays import Floats, spread
from catenary.dynamics.torque_regressor import PER_LINK
from catenary.identification.identification import Identification, carrying
from catenary.identification.least_squares import flattened, left_beside, log_squares, one_over, scaled_solution
from catenary.identification.payload import PayloadEstimate, point_mass
from catenary.identification.samples import Samples
from catenary.verdict.finding import Finding

_DAY_LEFT_SHARE = 0.4  # of the product of all axes' mean squares: at most this is left where one day has a cause
_CLEAR_LEFT_SHARE = 0.1  # of it, from which on nothing is identified
_DAY_ROWS, _MAX_ROWS = 600, 6000  # that are looked at, of each of several days, and of one that is weighed
_WORSE_RATIO = 1.3  # times the training residual, from which on another cause is asked for
_LEFT_SHARE = 0.6  # of what load and zeros leave squared, at most, that a cause leaves
_NOTHING_LEFT_SHARE = 1e-3  # of the torque
# from the one identified: less spoils less than friction of other days
_MIN_GAIN_CHANGE, _MIN_TILT_RAD = 0.1, np.deg2rad(3.0)


def cause_findings(
    result: Identification,
    parts: Sequence[Samples],
    payload: PayloadEstimate | None = None,
    place: Floats | None = None,
) -> list[tuple[str, Finding]]:
    """Name a gain of one axis, or a tilt of the base, that explains recordings better than a load or push alone.
    Without a payload something may push; where its place (3,) [m] in its link is known, its mass beside the cause is
    told.
    """
    found = ((part.name, _cause(result, part, payload, place)) for part in parts)
    return [(name, finding) for name, finding in found if finding is not None]


def _cause(
    result: Identification, part: Samples, payload: PayloadEstimate | None, place: Floats | None
) -> Finding | None:
    model, weights = result.model, one_over(result.usual)
    part = _some(part, _MAX_ROWS)
    link = 0 if payload is None else model.link_names.index(payload.link)
    mass, moment = (None, None) if payload is None else (payload.mass, payload.moment)
    body = np.zeros(PER_LINK) if mass is None or moment is None else mass * point_mass(np.nan_to_num(moment) / mass)

    def torques(part: Samples) -> tuple[Floats, Floats]:
        """Return those of the arm (N, n), and of a body on the link by its parameters (N, n, 10)."""
        return result.predict_samples(part), part.body_torques(model, link)

    def rest(columns: Floats) -> Floats:
        """Return columns (N, n, k) weighted, less their means: every joint's torque has a zero of its own."""
        return flattened(columns - columns.mean(axis=0), weights)

    arm, load = torques(part)
    expected = arm + load @ body
    y = rest((part.tau - expected)[:, :, None])[:, 0]
    tangent = np.eye(PER_LINK)[:, :4] if place is None else point_mass(place)[:, None]
    of_load = rest(load @ (tangent if payload is not None else tangent[:, :0]))
    before = y if payload is None else y - of_load @ scaled_solution(of_load, y, 1e-6)
    size = float(before @ before)
    if size <= _WORSE_RATIO**2 * len(y):
        return None
    causes = {name: rest(columns) for name, columns in zip(model.joint_names, _gains(part), strict=True)}
    if turned := _tilted(part):  # torques are linear in gravity
        under = (torques(each) for each in turned)
        causes[""] = rest(np.stack([more + more_load @ body - expected for more, more_load in under], axis=2))
    found = {}
    for name, columns in causes.items():
        X = np.hstack([of_load, columns])
        steps = scaled_solution(X, y, 1e-6)
        if name and not _MIN_GAIN_CHANGE < 1.0 + steps[-1] < 1.0 / _MIN_GAIN_CHANGE:
            continue
        found[name] = float(np.sum((y - X @ steps) ** 2)) / size, steps
    if not found:
        return None
    name = min(found, key=lambda each: found[each][0])
    left, steps = found[name]
    changed = steps[of_load.shape[1] :]
    if left > _LEFT_SHARE or float(np.linalg.norm(changed)) < (_MIN_GAIN_CHANGE if name else _MIN_TILT_RAD):
        return None
    beside = "" if place is None else f"; beside it the load weighs {(mass or 0.0) + steps[0]:.3g} kg"
    leaves = f"which leaves {100.0 * left:.0f} % of the squared residual{beside}: what is printed is off"
    if name:
        factor = 1.0 + float(changed[0])
        says = f"its torques look {1.0 / factor:.3g} times those identified, {leaves}"
        remedy = f"--scale tau:{name}={factor:.4g}"
        return Finding("torques", (name,), says, "a drive's gain, or another unit", remedy, refuses=False)
    says = f"gravity looks turned by {np.rad2deg(np.arctan(np.linalg.norm(changed))):.0f} deg, {leaves}"
    return Finding("gravity", (), says, "a base that was tilted since", "record it as gravity:x, :y, :z", refuses=False)


def day_findings(result: Identification, days: Sequence[Samples]) -> list[tuple[str, Finding]]:
    """Find one of several fitted recordings with a zero, a gain or a tilt of its own, which spoils all masses."""
    if len(days) < 2:
        return []
    n = result.model.n
    few = [_some(day, _DAY_ROWS) for day in days]
    heard = carrying(result.base, result.beta, few)
    X = [np.concatenate([Y for _, Y in result.base.chunks(day)]) for day in heard]
    ends = np.cumsum([0, *map(len, few)])
    weights = one_over(np.min([r.rms for r in result.training], axis=0))  # of the day that fits best
    of_others = left_beside(flattened(np.concatenate(X), weights))
    tau = flattened(np.concatenate([day.tau for day in few])[:, :, None], weights)[:, 0]
    y = of_others(tau)
    least = _NOTHING_LEFT_SHARE**2 * np.square(tau.reshape(-1, n)).sum(axis=0) + 1e-300
    before = log_squares(y[:, None], least)[0]
    found = list[tuple[float, str, str, int, Floats]]()
    if y @ y < _NOTHING_LEFT_SHARE**2 * float(tau @ tau):
        return []
    for day, part, first, last in zip(few, heard, ends, ends[1:], strict=False):
        causes = {("offset", i): np.ones((len(day), n, 1)) * np.eye(n)[i][:, None] for i in range(n)}
        causes |= {("torques", i): columns for i, columns in enumerate(_gains(day))}
        if turned := _tilted(part):
            own = result.predict_samples(part)
            causes["gravity", -1] = np.stack([result.predict_samples(each) - own for each in turned], axis=2)
        for (name, axis), columns in causes.items():
            whole = np.zeros((ends[-1], n, columns.shape[2]))
            whole[first:last] = columns
            beside = of_others(flattened(whole, weights))
            steps = scaled_solution(beside, y, 1e-6)
            if name == "torques" and not _MIN_GAIN_CHANGE < 1.0 + steps[0] < 1.0 / _MIN_GAIN_CHANGE:
                continue
            after = log_squares((y - beside @ steps)[:, None], least)[0]
            found.append((float(np.exp(after - before)), day.name, name, axis, steps))
    left, where, name, axis, steps = min(found, key=lambda each: each[0])
    smallest = {"offset": 0.0, "torques": _MIN_GAIN_CHANGE, "gravity": _MIN_TILT_RAD}[name]
    if left > _DAY_LEFT_SHARE or float(np.linalg.norm(steps)) < smallest:
        return []
    says, remedy = {
        "offset": (
            f"the zero of its torque is {steps[0]:+.3g} from that of the other recordings",
            "leave out --friction",
        ),
        "torques": (
            f"its torques look {1.0 / (1.0 + steps[0]):.3g} times those of the other recordings",
            f"--scale tau:{result.model.joint_names[axis]}={1.0 + steps[0]:.4g} of this recording alone",
        ),
        "gravity": (
            f"gravity looks turned by {np.rad2deg(np.arctan(np.linalg.norm(steps))):.0f} deg from the other recordings",
            "record it as gravity:x, :y, :z",
        ),
    }[name]
    says = f"{says}, which leaves {100.0 * left:.0f} % of the product of all axes' mean squares: masses are wrong"
    joints = () if axis < 0 else (result.model.joint_names[axis],)
    culprit = "a day with another zero, gain or mounting"
    return [
        (where, Finding(name, joints, says, culprit, remedy, refuses=left < _CLEAR_LEFT_SHARE and name != "offset"))
    ]


def _gains(part: Samples) -> Floats:
    """Return what a gain of one axis changes in torques, (n, N, n, 1): linear in the gain's inverse."""
    return -np.eye(part.tau.shape[1])[:, None, :, None] * (part.tau + part.known)[:, :, None]


def _tilted(part: Samples) -> list[Samples]:
    """Return a recording under gravity that is turned by 45 degrees, about either axis across; none that holds it."""
    if part.holds_gravity:
        return []
    across = np.linalg.svd(part.gravity[None])[2][1:] * np.linalg.norm(part.gravity)
    return [replace(part, gravity=part.gravity + way) for way in across]


def _some(samples: Samples, most: int) -> Samples:
    return samples.rows(np.isin(np.arange(len(samples)), spread(len(samples), most)), samples.name)
