"""What an afternoon with scikit-learn gives: ridge regression with direction or play states, and a network."""

import warnings
from collections.abc import Callable, Sequence

import numpy as np
from numba import njit
from sklearn.linear_model import Ridge
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from catenary.plant import MotionLog

KINDS = ("ridge with direction", "ridge with play", "network with direction")


@njit(cache=True)
def _direction(q, eps):  # type: ignore[no-untyped-def]
    d = np.zeros_like(q)
    for j in range(q.shape[1]):
        last, s = q[0, j], 0.0
        for i in range(len(q)):
            m = q[i, j] - last
            if abs(m) > eps:
                s = np.sign(m)
                last = q[i, j]
            d[i, j] = s
    return d


@njit(cache=True)
def _play(q, r):  # type: ignore[no-untyped-def]
    o = np.zeros_like(q)
    for j in range(q.shape[1]):
        p = q[0, j]
        for i in range(len(q)):
            p = min(max(p, q[i, j] - r), q[i, j] + r)
            o[i, j] = q[i, j] - p
    return o


def _columns(log: MotionLog, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Return inputs (N, F), positions in deg and mm, and the scale (n,) to these."""
    turns = np.array(log.joint_units) != "m"
    scale = np.where(turns, 180 / np.pi, 1e3)
    q, angles = log.q_nominal * scale, log.q_nominal[:, turns]
    columns = [q, q**2 / 100, np.sin(angles), np.cos(angles), *([] if log.tau is None else [log.tau])]
    columns.append(_direction(q, 0.1))
    columns += [_play(q, r) for r in (0.05, 0.2, 0.5, 1.0, 2.0, 4.0)] if "play" in kind else []
    return np.hstack(columns), scale


def fit(logs: Sequence[MotionLog], kind: str) -> Callable[[MotionLog], np.ndarray]:
    """Return the correction (N, n) [rad|m] of a log, learnt from logs."""
    parts = [(*_columns(log, kind), log) for log in logs]
    A = np.vstack([x for x, _, _ in parts])
    Y = np.vstack([(log.q_encoder - log.q_nominal) * scale for _, scale, log in parts])
    offset, spread, scale = Y.mean(axis=0), Y.std(axis=0), parts[0][1]
    every = max(1, len(A) // (15000 if "network" in kind else 60000))
    network = MLPRegressor(hidden_layer_sizes=(48, 48), early_stopping=True, max_iter=60, random_state=0)
    model = make_pipeline(StandardScaler(), network if "network" in kind else Ridge(1.0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(A[::every], ((Y - offset) / spread)[::every])
    return lambda log: (model.predict(_columns(log, kind)[0]).reshape(-1, len(spread)) * spread + offset) / scale
