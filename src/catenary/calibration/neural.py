"""How feed-forward networks are trained: the paper's way, and ours."""

import warnings
from dataclasses import dataclass, replace

import numpy as np
from sklearn.neural_network import MLPRegressor
from threadpoolctl import threadpool_limits

from catenary.arrays import Floats
from catenary.calibration.predictors import Activation, Network
from catenary.calibration.progress import Progress, part_of, silent
from catenary.calibration.regression import fit_linear
from catenary.calibration.valid_range import standardisation

MANY_ROWS = 10_000


@dataclass(frozen=True)
class NetworkSettings:
    """How a network is made and trained."""

    hidden: tuple[int, ...]
    activation: Activation
    l2: float | tuple[float, ...]  # factor of the sum of squared weights beside the mean squared error
    learning_rate: float
    batch: int
    epochs: int
    cosine: bool = False  # learning rate falls to zero along half a cosine
    skip_ridge: float | None = (
        None  # ridge of a linear model that the network corrects; None for no such model
    )


# Peng et al., section IV-B: two hidden layers of 100 sigmoid units, mean squared error, L2 5e-4 on the kernels,
# Adam 1e-3 (0.9, 0.999), batch 1024, 200 epochs. Input and output scaling is not stated: we standardise both.
PAPER = NetworkSettings((100, 100), "logistic", 5e-4, 1e-3, 1024, 200)
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
    progress: Progress = silent,
) -> Network:
    """Train a network to give Y (N, m) from features X (N, F).

    Minimises mean((Y - f(X))^2) over rows and outputs + l2 * sum of squared weights, on standardised X and Y
    (Keras's loss, as the paper's). Where the settings name several `l2`, the one that does best on the rows
    marked `late` (N,) after training on the others is taken.

    Args:
        X: Features.
        Y: Targets.
        settings: Shape and training of the network.
        seed: Of the initial weights and the order of the rows.
        late: Rows to choose `l2` on.
        progress: Called with the share done.
    """
    candidates = settings.l2 if isinstance(settings.l2, tuple) else (settings.l2,)
    runs = len(candidates) + 1 if len(candidates) > 1 else 1
    with threadpool_limits(limits=1):  # two BLAS threads on two busy cores are slower than one
        chosen = candidates[0]
        if len(candidates) > 1 and late.any() and not late.all():
            losses = []
            for i, l2 in enumerate(candidates):
                part = part_of(progress, i, runs)
                # a third of the training tells candidates apart where a pass over the data has many steps
                epochs = settings.epochs if len(X) <= MANY_ROWS else max(1, settings.epochs // 3)
                short = replace(settings, l2=l2, epochs=epochs)
                trial = _train(X[~late], Y[~late], short, seed, part)
                errors = np.mean((trial.predict(X[late]) - Y[late]) ** 2, axis=0)
                losses.append(
                    float(np.mean(np.log(errors + 1e-30)))
                )  # a noisy output must not outweigh the others
            chosen = candidates[int(np.argmin(losses))]
        return _train(X, Y, replace(settings, l2=chosen), seed, part_of(progress, runs - 1, runs))


def _train(X: Floats, Y: Floats, settings: NetworkSettings, seed: int, progress: Progress) -> Network:
    skip = None if settings.skip_ridge is None else fit_linear(X, Y, ridge=settings.skip_ridge)
    mean, scale = standardisation(X)
    out_mean, out_scale = standardisation(Y)
    if skip is not None:
        target, out_mean = (Y - skip.predict(X)) / out_scale, np.zeros_like(out_mean)
    else:
        target = (Y - out_mean) / out_scale
    # an output that a constant or the linear model gives exactly gets no ripple from the network
    out_scale = np.where(np.ptp(target, axis=0) > 1e-9, out_scale, 0.0)
    Z = ((X - mean) / scale).astype(np.float32)  # single precision trains twice as fast, as Keras does
    target = target.astype(np.float32)
    outputs = target.shape[1]
    if outputs == 1:
        target = target[:, 0]  # scikit-learn warns about a single column

    rng = np.random.default_rng(seed)
    regressor = MLPRegressor(
        hidden_layer_sizes=settings.hidden,
        activation=settings.activation,
        solver="adam",
        learning_rate_init=settings.learning_rate,
        tol=0.0,
        shuffle=False,
        random_state=seed,
    )
    batches = max(1, -(-len(Z) // settings.batch))
    steps, step = settings.epochs * batches, 0
    for epoch in range(settings.epochs):
        order = rng.permutation(len(Z))
        for rows in (
            np.array_split(order, batches) if settings.cosine else _keras_batches(order, settings.batch)
        ):
            regressor.alpha = sklearn_alpha(float(np.max(settings.l2)), len(rows), outputs)
            regressor.batch_size = len(rows)
            if settings.cosine and step > 0:
                # scikit-learn has no schedule for Adam; its optimiser reads this at every step
                regressor._optimizer.learning_rate_init = (
                    settings.learning_rate * 0.5 * (1.0 + np.cos(np.pi * step / steps))
                )
            _step(regressor, Z[rows], target[rows])
            step += 1
        progress((epoch + 1) / settings.epochs)
    return Network(
        mean=mean,
        scale=scale,
        weights=tuple(W.astype(np.float64) for W in regressor.coefs_),
        biases=tuple(b.astype(np.float64) for b in regressor.intercepts_),
        activation=settings.activation,
        out_mean=out_mean,
        out_scale=out_scale,
        skip=skip,
    )


def _step(regressor: MLPRegressor, Z: np.ndarray, target: np.ndarray) -> None:
    """Take one step; scikit-learn turns an interrupt within it into a warning, and would train on."""
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message="Training interrupted by user")
        try:
            regressor.partial_fit(Z, target)
        except UserWarning as interrupted:
            raise KeyboardInterrupt from interrupted


def sklearn_alpha(l2: float, rows: int, outputs: int) -> float:
    """Return MLPRegressor's `alpha` for which a step on `rows` rows follows Keras's loss.

    Keras: mean over rows and outputs of the squared error + l2 sum W^2. MLPRegressor steps along
    (sum over rows and outputs of the error's gradient / 2 + alpha W) / rows: its reported loss averages over
    outputs, its gradient does not. Equal directions need alpha = l2 * rows * outputs.
    """
    return l2 * rows * outputs


def _keras_batches(order: np.ndarray, batch: int) -> list[np.ndarray]:
    return [order[i : i + batch] for i in range(0, len(order), batch)]
