"""A recurrent network over the previous commands, as Hwang et al. calibrate a dVRK (RA-L 2020; T-ASE 2022).

Their public code (BerkeleyAutomation/dvrkCalibration) has one layer of 120 LSTM units over the four previous commands
and the present one, a linear layer on its last state, mean squared error, Adam with 1e-3 and batches of 100 rows. They
learn positions; here the network learns joint errors, which the calibration paper found better (II-J), from inputs
and errors that are both standardised. Torques, where recorded, are inputs too: it knows what our models know.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit
from threadpoolctl import threadpool_limits

from catenary.arrays import Floats
from catenary.calibration.neural import Adam
from catenary.calibration.valid_range import standardisation
from papers.calibration.peers.rows import Places, Rows

UNITS, PREVIOUS = 120, 4
ITERATIONS, BATCH, RATE = 5000, 100, 1e-3
BLOCK = 4096  # rows that are predicted at once
Numbers = NDArray[Any]


@dataclass
class Lstm:
    """One layer of LSTM units and a linear layer.

    [Hochreiter and Schmidhuber 1997, with forget gates]

    [i f o g] = [x h] W + b,   c <- sigma(f) c + sigma(i) tanh(g),   h <- sigma(o) tanh(c),   y = h V + v
    """

    W: Numbers  # (F + H, 4 H)
    b: Numbers  # (4 H,)
    V: Numbers  # (H, m)
    v: Numbers  # (m,)

    @classmethod
    def drawn(cls, inputs: int, units: int, outputs: int, rng: np.random.Generator, dtype: Any) -> "Lstm":
        """Draw weights uniformly within 1 / sqrt(units), as PyTorch does."""
        bound = 1.0 / np.sqrt(units)
        shapes = ((inputs + units, 4 * units), (4 * units,), (units, outputs), (outputs,))
        return cls(*(rng.uniform(-bound, bound, shape).astype(dtype) for shape in shapes))

    @property
    def parameters(self) -> list[Numbers]:
        """Return the arrays that are learned."""
        return [self.W, self.b, self.V, self.v]

    def outputs(self, X: Numbers, kept: list[tuple[Numbers, ...]] | None = None) -> Numbers:
        """Return the outputs (N, m) after sequences X (N, T, F); keep what a gradient needs in a list."""
        units = len(self.V)
        h = np.zeros((len(X), units), dtype=X.dtype)
        c = np.zeros_like(h)
        for t in range(X.shape[1]):
            below = np.concatenate((X[:, t], h), axis=1)
            z = below @ self.W + self.b
            gates, g = expit(z[:, : 3 * units]), np.tanh(z[:, 3 * units :])
            i, f, o = (gates[:, k * units : (k + 1) * units] for k in range(3))
            before, c = c, f * c + i * g
            squashed = np.tanh(c)
            h = o * squashed
            if kept is not None:
                kept.append((below, before, i, f, o, g, squashed))
        if kept is not None:
            kept.append((h,))
        return h @ self.V + self.v

    def gradient(self, X: Numbers, Y: Numbers) -> list[Numbers]:
        """Return the gradient of the mean squared error, by back-propagation through sequences X (N, T, F)."""
        kept: list[tuple[Numbers, ...]] = []
        units = len(self.V)
        delta = 2.0 * (self.outputs(X, kept) - Y) / Y.size
        (h,) = kept.pop()
        by_V, by_v = h.T @ delta, delta.sum(axis=0)
        by_W, by_b = np.zeros_like(self.W), np.zeros_like(self.b)
        dh = delta @ self.V.T
        dc = np.zeros_like(dh)
        for below, before, i, f, o, g, squashed in reversed(kept):
            dc = dc + dh * o * (1.0 - squashed**2)
            dz = np.concatenate(
                (
                    dc * g * i * (1.0 - i),
                    dc * before * f * (1.0 - f),
                    dh * squashed * o * (1.0 - o),
                    dc * i * (1.0 - g**2),
                ),
                axis=1,
            )
            by_W += below.T @ dz
            by_b += dz.sum(axis=0)
            dh = dz @ self.W[-units:].T
            dc = dc * f
        return [by_W, by_b, by_V, by_v]


@dataclass(frozen=True)
class Recurrent:
    """A trained network, and how its inputs are scaled and spaced."""

    network: Lstm
    mean: Floats
    scale: Floats
    out_mean: Floats
    out_scale: Floats
    previous: int
    spacing: int  # rows between the commands of a sequence

    def sequences(self, rows: Rows, which: Places) -> Numbers:
        """Return scaled sequences (M, T, F) that end at some rows, oldest first."""
        places = sequence_places(rows.first[which], which, self.previous, self.spacing)
        return ((rows.inputs[places] - self.mean) / self.scale).astype(np.float32)

    def correction(self, rows: Rows, at: Places | None = None) -> Floats:
        """Return what to add to the reported positions of every row, or of rows `at`, (N, n) [rad|m]."""
        at = np.arange(len(rows.inputs)) if at is None else at
        parts = [
            self.network.outputs(self.sequences(rows, at[first : first + BLOCK])) for first in range(0, len(at), BLOCK)
        ]
        corrected: Floats = self.out_mean + self.out_scale * np.concatenate(parts).astype(float)
        return corrected


def sequence_places(first: Places, last: Places, previous: int, spacing: int) -> Places:
    """Return the rows (M, previous + 1) of sequences; what lies before a motion's first row is that row."""
    back = spacing * np.arange(previous, -1, -1)
    places: Places = np.maximum(last[:, None] - back, first[:, None])
    return places


def fit_recurrent(
    rows: Rows,
    *,
    seed: int,
    spacing: int = 1,
    units: int = UNITS,
    previous: int = PREVIOUS,
    iterations: int = ITERATIONS,
) -> Recurrent:
    """Train a network on the rows with a measurement, the commands of a sequence `spacing` rows apart."""
    rng = np.random.default_rng(seed)
    which = np.flatnonzero(rows.known)
    mean, scale = standardisation(rows.inputs[which])
    out_mean, out_scale = standardisation(rows.error[which])
    network = Lstm.drawn(rows.inputs.shape[1], units, rows.error.shape[1], rng, np.float32)
    model = Recurrent(network, mean, scale, out_mean, out_scale, previous, spacing)
    target = ((rows.error - out_mean) / out_scale).astype(np.float32)
    adam = Adam(network.parameters)
    with threadpool_limits(limits=1):
        for _ in range(iterations):
            batch = rng.choice(which, min(BATCH, len(which)), replace=False)
            slopes = network.gradient(model.sequences(rows, batch), target[batch])
            adam.step(network.parameters, slopes, RATE)
    return model
