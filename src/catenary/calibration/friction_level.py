"""The level of a day's friction: what differs most from one day to another of joints that friction couples.

Springs and weights of a model stay; its thresholds are multiplied by a factor for each friction element. Factors are
compared by what they leave of the coupled joints' errors about a new zero, and by how far from 1 they are, in
logarithms of which days have a spread of _LOG_LEVEL_SPREAD. Blocks of time that a factor was not found on judge it.
"""

from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.dataset import CalibrationData, usable_rows
from catenary.calibration.friction_states import FrictionStates
from catenary.calibration.model import CalibrationModel
from catenary.calibration.recordings import Recordings

_LOG_LEVELS = (0.0, -0.25, 0.25, -0.5, -0.75)  # logarithms of factors that are tried; the first changes nothing
_LOG_LEVEL_SPREAD = 0.4  # of a day's friction, in its logarithm, about the mean
_CORRELATED_ROWS = 40  # neighbouring rows that count as one
_STANDARD_ERRORS = 2.0  # standard errors by which another level must be better
_MAX_LOSS_SHARE = 0.1  # of what coupled joints gain, that another may lose


class DayLevel(NamedTuple):
    """A model at a day's level of friction."""

    model: CalibrationModel
    data: CalibrationData  # the day's rows, those of each block with features at the level that all others show
    before: Floats  # (N, n) errors of the old model on these rows [rad|m]
    factors: dict[str, float]  # of the friction of each coupled joint
    joints: tuple[int, ...]  # that take friction states


def levels_tried(elements: int) -> Floats:
    """Return logarithms of factors on the thresholds of friction elements, (C, m): each its own of two, else one."""
    return np.array(
        [*product(_LOG_LEVELS, repeat=elements)] if elements == 2 else [[each] * elements for each in _LOG_LEVELS]
    )


def best_level(left: Floats, tried: Floats) -> int:
    """Return which levels (C, m) leave least of errors (C, N, j) about their mean, nearest to 0 if alike."""
    spread = 0.5 * left.shape[1] / _CORRELATED_ROWS * np.log(np.maximum(left.var(axis=1), 1e-30)).sum(axis=1)
    return int(np.argmin(spread + 0.5 * np.square(tried / _LOG_LEVEL_SPREAD).sum(axis=1)))


def _rows_at(
    model: CalibrationModel, recordings: Recordings, friction: FrictionStates, level: Floats
) -> CalibrationData:
    """Return rows of recordings for a model whose friction thresholds are multiplied by exp(level), level (m,)."""
    thresholds = tuple(map(tuple, (np.array(friction.thresholds) * np.exp(level)).tolist()))
    features = replace(model.features, friction=replace(friction, thresholds=thresholds))
    return usable_rows(recordings, features)


def find_level(model: CalibrationModel, recordings: Recordings, blocks: int) -> DayLevel | None:
    """Return the model at the level of friction that recordings of a day show; None where they show no other.

    It must leave less of the coupled joints' error, by _STANDARD_ERRORS on blocks of time that it was not
    found on, and of no joint that takes friction states more than a tenth of that.
    """
    friction = model.features.friction
    if friction is None:
        return None
    tried = levels_tried(len(friction.directions))
    names = [position.removeprefix("q:") for position in friction.positions]
    lags = {name for name, _ in friction.columns}
    columns = [i for i, name in enumerate(model.features.names) if name in lags]
    taking = [j for group in model.groups if np.isin(columns, group.columns).any() for j in group.joints]
    coupled = [k for k, j in enumerate(taking) if model.joint_names[j] in names]
    if not coupled:
        return None
    parts = []
    for level in tried:
        data = _rows_at(model, recordings, friction, level)
        parts.append((data.error - model.correction(data.X, data.q_nominal))[:, taking])
    left = np.array(parts)
    block = np.arange(left.shape[1]) * blocks // left.shape[1]
    best = [best_level(left[:, block != k][..., coupled], tried) for k in range(blocks)]

    def rmse(c: int, k: int) -> Floats:
        away = left[c, block == k] - left[c, block != k].mean(axis=0)
        return np.asarray(np.sqrt(np.mean(away**2, axis=0)))

    gain = np.array([np.log(rmse(0, k) / rmse(best[k], k)) for k in range(blocks)])  # (K, joints)
    of_coupled = gain[:, coupled].mean(axis=1)
    chosen = best_level(left[..., coupled], tried)
    sure = of_coupled.mean() > _STANDARD_ERRORS * of_coupled.std(ddof=1) / np.sqrt(blocks)
    if chosen == 0 or not sure or (gain.mean(axis=0) < -_MAX_LOSS_SHARE * of_coupled.mean()).any():
        return None
    data, new = (_rows_at(model, recordings, friction, tried[c]) for c in (0, chosen))
    before = data.error - model.correction(data.X, data.q_nominal)
    for c in set(best):
        rows = np.isin(block, np.flatnonzero(np.array(best) == c))
        data.X[rows] = _rows_at(model, recordings, friction, tried[c]).X[rows]
    factors = dict(zip(names, np.exp(tried[chosen]).tolist(), strict=False))
    features = new.features
    return DayLevel(replace(model, features=features), replace(data, features=features), before, factors, tuple(taking))
