"""Torques that cannot be those of the motion: another mounting, sign, axis or unit; late, or with a zero that drifts.

Torques of a motion are linear in gravity, so by the masses of the robot's file its three components are fitted beside
friction, a rotor and a constant of each axis. An arm on a wall that is taken for upright has torques that no masses
give, and masses that no arm has.

A recording is also fitted with torques read a time later, and with a zero of one axis that drifts or leaps, a sign that
turns, or a load that comes or goes. A change is told by what it leaves unexplained of all axes. A fit without it
averages what was before and after, and its residual looks like friction.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np

from catenary.arrays import Floats, spread
from catenary.dynamics.torque_regressor import link_parameters, torque_regressor
from catenary.identification.identification import Identification, carrying
from catenary.identification.least_squares import SINGULAR_RATIO, flattened, left_beside, log_squares, solve, triangles
from catenary.identification.samples import Samples
from catenary.robots.model import RobotModel
from catenary.spatial import STANDARD_GRAVITY, angle_between
from catenary.units import TORQUE_UNIT
from catenary.verdict.delay import CERTAIN_SIGMAS, LOOKS
from catenary.verdict.finding import Finding

# Friction of real arms takes 8 to 170 % of a recording's mean torque times its mean speed, 2 to 70 standard deviations
# above zero; an axis whose torque has the wrong sign seems to drive itself as strongly.
_SURE_DEVIATIONS = 3.0  # standard deviations below zero of the power that friction takes
_NOTABLE_POWER_SHARE = 0.05  # of the mean torque times the mean speed
# of the product of all axes' mean squares: at most this is left when one axis's sign is turned back
_MENDED_SHARE = 0.35
_NO_RESIDUAL = 1e-3  # relative residual that counts as none
_DOUBTFUL_RESIDUAL = 0.1  # relative residual from which on it is asked whether axes are swapped or turned
_LOOKED_ROWS = 600  # that are looked at
_MIN_CORRELATION = 0.8  # least correlation of measured torques with the model's own, to speak of their ratio
_ROUNDING_SHARE = 1e-6  # of a torque: less than that beside friction, rotor and constant is rounding
_MASS_TORQUE_RATIOS = (0.4, 2.5)  # of a torque to the model's own: assumed masses are wrong by less


def torque_findings(
    result: Identification, samples: Samples, *, fitted: bool, may_carry: bool = False
) -> list[Finding]:
    """Find torques under another gravity, of the wrong sign, of swapped axes, in another unit; late ones are noted.

    Args:
        result: What was identified; where the recording was fitted, by a free fit: friction of a wrong sign tells.
        fitted: It is one of those that were fitted.
        may_carry: The arm may carry a load, which makes torques of some axes many times those of the arm alone.
    """
    count = len(samples)
    some = np.isin(np.arange(count), spread(count, _LOOKED_ROWS))
    rows = samples.rows(some, samples.name)
    if fitted and (mounting := mounting_finding(result.model, rows)) is not None:
        return [mounting]
    own = result.training if fitted else result.tests
    residual = next(r for r in own if r.log == samples.name)
    with np.errstate(invalid="ignore"):
        doubtful = bool(np.any(residual.relative_rms > _DOUBTFUL_RESIDUAL)) or residual.verdict not in (None, "holds")
    findings, against, factors = _known_torques(result, rows, fitted, may_carry)
    pair, axis = None, None
    if doubtful:
        before = _misfit(result, rows, fitted)

        def left(changed: Samples) -> float:
            """Return the share of all axes' mean squares (their product) that is left."""
            return float(np.prod(_misfit(result, changed, fitted) / before))

        turned_left, axis = min(
            (left(_times(rows, signs)), i) for i, signs in enumerate(1.0 - 2.0 * np.eye(rows.q.shape[1]))
        )
        axis = axis if turned_left < _MENDED_SHARE else None
        swapped_left, pair = min(((left(swapped), pair) for pair, swapped in _swapped(rows)), default=(1.0, None))
        if swapped_left >= min(_SWAPPED_SHARE, 1.0 if axis is None else turned_left, left(_times(rows, factors))):
            pair = None
    if pair is not None:
        a, b = (result.model.joint_names[i] for i in pair)
        return [
            Finding(
                "swapped",
                (a, b),
                f"axes {a} and {b} look swapped: exchanged, their torques fit",
                "columns in another order",
                f"--swap tau:{a},{b}, or where positions are exchanged too, --swap q_nominal:{a},{b} --swap qd:{a},{b} "
                f"--swap tau:{a},{b}",
            )
        ]
    # an axis turned round spoils the friction of those that move with it: what one sign mends is that axis
    turned = set() if axis is None else {axis}
    if fitted and not turned:
        driven, braked = _by_friction(result, samples)
        # torques that fit together, of which friction brakes none, are all counted the other way
        turned = set(range(result.model.n)) if len(driven) > 1 and not braked else driven
    turned |= against
    findings += [
        Finding(
            "sign",
            (result.model.joint_names[i],),
            "its friction, or that of axes whose torques fit with its own, seems to drive it (Coulomb and viscous "
            "friction below zero), or its torque fits turned round, or pulls where known masses push",
            "a torque that is counted the other way than the position, or the load's instead of the motor's",
            f"--sign tau:{result.model.joint_names[i]}",
        )
        for i in sorted(turned)
    ]
    return findings or course_findings(result, samples)


