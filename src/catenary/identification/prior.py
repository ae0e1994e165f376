"""Masses that a robot's file gives: what identification is drawn to where torques leave a choice, and how strongly."""

from collections.abc import Sequence

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.torque_regressor import PER_LINK, link_parameters
from catenary.identification.base_parameters import BaseParameters
from catenary.identification.columns import Parameters
from catenary.identification.consistency import LEAST_PRIOR, consistent_fit
from catenary.identification.folds import folds_of
from catenary.identification.least_squares import joined, triangles
from catenary.identification.samples import Samples

WEIGHTS = (LEAST_PRIOR, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)  # that held-out blocks choose among
BETTER = 1e-3  # least that a stronger prior takes from the sum over axes of log residual


def prior_of(parameters: Parameters) -> Floats | None:
    """Return the parameters (k,) that the robot's file gives its links, zero where it gives none; None if nowhere."""
    model = parameters.model
    unknown = {*model.missing_inertia, *(model.missing_tensor if parameters.terms == "full" else ())}
    own = link_parameters(model.tree).reshape(-1, PER_LINK)
    prior = np.zeros(len(parameters.names))
    for place, link in enumerate(parameters.links):
        if model.link_names[link] not in unknown:
            prior[parameters.link_columns(place)] = own[link, : parameters.per_link]
    return prior if prior.any() else None


def weight_of_prior(
    base: BaseParameters, gravity: Floats, samples: Sequence[Samples], weights: Floats, prior: Floats
) -> float:
    """Return the weight of a prior with which blocks that were not fitted are predicted best."""
    reduced = [triangles(base, gravity, fold) for fold in folds_of(samples) if fold]
    if len(reduced) < 2:
        return LEAST_PRIOR
    best, least = LEAST_PRIOR, np.inf
    for weight in WEIGHTS:
        squares = np.zeros(len(weights))
        for f, held_out in enumerate(reduced):
            R = joined([part for k, part in enumerate(reduced) if k != f]).stacked(weights)
            beta = base.combination @ consistent_fit(base, R, prior, weight)
            squares += held_out.residual_rms(beta) ** 2 * held_out.rows
        score = float(np.log(np.maximum(squares, 1e-300)).sum())
        if score < least - BETTER:
            best, least = weight, score
    return best
