"""Random predictors and models, and what they must give, in plain NumPy."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.feature_terms import Terms
from catenary.calibration.features import FeatureSet, FrictionStates
from catenary.calibration.model import CalibrationModel, JointGroup, Target
from catenary.calibration.predictors import Activation, Expansion, Leverage, Network, Predictor, linear
from catenary.calibration.valid_range import fit_valid_range
from catenary.plant import MotionLog
from catenary.transmission.cable_friction import coupled_friction

PREDICTORS = ("constant", "linear", "quadratic", "tanh", "logistic", "expansion")
MIXED = "each joint its own"  # as those of model auto, which files may hold


def random_predictor(name: str, inputs: int, outputs: int, rng: np.random.Generator) -> Predictor:
    """Draw a predictor of one of PREDICTORS."""
    n = rng.normal
    if name in ("constant", "linear"):
        return linear((name == "linear") * n(size=(inputs, outputs)), n(size=outputs))
    if name == "quadratic":
        pairs = np.column_stack(np.triu_indices(inputs))
        terms = Terms.plain(n(size=inputs), np.exp(0.3 * n(size=inputs)), pairs)
        return Expansion(terms, n(size=(len(terms), outputs)), n(size=outputs))
    if name == "expansion":
        return random_expansion(inputs, outputs, rng)
    hidden = tuple(int(width) for width in rng.integers(1, 20, size=rng.integers(0, 4)))
    return random_network((inputs, *hidden, outputs), "tanh" if name == "tanh" else "logistic", rng)


def random_expansion(inputs: int, outputs: int, rng: np.random.Generator) -> Expansion:
    """Draw a linear function of terms of which every kind occurs where inputs suffice."""
    every, n = np.arange(inputs), rng.normal
    pairs = rng.integers(0, inputs, (3, 2)) if inputs else np.zeros((0, 2), dtype=np.int64)
    scale, limit = np.exp(0.3 * n(size=inputs)), rng.uniform(0.5, 1.9, inputs)
    terms = Terms(n(size=inputs), scale, limit, every[::2], every[::4], every[1::2], pairs)
    sketch = 0.3 * n(size=(len(terms), 5)), n(size=5), 1.0, rng.uniform(0.0, 2.0, outputs), np.ones(outputs)
    weights = n(size=(len(terms), outputs)), n(size=outputs)
    return Expansion(terms, *weights, leverage=Leverage(*sketch))


def expanded(terms: Terms, X: Floats) -> Floats:
    """Give the terms (N, C) of features (N, F) by NumPy's functions."""
    Z = (X - terms.middle) / terms.scale
    held = np.clip(Z, -terms.limit, terms.limit)
    columns = [Z]
    for j in terms.positions:
        waves = np.cos(0.5 * np.pi * np.arange(4, 13) * (held[:, [j]] + 1.0))
        columns += [held[:, [j]] ** 2, held[:, [j]] ** 3, waves]
    for j in terms.angles:
        a = terms.middle[j] + terms.scale[j] * held[:, [j]]
        columns += [f(k * a) for k in (1, 2, 3) for f in (np.sin, np.cos)]
    columns += [f(held[:, [j]]) for j in terms.loads for f in (np.tanh, np.abs)]
    columns += [held[:, [j]] * held[:, [k]] for j, k in terms.pairs]
    return np.hstack(columns)


def random_network(widths: tuple[int, ...], activation: Activation, rng: np.random.Generator) -> Network:
    """Draw a network with layers of the given widths, the inputs' first."""
    n = rng.normal
    return Network(
        mean=n(size=widths[0]),
        scale=np.exp(0.3 * n(size=widths[0])),
        weights=tuple(n(size=(a, b)) / np.sqrt(a) for a, b in pairwise(widths)),
        biases=tuple(n(size=b) for b in widths[1:]),
        activation=activation,
        out_mean=n(size=widths[-1]),
        out_scale=np.exp(n(size=widths[-1])),
    )


def predicted(predictor: Predictor, X: Floats) -> Floats:
    """Give a predictor's outputs (N, m) by matrix products and the C library's functions."""
    if isinstance(predictor, Expansion):
        return expanded(predictor.terms, X) @ predictor.weights + predictor.bias
    assert isinstance(predictor, Network)
    Z = (X - predictor.mean) / predictor.scale
    for W, b in zip(predictor.weights[:-1], predictor.biases[:-1], strict=True):
        Z = Z @ W + b
        Z = np.tanh(Z) if predictor.activation == "tanh" else 1.0 / (1.0 + np.exp(-Z))
    return (Z @ predictor.weights[-1] + predictor.biases[-1]) * predictor.out_scale + predictor.out_mean