def _by_friction(result: Identification, samples: Samples) -> tuple[set[int], set[int]]:
    """Return axes whose friction gives power, and those where it takes power, beyond its uncertainty."""
    parameters = result.base.parameters
    first = len(parameters.links) * parameters.per_link
    place = {int(column): k for k, column in enumerate(result.base.columns)}
    driven, braked = set[int](), set[int]()
    power: dict[tuple[float, ...], list[tuple[int, float]]] = {}
    for k, term in enumerate(parameters.actuation):
        friction = term.friction
        if friction is not None and friction.usual and not friction.at_rest and first + k in place:
            speed = samples.qd @ term.combination
            weight = float(np.mean(speed * friction.load(speed, term.scale, 0.0, np)))
            power.setdefault(tuple(term.combination), []).append((place[first + k], weight))
    for combination, parts in power.items():
        columns, weights = [column for column, _ in parts], np.array([weight for _, weight in parts])
        taken = float(weights @ result.beta[columns])
        spread = float(np.sqrt(weights @ result.covariance[np.ix_(columns, columns)] @ weights))
        along = np.array(combination)
        axis = int(np.argmax(np.abs(along)))
        size = float(np.mean(np.abs(samples.tau[:, axis])) * np.mean(np.abs(samples.qd[:, axis])))
        if (
            abs(taken) > _SURE_DEVIATIONS * spread
            and abs(taken) > _NOTABLE_POWER_SHARE * size
            and np.count_nonzero(along) == 1
        ):
            (driven if taken < 0.0 else braked).add(axis)
    return driven, braked


def _times(rows: Samples, factors: Floats) -> Samples:
    """Return a recording whose measured torques are multiplied; what is known beforehand was subtracted as it is."""
    return replace(rows, tau=(rows.tau + rows.known) * factors - rows.known)


def _known_torques(
    result: Identification, rows: Samples, fitted: bool, may_carry: bool
) -> tuple[list[Finding], set[int], Floats]:
    """Compare torques with those of the robot file's masses, or of a test with those of what was identified.
    Return a finding on axes whose torque is many times that, or a fraction; the axes where it has the other sign; what
    to multiply torques with (n,), as found.
    """
    model = result.model
    whose = "the robot's own masses" if fitted else "what was identified"
    if not fitted:
        own = result.predict_samples(rows)
    elif model.missing_inertia:
        return [], set(), np.ones(model.n)
    else:
        own = torque_regressor(model, *rows.motion()) @ link_parameters(model.tree)
    found, against, as_expected, untold = dict[int, float](), set[int](), 0, list[str]()
    for i, name in enumerate(model.joint_names):
        # friction, a constant and, of a file that has none, a rotor are beside the model's own torque, of any size
        speed, one = rows.qd[:, i], np.ones(len(rows))
        beside = np.column_stack([np.sign(speed), speed, one, *([rows.qdd[:, i]] if fitted else [])])
        given, measured = (v - beside @ np.linalg.lstsq(beside, v)[0] for v in (own[:, i], rows.tau[:, i]))
        size, torque = float(np.linalg.norm(given)), float(np.linalg.norm(measured))
        if torque <= _ROUNDING_SHARE * np.linalg.norm(rows.tau[:, i]):
            continue
        told = size > _ROUNDING_SHARE * np.linalg.norm(own[:, i])
        ratio, correlation = np.array([1.0 / size, 1.0 / torque]) * (given @ measured) / size if told else np.zeros(2)
        if correlation < -_MIN_CORRELATION:
            against.add(i)
        if abs(correlation) <= _MIN_CORRELATION:
            untold.append(name)
        elif _MASS_TORQUE_RATIOS[0] < abs(ratio) < _MASS_TORQUE_RATIOS[1]:
            as_expected += 1
        else:
            found[i] = abs(ratio)
    if may_carry and as_expected:
        # another unit is all axes' or a smaller one; beside axes as expected, a load on light links explains more
        found = {i: ratio for i, ratio in found.items() if ratio < _MASS_TORQUE_RATIOS[1]}
    factors = np.array([1.0 / found.get(i, 1.0) for i in range(model.n)])
    if not found:
        return [], against, factors
    names = {model.joint_names[i]: ratio for i, ratio in found.items()}
    remedy = " ".join(f"--scale tau:{name}={1.0 / ratio:.4g}" for name, ratio in names.items())
    if untold and not as_expected:  # one unit for all: those scaled would stand beside others that are not
        remedy = (
            "--scale tau:JOINT=FACTOR of every joint, from the drives' data sheets (masses tell nothing of "
            f"{', '.join(untold)}), or catenary identify --currents with a known --load"
        )
    finding = Finding(
        "torques",
        tuple(names),
        f"torques over those of {whose} are {', '.join(f'{name} {ratio:.3g}' for name, ratio in names.items())}, "
        f"expected {_MASS_TORQUE_RATIOS[0]:g} to {_MASS_TORQUE_RATIOS[1]:g}",
        "motor currents, or torques at the motor, read as joint torques",
        remedy,
    )
    return [finding], against, factors


