"""How feed-forward networks are trained: the paper's way, and ours."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from catenary.arrays import Floats
from catenary.calibration.backpropagation import NO_PENALTIES, Penalties, TrainedNetwork
from catenary.calibration.predictors import Activation, Linear, Network
from catenary.calibration.progress import Progress, part_of, silent
from catenary.calibration.regression import fit_linear
from catenary.calibration.valid_range import standardisation

MANY_ROWS = 10_000


@dataclass(frozen=True)
class NetworkSettings:
    """Size of a network, and how it is trained."""

    hidden: tuple[int, ...]
    activation: Activation
    l2: float | tuple[float, ...]  # factor of the sum of squared weights beside the mean squared error
    learning_rate: float
    batch: int
    epochs: int
    cosine: bool = False  # learning rate falls to zero along half a cosine
    skip_ridge: float | None = None  # of a linear model that the network corrects; None for no such model
    penalties: Penalties = NO_PENALTIES  # beside `l2`


# Peng et al., section IV-B: two hidden layers of 100 sigmoid units, mean squared error, L2 5e-4 on the kernels,
# Adam 1e-3 (0.9, 0.999), batch 1024, 200 epochs. Input and output scaling is not stated: we standardise both.
PAPER = NetworkSettings((100, 100), "logistic", 5e-4, 1e-3, 1024, 200)
# Section II-H, for all 138 columns of the robot's state: kernel L1 1e-5 and L2 1e-4, bias L2 1e-4, activity L2 1e-5. It
# is not stated of which layers: here weights and biases of all, outputs of the hidden ones.
PAPER_LARGER = NetworkSettings(
    (600, 500, 400),
    "logistic",
    1e-4,
    1e-3,
    1024,
    200,
    penalties=Penalties(l1=1e-5, bias_l2=1e-4, activity_l2=1e-5),
)
# Ours: a linear model carries what is linear, the network learns the rest; how much it is held back is chosen
# on the last fifth of the training data.
BEST = NetworkSettings(
    (100, 100), "tanh", (1e-5, 1e-4, 1e-3, 3e-3, 1e-2), 3e-3, 256, 60, cosine=True, skip_ridge=10.0
)


def fit_neural(
    X: Floats,
    Y: Floats,
    settings: NetworkSettings,
    *,
    seed: int,
    late: np.ndarray,
    linear: Callable[[Floats, Floats], Linear] | None = None,
    progress: Progress = silent,
) -> Network:
    """Train a network to give Y (N, m) from features X (N, F).

    Minimises mean((Y - f(X))^2) over rows and outputs + l2 * sum of squared weights + other penalties, on
    standardised X and Y (Keras's loss, as the paper's). Where the settings name several `l2`, the one that does best
    on the rows marked `late` (N,) after training on the others is taken.

    Args:
        X: Features.
        Y: Targets.
        settings: Shape and training of the network.
        seed: Of the initial weights and the order of the rows.
        late: Rows to choose `l2` on.
        linear: Fits the linear model that the network corrects, in place of ridge regression.
        progress: Called with the share done.
    """
    candidates = settings.l2 if isinstance(settings.l2, tuple) else (settings.l2,)
    if not late.any() or late.all():
        candidates = candidates[:1]
    trials = len(candidates) if len(candidates) > 1 else 0
    # a third of the training tells candidates apart where a pass over the data has many steps
    short = settings if len(X) <= MANY_ROWS else replace(settings, epochs=max(1, settings.epochs // 3))
    losses = np.zeros(len(candidates))
    if linear is None and settings.skip_ridge is not None:
        linear = partial(fit_linear, ridge=settings.skip_ridge)
    with threadpool_limits(limits=1):  # two BLAS threads on two busy cores are slower than one
        before = linear(X[~late], Y[~late]) if trials and linear is not None else None
        for i in range(trials):
            part = part_of(progress, i, trials + 1)
            trial = _train(X[~late], Y[~late], short, candidates[i], seed, before, part)
            errors = np.mean((trial.predict(X[late]) - Y[late]) ** 2, axis=0)
            losses[i] = np.mean(np.log(errors + 1e-30))  # a noisy output must not outweigh the others
        chosen = candidates[int(np.argmin(losses))]
        skip = None if linear is None else linear(X, Y)
        return _train(X, Y, settings, chosen, seed, skip, part_of(progress, trials, trials + 1))


def _train(
    X: Floats,
    Y: Floats,
    settings: NetworkSettings,
    l2: float,
    seed: int,
    skip: Linear | None,
    progress: Progress,
) -> Network:
    mean, scale = standardisation(X)
    out_mean, out_scale = standardisation(Y)
    if skip is not None:
        target, out_mean = (Y - skip.predict(X)) / out_scale, np.zeros_like(out_mean)
    else:
        target = (Y - out_mean) / out_scale
    # an output that a constant or the linear model gives exactly gets no ripple from the network
    out_scale = np.where(np.ptp(target, axis=0) > 1e-9, out_scale, 0.0)
    # single precision trains twice as fast, as Keras does
    Z, wanted = ((X - mean) / scale).astype(np.float32), target.astype(np.float32)
    rng = np.random.default_rng(seed)
    network = TrainedNetwork((Z.shape[1], *settings.hidden, wanted.shape[1]), settings.activation, seed)
    batches = -(-len(Z) // settings.batch)
    steps, step = settings.epochs * batches, 0
    for epoch in range(settings.epochs):
        order = rng.permutation(len(Z))
        # Keras leaves a small batch for the end; batches alike are better for a rate that falls
        parts = batches if settings.cosine else range(settings.batch, len(Z), settings.batch)
        for rows in np.array_split(order, parts):
            rate = settings.learning_rate
            if settings.cosine:
                rate *= 0.5 * (1.0 + np.cos(np.pi * step / steps))
            network.step(network.gradient(Z[rows], wanted[rows], l2, settings.penalties), rate)
            step += 1
        progress((epoch + 1) / settings.epochs)
    return Network(
        mean=mean,
        scale=scale,
        weights=tuple(W.astype(np.float64) for W in network.weights),
        biases=tuple(b.astype(np.float64) for b in network.biases),
        activation=settings.activation,
        out_mean=out_mean,
        out_scale=out_scale,
        skip=skip,
    )
