"""Torques that cannot be those of the motion: of the wrong sign, of other axes, or no torques but currents."""

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
    """Find torques under another gravity, of the wrong sign, of swapped axes, or in another unit.

    Args:
        result: What was identified; where the recording was fitted, by a free fit: friction of a wrong sign tells.
        fitted: It is one of those that were fitted.
        may_carry: The arm may carry a load, which makes torques of some axes many times those of the arm alone.
    """
    if fitted:
        stated = np.array(result.options.gravity)
        if (mounting := mounting_finding(result.model, _some_rows(samples), stated)) is not None:
            return [mounting]
    own = result.training if fitted else result.tests
    residual = next(r for r in own if r.log == samples.name)
    with np.errstate(invalid="ignore"):
        doubtful = bool(np.any(residual.relative_rms > DOUBTFUL)) or residual.verdict not in (None, "holds")
    pair, left = swapped_axes(result, samples, refit=fitted) if doubtful else (None, 1.0)
    axis, left_when_turned = _turned(result, samples, fitted) if doubtful else (None, 1.0)
    if pair is not None and (axis is None or left < left_when_turned):
        names = result.model.joint_names
        a, b = names[pair[0]], names[pair[1]]
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
    findings, against = _known_torques(result, samples, fitted, may_carry)
    # an axis turned round spoils the friction of those that move with it: what one sign mends is that axis
    turned = set() if axis is None else {axis}
    if fitted and not turned:
        driven, braked = _by_friction(result, samples)
        # torques that fit together, of which friction brakes none, are all counted the other way
        turned = set(range(result.model.n)) if len(driven) > 1 and not braked else driven
    turned |= against
    return findings + [
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


def _turned(result: Identification, samples: Samples, refit: bool) -> tuple[int | None, float]:
    """Return the axis whose torque, turned round, leaves clearly less residual, or None, and the share left."""
    rows = _some_rows(samples)
    before, best, axis = _misfit(result, rows, refit), MENDED, None
    for i in range(samples.tau.shape[1]):
        sign = np.ones(samples.tau.shape[1])
        sign[i] = -1.0
        # what is known beforehand was subtracted with its own sign
        turned = replace(rows, tau=(rows.tau + rows.known) * sign - rows.known)
        left = float(np.prod(_misfit(result, turned, refit) / before))
        if left < best:
            best, axis = left, i
    return axis, best


def _known_torques(
    result: Identification, samples: Samples, fitted: bool, may_carry: bool
) -> tuple[list[Finding], set[int]]:
    """Compare torques with those of the robot file's masses, or of a test with those of what was identified.

    Returns:
        A finding on axes whose torque is many times that, or a fraction, and the axes where it has the other sign.
    """
    model = result.model
    whose = "the robot's own masses" if fitted else "what was identified"
    rows = _some_rows(samples)
    if not fitted:
        own = result.predict_samples(rows)
    elif model.missing_inertia:
        return [], set()
    else:
        down = rows.gravity_rows(np.array(result.options.gravity))
        own = torque_regressor(model, rows.q, rows.qd, rows.qdd, down, rows.base_motion()) @ link_parameters(model.tree)
    found, against, as_expected = [], set[int](), 0
    for i in range(model.n):
        # friction, a constant and, of a file that has none, a rotor are beside the model's own torque, of any size
        speed, one = rows.qd[:, i], np.ones(len(rows))
        beside = np.column_stack([np.sign(speed), speed, one, *([rows.qdd[:, i]] if fitted else [])])
        given, measured = (v - beside @ np.linalg.lstsq(beside, v)[0] for v in (own[:, i], rows.tau[:, i]))
        size, torque = float(np.linalg.norm(given)), float(np.linalg.norm(measured))
        if size <= TOLD * np.linalg.norm(own[:, i]) or torque <= TOLD * np.linalg.norm(rows.tau[:, i]):
            continue
        ratio, correlation = float(given @ measured) / size**2, float(given @ measured) / size / torque
        if not fitted:  # what was identified has them itself
            correlation = float(np.corrcoef(own[:, i], rows.tau[:, i])[0, 1])
        if correlation < -EXPLAINED and ratio < 0.0:
            against.add(i)
        if abs(correlation) > EXPLAINED:
            if RATIO[0] < abs(ratio) < RATIO[1]:
                as_expected += 1
            else:
                found.append((model.joint_names[i], ratio))
    if may_carry and as_expected:
        # another unit is all axes' or a smaller one; beside axes as expected, a load on light links explains more
        found = [(name, ratio) for name, ratio in found if abs(ratio) < RATIO[1]]
    if not found:
        return [], against
    ratios = ", ".join(f"{name} {ratio:.3g}" for name, ratio in found)
    return [
        Finding(
            "torques",
            tuple(name for name, _ in found),
            f"torques over those of {whose} are {ratios}, expected {RATIO[0]:g} to {RATIO[1]:g}",
            "motor currents, or torques at the motor, read as joint torques",
            " ".join(f"--scale tau:{name}={1.0 / abs(ratio):.4g}" for name, ratio in found),
        )
    ], against


# untouched recordings of five real arms keep 0.95 or more
CLEARLY = 0.4  # of the product of all axes' mean squares: at most this is left when two are swapped back


def swapped_axes(
    result: Identification, samples: Samples, *, refit: bool = False
) -> tuple[tuple[int, int] | None, float]:
    """Return the pair of axes whose swapping back removes most of all axes' residual, or None, and the share left.

    Positions with velocities and torques are swapped, or torques alone.
    """
    rows = _some_rows(samples)
    before = _misfit(result, rows, refit)
    best, pair = CLEARLY, None
    for i, j in combinations(range(rows.q.shape[1]), 2):
        for keys in (("q", "qd", "qdd", "tau"), ("tau",)):
            order = np.arange(rows.q.shape[1])
            order[[i, j]] = j, i
            swapped: dict[str, Any] = {key: getattr(rows, key)[:, order] for key in keys}
            after = _misfit(result, replace(rows, **swapped), refit)
            left = float(np.prod(after / before))
            if left < best:
                best, pair = left, (i, j)
    return pair, best


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
