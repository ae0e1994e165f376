"""Models of your own beside the learner: gradient boosting, and a small recurrent network.

Whatever has scikit-learn's fit, predict and get_params goes through the same folds, intervals and valid range. It gets
the learner's features, of which play states are the memory of a cable. A row comes alone: a network that looks back
takes earlier positions, here 1.6 s of them, as further signals. This one is an echo state network: random recurrent
weights, and a ridge regression on its last state. The table shows RMSE, the share that intervals hold, and a tick.
"""

from dataclasses import replace

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.linear_model import Ridge

import catenary


def with_past(log: catenary.MotionLog) -> catenary.MotionLog:
    past = {  # every fourth of 48 rows, the earliest first
        f"{joint}, {rows} rows ago": log.q_nominal[np.maximum(np.arange(len(log)) - rows, 0), k]
        for rows in range(48, 0, -4)
        for k, joint in enumerate(log.joint_names)
    }
    return replace(log, signals=past, signal_units=dict(zip(past, log.joint_units * 12, strict=True)))


class EchoState(RegressorMixin, BaseEstimator):
    def __init__(self, units=80):
        self.units = units

    def states(self, X):
        rng, state = np.random.default_rng(0), np.zeros((len(X), self.units))
        into, back = rng.normal(size=(3, self.units)), rng.normal(size=(self.units, self.units))
        for now in np.hstack([X[:, 3:], X[:, :3]]).reshape(len(X), -1, 3).swapaxes(0, 1):
            state = np.tanh(now @ into + 0.9 * state @ back / np.sqrt(self.units))
        return np.hstack([state, X[:, :3]])

    def fit(self, X, y):
        self.readout_ = Ridge(1.0).fit(self.states(X), y)
        return self

    def predict(self, X):
        return self.readout_.predict(self.states(X))


rng, arm = np.random.default_rng(0), catenary.CablePlant(seed=0)
arm.home()
drives = [catenary.record_simulated(arm, catenary.random_sinusoids(rng, s), f"{s} s", rng) for s in (120.0, 60.0)]
train, test = map(with_past, drives)
models = {"learned": {}, "boosting": {"model": HistGradientBoostingRegressor(max_iter=50)}}
models["echo state"] = {"model": EchoState(), "play": (), "inputs": ["q", *train.signals]}
print(f"{'':12} shoulder [deg]  elbow [deg]  insertion [mm]   held      tick")
for name, options in models.items():
    model = catenary.fit(train, **options)
    joints = model.evaluate(test).joints
    held = np.mean([joint.coverage for joint in joints])
    tick = f"{1e3 * model.corrector().tick_seconds():7.2f} ms"
    print(f"{name:12}" + "".join(f"{joint.rmse:14.3f}" for joint in joints), f"{held:8.0%}", tick)