def random_model(
    kind: str,
    signals: Floats,
    rng: np.random.Generator,
    *,
    joints: int,
    torques: int = 0,
    plays: int = 0,
    coupled: int = 0,
    along: bool = False,
    target: Target = "error",
    per_joint: bool = False,
) -> CalibrationModel:
    """Draw a model of joints j0, j1, ... whose valid range is that of a recording.

    Args:
        kind: One of PREDICTORS, or MIXED: joints have predictors, inputs and margins of their own.
        signals: (N, joints + torques) that the valid range is fitted to.
        rng: Source of randomness.
        joints: Number of joints; all their positions are inputs.
        torques: Number of torques among the inputs.
        plays: Play states of every position.
        coupled: How many joints, the first, have friction states.
        along: Whether play states of the first joint follow a path that the second moves too.
        target: What the predictors give.
        per_joint: Every joint takes its own signals only.
    """
    names = tuple(f"j{k}" for k in range(joints))
    units = tuple("m" if k % 3 == 2 else "rad" for k in range(joints))
    force = {"rad": "Nm", "m": "N"}
    features = FeatureSet(
        (*(f"q:{name}" for name in names), *(f"tau:{name}" for name in names[:torques])),
        (*units, *(force[unit] for unit in units[:torques])),
        (*((f"q:{name}", 0.1 * (k + 1)) for name in names for k in range(plays)), *[("path", 0.07)] * along),
        random_friction(names[:coupled], rng) if coupled else None,
        paths=(("path", "q:j0", "q:j1", -0.4),) * along,
    )
    X = features.matrix(log_of(names, units, signals, torques))
    X = X[np.isfinite(X).all(axis=1)]
    groups = []
    for group in [(j,) for j in range(joints)] if per_joint or kind == MIXED else [tuple(range(joints))]:
        own = [s for s in features.signals if kind == MIXED or any(s.endswith(f":j{j}") for j in group)]
        columns, margin, of_group = features.columns_of(own), 0.1, kind
        if kind == MIXED:
            of_group, margin = PREDICTORS[-1 - group[0]], 0.1 * (1 + group[0])
            columns = columns[group[0] :: 1 + group[0]]
        watched = columns[~features.bounded[columns]]
        predictor = random_predictor(of_group, len(columns), len(group), rng)
        groups.append(JointGroup(group, columns, predictor, fit_valid_range(X[:, watched], margin), watched))
    return CalibrationModel(
        kind="neural",
        preset=None,
        joint_names=names,
        joint_units=units,
        features=features,
        target=target,
        offset=rng.normal(size=joints),
        largest=np.full(joints, 1e3),  # beyond what any of them gives
        groups=tuple(groups),
    )


def random_friction(joints: tuple[str, ...], rng: np.random.Generator) -> FrictionStates:
    """Draw three systems of springs and friction elements between joints."""
    n = len(joints)
    root = rng.normal(size=(n, n))
    friction = coupled_friction(
        np.linalg.inv(root @ root.T + np.eye(n)),
        np.eye(n) + 0.3 * rng.normal(size=(n, n)),
        rng.uniform(0.02, 0.6, (3, n)),
        np.full(n, 0.1),
    )
    return FrictionStates.of(tuple(f"q:{joint}" for joint in joints), friction)


def log_of(names: tuple[str, ...], units: tuple[str, ...], signals: Floats, torques: int = 0) -> MotionLog:
    """Make a recording of signals (N, n + torques): positions of joints, torques of the first few."""
    n = len(names)
    tau = np.zeros((len(signals), n))
    tau[:, :torques] = signals[:, n : n + torques]
    return MotionLog(
        name="run",
        joint_names=names,
        joint_units=units,
        q_nominal=signals[:, :n],
        ok=np.ones(len(signals), dtype=bool),
        tau=tau,
    )


def ticked(
    corrector: Corrector, q: Floats, signals: Floats, widths: Floats | None = None
) -> tuple[Floats, NDArray[np.bool_]]:
    """Return calibrated positions of a motion and flags, (N, n) each, tick by tick from its first row on.

    Half-widths of intervals go into `widths` (N, n).
    """
    out, inside = np.empty(q.shape), np.empty(q.shape, dtype=bool)
    corrector.reset()
    for k in range(len(q)):
        corrector.correct(q[k], signals[k], out[k], inside[k], *(() if widths is None else (widths[k],)))
    return out, inside