# untouched recordings of five real arms keep 0.95 or more
_SWAPPED_SHARE = 0.4  # of the product of all axes' mean squares: at most this is left when two are swapped back


def _swapped(rows: Samples) -> Iterator[tuple[tuple[int, int], Samples]]:
    """Yield pairs of axes with the recording in which they are exchanged: with their torques, or these alone."""
    for i, j in combinations(range(rows.q.shape[1]), 2):
        order = np.arange(rows.q.shape[1])
        order[[i, j]] = j, i
        for keys in (("q", "qd", "qdd", "tau"), ("tau",)):
            exchanged: dict[str, Any] = {key: getattr(rows, key)[:, order] for key in keys}
            yield (i, j), replace(rows, **exchanged)


def _misfit(result: Identification, rows: Samples, refit: bool) -> Floats:
    """Return each axis's mean square residual (n,) over that of its torque, four at most: more is no worse."""
    reduced = triangles(result.base, [rows])
    beta = solve(reduced.stacked(result.weights)) if refit else result.beta
    relative = reduced.residual_rms(beta) / np.maximum(np.sqrt(np.mean(rows.tau**2, axis=0)), 1e-9)
    return np.clip(relative, _NO_RESIDUAL, 2.0) ** 2


_TURNED_DEG = 15.0  # [deg] from the stated gravity, from which on another mounting is meant
_GRAVITY_RATIOS = (0.5, 2.0)  # of the gravity that is found to standard gravity: a file's masses are wrong by less
_MOUNTING_LEFT_SHARE = 0.4  # of the squared residual with the stated direction, at most
_UPSIDE_DOWN_DEG = 150.0  # [deg]: torques of the wrong sign look like this as well
_NAMED_WITHIN_DEG = 10.0  # [deg] from an axis of the base, within which a mounting has a name
_MOUNTING_NAMES = {
    "the base stands upright": (0, 0, -1), "the base hangs from a ceiling": (0, 0, 1),
    "the base is on a wall, its x axis down": (1, 0, 0), "the base is on a wall, its x axis up": (-1, 0, 0),
    "the base is on a wall, its y axis down": (0, 1, 0), "the base is on a wall, its y axis up": (0, -1, 0),
}  # fmt: skip


def fitted_gravity(model: RobotModel, samples: Samples) -> tuple[Floats, float, bool] | None:
    """Fit gravity to a recording by the masses of the robot's file; None where these are unknown, or gravity recorded.
    Axes weigh as the spread of their torque. Return gravity (3,) [m/s2] in base axes; what it leaves of the squared
    residual with the stated direction, of whatever size; whether friction takes power, as where torques have their
    sign.
    """
    if model.missing_inertia or samples.holds_gravity or not model.tree.mass.any():
        return None
    phi = link_parameters(model.tree)

    def own(gravity: Floats, moving: float) -> Floats:
        motion = samples.q, moving * samples.qd, moving * samples.qdd
        return torque_regressor(model, *motion, gravity) @ phi

    spread = samples.tau.std(axis=0)
    axes = np.flatnonzero(spread > 1e-9 * spread.max(initial=0.0))
    if not len(axes):
        return None
    moving = own(np.zeros(3), 1.0)
    pulls = np.stack([own(e, 0.0) for e in np.eye(3)], axis=2)  # (N, n, 3)
    X, y, beside = [], [], []
    for i in axes:
        speed = samples.qd[:, i]
        columns = np.column_stack([np.sign(speed), speed, samples.qdd[:, i], np.ones(len(speed))])
        values = np.column_stack([samples.tau[:, i] - moving[:, i], pulls[:, i]]) / spread[i]
        factors = np.linalg.lstsq(columns, values)[0]
        rest = values - columns @ factors
        X.append(rest[:, 1:])
        y.append(rest[:, 0])
        beside.append((columns, factors * spread[i]))
    A, b = np.concatenate(X), np.concatenate(y)
    if np.linalg.matrix_rank(A, tol=1e-6 * np.linalg.norm(A)) < 3:
        return None
    vector = np.linalg.lstsq(A, b)[0]
    left = float(np.sum((b - A @ vector) ** 2))
    along = A @ samples.gravity
    upon = max(float(along @ b), 0.0)  # of whatever size, but not of the other sign
    before = float(b @ b) - upon**2 / max(float(along @ along), 1e-300)
    taken = [float(np.mean((c[:, :2] @ (f[:2, 0] - f[:2, 1:] @ vector)) * c[:, 1])) for c, f in beside]
    return vector, left / max(before, 1e-300), sum(taken) >= 0.0


