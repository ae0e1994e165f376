"""Torques that cannot be those of the motion: of the wrong sign, of other axes, or no torques but currents."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.torque_regressor import link_parameters, torque_regressor
from catenary.identification.identification import Identification
from catenary.identification.least_squares import solve, triangles
from catenary.identification.mounting import mounting_finding
from catenary.identification.samples import Samples
from catenary.identification.torque_course import course_findings
from catenary.verdict.finding import Finding

# Friction of real arms takes 8 to 170 % of a recording's mean torque times its mean speed, 2 to 70 standard deviations
# above zero; an axis whose torque has the wrong sign seems to drive itself as strongly.
SURE = 3.0  # standard deviations below zero of the power that friction takes
NOTABLE = 0.05  # of the mean torque times the mean speed
MENDED = 0.35  # of the product of all axes' mean squares: at most this is left when one axis's sign is turned back
LEAST = 1e-3  # relative residual that counts as none
DOUBTFUL = 0.1  # relative residual from which on it is asked whether axes are swapped or turned
ROWS = 600  # that are looked at
EXPLAINED = 0.8  # least correlation of measured torques with the model's own, to speak of their ratio
TOLD = 1e-6  # of a torque: less than that beside friction, rotor and constant is rounding
RATIO = (0.4, 2.5)  # of a torque to the model's own: assumed masses are wrong by less


def torque_findings(
    result: Identification, samples: Samples, *, fitted: bool, may_carry: bool = False
) -> list[Finding]:
    """Find torques under another gravity, of the wrong sign, of swapped axes, in another unit; late ones are noted.

    Args:
        result: What was identified; where the recording was fitted, by a free fit: friction of a wrong sign tells.
        fitted: It is one of those that were fitted.
        may_carry: The arm may carry a load, which makes torques of some axes many times those of the arm alone.
    """
    rows = _some_rows(samples)
    if fitted:
        stated = np.array(result.options.gravity)
        if (mounting := mounting_finding(result.model, rows, stated)) is not None:
            return [mounting]
    own = result.training if fitted else result.tests
    residual = next(r for r in own if r.log == samples.name)
    with np.errstate(invalid="ignore"):
        doubtful = bool(np.any(residual.relative_rms > DOUBTFUL)) or residual.verdict not in (None, "holds")
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
        axis = axis if turned_left < MENDED else None
        swapped_left, pair = min(((left(swapped), pair) for pair, swapped in _swapped(rows)), default=(1.0, None))
        if swapped_left >= min(CLEARLY, 1.0 if axis is None else turned_left, left(_times(rows, factors))):
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
        if term.kind in ("coulomb", "viscous") and first + k in place:
            speed = samples.qd @ term.combination
            weight = float(np.mean(np.abs(speed) if term.kind == "coulomb" else speed**2))
            power.setdefault(tuple(term.combination), []).append((place[first + k], weight))
    for combination, parts in power.items():
        columns, weights = [column for column, _ in parts], np.array([weight for _, weight in parts])
        taken = float(weights @ result.beta[columns])
        spread = float(np.sqrt(weights @ result.covariance[np.ix_(columns, columns)] @ weights))
        along = np.array(combination)
        axis = int(np.argmax(np.abs(along)))
        size = float(np.mean(np.abs(samples.tau[:, axis])) * np.mean(np.abs(samples.qd[:, axis])))
        if abs(taken) > SURE * spread and abs(taken) > NOTABLE * size and np.count_nonzero(along) == 1:
            (driven if taken < 0.0 else braked).add(axis)
    return driven, braked


def _times(rows: Samples, factors: Floats) -> Samples:
    """Return a recording whose measured torques are multiplied; what is known beforehand was subtracted as it is."""
    return replace(rows, tau=(rows.tau + rows.known) * factors - rows.known)


def _known_torques(
    result: Identification, rows: Samples, fitted: bool, may_carry: bool
) -> tuple[list[Finding], set[int], Floats]:
    """Compare torques with those of the robot file's masses, or of a test with those of what was identified.

    Returns:
        A finding on axes whose torque is many times that, or a fraction; the axes where it has the other sign; what to
        multiply torques with (n,), as found.
    """
    model = result.model
    whose = "the robot's own masses" if fitted else "what was identified"
    if not fitted:
        own = result.predict_samples(rows)
    elif model.missing_inertia:
        return [], set(), np.ones(model.n)
    else:
        down = rows.gravity_rows(np.array(result.options.gravity))
        own = torque_regressor(model, rows.q, rows.qd, rows.qdd, down, rows.base_motion()) @ link_parameters(model.tree)
    found, against, as_expected, untold = dict[int, float](), set[int](), 0, list[str]()
    for i, name in enumerate(model.joint_names):
        # friction, a constant and, of a file that has none, a rotor are beside the model's own torque, of any size
        speed, one = rows.qd[:, i], np.ones(len(rows))
        beside = np.column_stack([np.sign(speed), speed, one, *([rows.qdd[:, i]] if fitted else [])])
        given, measured = (v - beside @ np.linalg.lstsq(beside, v)[0] for v in (own[:, i], rows.tau[:, i]))
        size, torque = float(np.linalg.norm(given)), float(np.linalg.norm(measured))
        if torque <= TOLD * np.linalg.norm(rows.tau[:, i]):
            continue
        told = size > TOLD * np.linalg.norm(own[:, i])
        ratio, correlation = np.array([1.0 / size, 1.0 / torque]) * (given @ measured) / size if told else np.zeros(2)
        if correlation < -EXPLAINED:
            against.add(i)
        if abs(correlation) <= EXPLAINED:
            untold.append(name)
        elif RATIO[0] < abs(ratio) < RATIO[1]:
            as_expected += 1
        else:
            found[i] = abs(ratio)
    if may_carry and as_expected:
        # another unit is all axes' or a smaller one; beside axes as expected, a load on light links explains more
        found = {i: ratio for i, ratio in found.items() if ratio < RATIO[1]}
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
        f"expected {RATIO[0]:g} to {RATIO[1]:g}",
        "motor currents, or torques at the motor, read as joint torques",
        remedy,
    )
    return [finding], against, factors


# untouched recordings of five real arms keep 0.95 or more
CLEARLY = 0.4  # of the product of all axes' mean squares: at most this is left when two are swapped back


def _swapped(rows: Samples) -> Iterator[tuple[tuple[int, int], Samples]]:
    """Yield pairs of axes with the recording in which they are exchanged: with their torques, or these alone."""
    for i, j in combinations(range(rows.q.shape[1]), 2):
        order = np.arange(rows.q.shape[1])
        order[[i, j]] = j, i
        for keys in (("q", "qd", "qdd", "tau"), ("tau",)):
            exchanged: dict[str, Any] = {key: getattr(rows, key)[:, order] for key in keys}
            yield (i, j), replace(rows, **exchanged)


def _some_rows(samples: Samples) -> Samples:
    some = np.zeros(len(samples), dtype=bool)
    some[np.unique(np.linspace(0, len(samples) - 1, min(len(samples), ROWS)).astype(np.int64))] = True
    return samples.rows(some, samples.name)


def _misfit(result: Identification, rows: Samples, refit: bool) -> Floats:
    """Return each axis's mean square residual (n,) over that of its torque, four at most: more is no worse."""
    gravity = np.array(result.options.gravity)
    reduced = triangles(result.base, gravity, [rows])
    beta = solve(reduced.stacked(result.weights)) if refit else result.beta
    relative = reduced.residual_rms(beta) / np.maximum(np.sqrt(np.mean(rows.tau**2, axis=0)), 1e-9)
    misfit: Floats = np.clip(relative, LEAST, 2.0) ** 2
    return misfit
