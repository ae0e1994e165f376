"""Identify a robot's dynamics from recordings of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.dynamics.actuation import ActuationLoads, known_torque
from catenary.dynamics.inverse_dynamics import motion_rows
from catenary.dynamics.regressor import PER_LINK, tree_with_parameters
from catenary.errors import ExcitationError, InputError, MissingInertiaError
from catenary.identification.base_parameters import BaseParameters, base_parameters
from catenary.identification.columns import Parameters
from catenary.identification.consistency import consistent_fit
from catenary.identification.least_squares import CHUNK, covariance, excitation, solve, triangles, weigh
from catenary.identification.options import IdentifyOptions, actuation_of, filter_of
from catenary.identification.residuals import LogResidual, judge, residual
from catenary.identification.samples import Samples, alternate_blocks, prepare
from catenary.plant import MotionLog
from catenary.robots.model import RobotModel


@dataclass(frozen=True)
class Identification:
    """Base parameters of one robot, how sure they are, and how well they predict."""

    base: BaseParameters
    beta: Floats  # (b,) SI
    covariance: Floats  # (b, b)
    options: IdentifyOptions
    weights: Floats  # (n,) of the axes
    rank: int  # of the recordings' regressor
    condition: float  # of it, weighted, columns scaled to length one
    training: tuple[LogResidual, ...]
    tests: tuple[LogResidual, ...] = ()
    phi: Floats | None = None  # (k,) all parameters, where the fit was physically consistent

    @property
    def model(self) -> RobotModel:
        """The robot as it was given."""
        return self.base.parameters.model

    @property
    def std(self) -> Floats:
        """Standard deviations (b,) of the base parameters."""
        return np.sqrt(np.diag(self.covariance))

    def predict(
        self,
        q: ArrayLike,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
        gravity: ArrayLike | None = None,
    ) -> Floats:
        """Predict the torques of a motion, known ones included: Y_b beta + known.

        Args:
            q: (n,) or (N, n) [rad or m].
            qd: The same shape; at rest when None.
            qdd: The same shape; none when None.
            gravity: (3,) in base axes [m/s2]; the recordings' when None.

        Returns:
            (n,) or (N, n) [Nm or N].

        Raises:
            InputError: Another shape, NaN, or a motion asked of what was identified from poses at rest.
        """
        motion, single = motion_rows(self.model, q, qd=qd, qdd=qdd)
        if self.options.terms == "static" and any(rates.any() for rates in motion[1:]):
            raise InputError(f'"{self.model.name}" was identified from poses at rest: it predicts no motion')
        g = as_array("gravity", self.options.gravity if gravity is None else gravity, (3,))
        tau = self.predict_unknown(motion[0], motion[1], motion[2], g)
        tau = tau + known_torque(actuation_of(self.model), motion[0])
        return tau[0] if single else tau

    def predict_unknown(self, q: Floats, qd: Floats, qdd: Floats, gravity: Floats) -> Floats:
        """Predict torques (N, n) without those that are known beforehand."""
        parts = [slice(first, first + CHUNK) for first in range(0, max(len(q), 1), CHUNK)]
        return np.concatenate([self.base.regressor(q[p], qd[p], qdd[p], gravity) @ self.beta for p in parts])

    def test(self, samples: Sequence[Samples]) -> "Identification":
        """Return this identification with verdicts on recordings that were not fitted."""
        tests = []
        worst = np.max([r.relative_rms for r in self.training], axis=0)
        for part in samples:
            result = self.compare(part)
            tests.append(replace(result, verdict=judge(result, worst)))
        return replace(self, tests=(*self.tests, *tests))

    def compare(self, samples: Samples) -> LogResidual:
        """Compute the residual on a recording."""
        gravity = np.array(self.options.gravity)
        predicted = self.predict_unknown(samples.q, samples.qd, samples.qdd, gravity)
        return residual(samples, predicted, filter_of(self.model, self.options).period_samples)

    def robot(self) -> RobotModel:
        """Return the robot with the identified inertia.

        Raises:
            MissingInertiaError: The fit was not physically consistent: base parameters are combinations of links',
                and no inertia of any single link follows from them.
        """
        parameters, consistent = self.base.parameters, self._consistent()
        phi = np.zeros((len(self.model.link_names), PER_LINK))
        for place, link in enumerate(parameters.links):
            phi[link] = consistent[parameters.link_columns(place)]
        tree = tree_with_parameters(self.model.tree, phi.reshape(-1))
        note = "inertia identified from recordings; friction, rotors and springs are not in it"
        return replace(self.model, tree=tree, missing_inertia=(), notes=(*self.model.notes, note))

    def loads(self) -> ActuationLoads:
        """Return friction, rotors and springs with the identified numbers, and what torques were known.

        `inverse_dynamics` of `robot()` and these together are what `predict` gives.

        Raises:
            MissingInertiaError: As `robot`.
        """
        parameters = self.base.parameters
        values = self._consistent()[len(parameters.links) * parameters.per_link :]
        return ActuationLoads(self.model.n, actuation_of(self.model), parameters.actuation, values)

    def _consistent(self) -> Floats:
        if self.phi is None:
            links = [self.model.link_names[i] for i in self.base.parameters.links]
            raise MissingInertiaError(self.model.name, links)
        return self.phi


def identify(
    logs: Sequence[MotionLog],
    model: RobotModel,
    options: IdentifyOptions | None = None,
    *,
    tests: Sequence[MotionLog] = (),
) -> Identification:
    """Identify base parameters by weighted least squares over all axes and recordings.

    min_beta sum_a w_a^2 ||tau_a - Y_b,a beta||^2 on filtered signals; with `consistent`, over parameters that bodies
    and friction can have. The robot needs no inertia.

    Args:
        logs: Recordings to fit.
        model: The robot; its actuation says which friction, rotors and springs are identified with the links.
        options: What to choose otherwise than the robot's file.
        tests: Recordings to judge the result by.

    Raises:
        InputError: A recording is not of this robot, in other units, or too short.
        ExcitationError: The recordings do not show all base parameters; nothing is fitted.
    """
    options = IdentifyOptions() if options is None else options
    if not logs:
        raise InputError("identify: expected at least one recording")
    samples = [prepare(log, model, options) for log in logs]
    held_out = [prepare(log, model, options) for log in tests]
    if options.blocks is not None:
        parted = [alternate_blocks(part, options.blocks) for part in samples]
        samples = [part[0] for part in parted]
        held_out = [*(part[1] for part in parted), *held_out]
    return identify_samples(samples, model, options).test(held_out)


def identify_samples(
    samples: Sequence[Samples], model: RobotModel, options: IdentifyOptions
) -> Identification:
    """Identify from recordings that are filtered already; see `identify`."""
    gravity = as_array("gravity", options.gravity, (3,))
    recorded = [np.concatenate([getattr(part, key) for part in samples]) for key in ("q", "qd", "qdd")]
    base = base_parameters(
        Parameters(model, options.terms),
        gravity,
        (recorded[0], recorded[1], recorded[2]),
        np.random.default_rng(options.seed),
    )
    reduced = triangles(base, gravity, samples)
    weighting = options.weighting or actuation_of(model).weighting
    weights = weigh(weighting, samples, reduced)
    R = reduced.stacked(weights)
    rank, condition, weakest = excitation(R)
    if rank < base.count:
        raise ExcitationError(_singular(base, rank, condition, weakest), rank=rank, n_base=base.count)
    phi = consistent_fit(base, R) if options.consistent else None
    beta = solve(R) if phi is None else base.combination @ phi
    result = Identification(
        base=base,
        beta=beta,
        covariance=covariance(reduced, weights, beta),
        options=options,
        weights=weights,
        rank=rank,
        condition=condition,
        training=(),
        phi=phi,
    )
    return replace(result, training=tuple(result.compare(part) for part in samples))


def _singular(base: BaseParameters, rank: int, condition: float, weakest: Floats) -> str:
    parts = np.argsort(-np.abs(weakest))[:4]
    named = ", ".join(base.names[i] for i in parts if abs(weakest[i]) > 0.1)
    return (
        f'robot "{base.parameters.model.name}": the recordings show {rank} of {base.count} base parameters (condition '
        f"{condition:.3g}); least of all a combination of {named}. No parameters and no verdict follow from them: "
        "move every joint, over more of its range and faster; catenary excitation designs such a motion. Columns of "
        "positions in another joint's place look like this too"
    )