def mounting_finding(model: RobotModel, samples: Samples) -> Finding | None:
    """Find a recording in which gravity pulled along another direction than was stated; None where it did not."""
    found, stated = fitted_gravity(model, samples), samples.gravity
    if found is None or not stated.any():
        return None
    vector, left, braked = found
    size, turned = float(np.linalg.norm(vector)), float(np.rad2deg(angle_between(vector, stated)))
    if (
        left > _MOUNTING_LEFT_SHARE
        or not braked
        or not _GRAVITY_RATIOS[0] < size / STANDARD_GRAVITY < _GRAVITY_RATIOS[1]
    ):
        return None
    if turned < _TURNED_DEG or (turned > _UPSIDE_DOWN_DEG and not samples.qd.any()):
        return None
    off, name = min(
        (float(np.rad2deg(angle_between(vector, np.array(axis)))), name) for name, axis in _MOUNTING_NAMES.items()
    )
    mounted = (
        f"{name}, within {off:.0f} deg"
        if off < _NAMED_WITHIN_DEG
        else f"the base is tilted, {off:.0f} deg from where {name}"
    )
    exact = np.array(_MOUNTING_NAMES[name]) * float(np.linalg.norm(stated))
    given = exact if off < _NAMED_WITHIN_DEG else vector * STANDARD_GRAVITY / size
    x, y, z = vector
    return Finding(
        "gravity",
        tuple(model.joint_names),
        f"with the masses of the robot's file, torques fit gravity of ({x:.2f}, {y:.2f}, {z:.2f}) m/s2, "
        f"{turned:.0f} deg from what was stated, and leave {100.0 * left:.0f} % of the squared residual: "
        f"{mounted}",
        "gravity of another mounting, or forgotten",
        f"--gravity {','.join(f'{v:.4g}' for v in given + 0.0)}",
    )


# of the product of all axes' mean squares, at most; untouched runs of four real arms keep 0.74 or more
_COURSE_LEFT_SHARE = 0.4
_MAX_LAG_S, _LAG_COUNT = 0.2, 41  # [s] by which torques may be late or early, and how many such times are tried
_DELAY_TOLERANCE_S = 0.012  # [s]: intervals of those arms' delays contain zero, and are about 10 ms wide at best
_CHANGE_TIMES = np.linspace(0.15, 0.85, 15)  # of the recording, at which a change is tried
_LOAD_PARAMETERS = 4  # parameters of a load, whose inertia about its own centre is small: mass and moment


def course_findings(result: Identification, samples: Samples) -> list[Finding]:
    """Note torques that are late or early, or whose zero, sign or load changes; nothing of poses at rest."""
    steps = np.diff(samples.time, prepend=samples.time[0])
    time = np.cumsum(np.where(steps >= 0.0, steps, 0.0))  # of joined recordings too, whose stamps go back
    span = float(time[-1])
    inside = np.abs(time - span / 2.0) <= span / 2.0 - min(_MAX_LAG_S, span / 10.0)
    places = np.flatnonzero(inside)[spread(int(inside.sum()), _LOOKED_ROWS)]
    few = samples.rows(np.isin(np.arange(len(samples)), places), samples.name)
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
    lags = np.linspace(-1.0, 1.0, _LAG_COUNT) * min(_MAX_LAG_S, span / 10.0)
    whole = (samples.tau + samples.known).T
    read = [np.column_stack([np.interp(time[places] + lag, time, axis) for axis in whole]) for lag in lags]
    cost = misfit(rest(np.stack(read, axis=2) - few.known[:, :, None]))
    best = lags[np.argmin(cost)]
    if np.abs(lags[LOOKS * (cost - cost.min()) <= CERTAIN_SIGMAS**2]).min() > _DELAY_TOLERANCE_S:
        word, shown = "late" if best > 0.0 else "early", "" if abs(best) < lags[-1] else " or more"
        says = f"torques come {abs(best) * 1e3:.0f} ms{shown} too {word} for the motion: what is printed is off"
        return [Finding("delay", (), says, "two clocks, or positions and velocities filtered otherwise", refuses=False)]
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
