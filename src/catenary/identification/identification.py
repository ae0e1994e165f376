"""Identification of a robot's dynamics (base parameters, friction, rotors) from recordings."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from catenary.arrays import Floats, as_array
from catenary.config import IN_FILES
from catenary.dynamics.actuation_loads import known_torque
from catenary.dynamics.inverse_dynamics import motion_rows
from catenary.dynamics.torque_regressor import PER_LINK, link_parameters, torque_regressor, tree_with_parameters
from catenary.errors import ExcitationError, InputError, MissingInertiaError
from catenary.identification import residuals
from catenary.identification.base_parameters import BaseParameters, Parameters, base_parameters
from catenary.identification.consistency import consistent_fit, likeliest_prior, unseen_of
from catenary.identification.drive_gains import DriveGains, drive_gains
from catenary.identification.friction_choice import FrictionPart, choose_friction
from catenary.identification.identify_options import IdentifyOptions, known_rotors, rotors_beside
from catenary.identification.least_squares import axis_weights, condition_of_triangle, covariance, solve, triangles
from catenary.identification.samples import Samples, alternate_blocks, prepare, with_base_wrench
from catenary.plant import MotionLog
from catenary.robots.actuation import Actuation, MotorInertia
from catenary.robots.model import RobotModel
from catenary.robots.submodels import BASE_JOINTS, driven_actuation
from catenary.spatial import STANDARD_GRAVITY
from catenary.tables import Column, OnScreen, Screen, Table, joint_columns

_log = logging.getLogger(__name__)
_TILTING_SHARE = 0.02  # RMS deviation of gravity's direction, above which the base counts as tilting
_STILL = 1e-3  # [rad, m] range of motion below which a joint stands still
ROTOR_SHARE = 0.4  # prior standard deviation of a rotor's torque, as a share of the joint's torque
_HIDDEN_SHARE = 0.5  # share of its prior standard deviation above which a rotor's error means: not shown
_CONTRADICTED_RATIO = 1.5  # ratio of a joint's residual with the wrench under the base to that without
_WINDOW_S = 0.25  # in which gravity is taken for constant: a sixth of it is left at 1 Hz
_MIN_WINDOWS = 12
# of what turning gravity leaves to what turning at other times does: simulated bases 0.41 (11 deg) to 0.71 (0.6 deg);
# wrong friction, loads and zeros 0.93 and more, seven real recordings of five arms 0.97 and more
_TOLD_RATIO = 0.85
_ELSEWHERE = (0.31, 0.47, 0.61)  # of the windows: places from where a turning at other times is taken
_LOAD_ROUNDS = 3  # iterations of the fit of load-dependent friction, whose load comes from the fit


class Rotor(NamedTuple):
    """Identified reflected inertia, along one of the robot's combinations of coordinates."""

    name: str
    inertia: float | None  # [kg m2 or kg]; None if not `consistent` and identifiable only with other parameters
    error: float | None  # standard; None if identifiable only together with a link's inertia, or stated by the caller


@dataclass(frozen=True)
class CarriedBody:
    """Body carried on a frame of a robot, included in the robot's masses."""

    __pydantic_config__ = IN_FILES

    frame: str
    mass: float  # [kg]
    position: tuple[float, float, float]  # [m] of its centre of mass in the frame
    inertia: tuple[float, float, float, float, float, float] = (0.0,) * 6  # xx, xy, xz, yy, yz, zz about that [kg m2]

    def on(self, model: RobotModel) -> RobotModel:
        """Return the robot with this body; see `RobotModel.with_payload`."""
        return model.with_payload(self.frame, self.mass, self.position, inertia=self.inertia)


@dataclass(frozen=True, repr=False)
class Identification(OnScreen):
    """Base parameters of one robot, with their covariance and their residuals on recordings."""

    base: BaseParameters
    beta: Floats  # (b,) SI
    covariance: Floats  # (b, b)
    options: IdentifyOptions
    weights: Floats  # (n,) of the axes
    rank: int  # of the recordings' regressor
    condition: float  # of the weighted regressor, columns scaled to length one
    training: tuple[residuals.LogResidual, ...]
    tests: tuple[residuals.LogResidual, ...] = ()
    phi: Floats | None = None  # (k,) all parameters, if the fit was physically consistent
    friction: tuple[FrictionPart, ...] = ()  # parts added to the robot file's friction by held-out blocks
    seen: residuals.MovedRange | None = None  # range of motion of the training recordings
    moved_base: bool = False  # gravity's direction varied in the recordings
    prior: bool = False  # the masses of the robot's file were the prior
    unshown: tuple[str, ...] = ()  # rotors, or a recording's friction, that the motion does not distinguish
    bodies: tuple[CarriedBody, ...] = ()  # carried bodies, included in the masses of `model`

    @property
    def residual_table(self) -> Table:
        """Relative residual per recording and axis, with the verdict."""
        names = [(name, "") for name in self.model.joint_names]
        per_axis = joint_columns(names, lambda r, j: r.relative_rms[j], ".3f")
        columns: list[Column] = [("recording", "log"), "rows", *per_axis, ("verdict", lambda r: r.verdict or "fitted")]
        return Table(columns, [*self.training, *self.tests], "Residual over torque (RMS) per axis")

    @property
    def parameter_table(self) -> Table:
        """Every base parameter with its standard deviation."""
        shares = (std / abs(value) if value else None for value, std in zip(self.beta, self.std, strict=True))
        rows = list(zip(self.base.names, self.base.units, self.beta, self.std, shares, strict=True))
        return Table(["parameter", "unit", ("value", ":.5g"), ("std", ":.2g"), ("std / value", ":.0f %")], rows)

    @property
    def screen(self) -> Screen:
        """Residuals and parameters."""
        logs = ", ".join(residual.log for residual in self.training)
        verdict = "; ".join(f"{residual.log}: the model {residual.verdict}" for residual in self.tests)
        title = f"of {self.model.name}: {self.base.count} base parameters from {logs}"
        return Screen(title, [self.residual_table, self.parameter_table], verdict)

    @property
    def model(self) -> RobotModel:
        """The robot model that was identified, before identification."""
        return self.base.parameters.model

    @property
    def gravity(self) -> Floats:
        """Gravity (3,) in base axes [m/s2] for recordings without recorded gravity."""
        return np.array(self.options.gravity)

    @property
    def usual(self) -> Floats:
        """RMS residual (n,) of the training recordings [Nm or N]."""
        return np.asarray(np.mean([residual.rms for residual in self.training], axis=0))

    @property
    def std(self) -> Floats:
        """Standard deviations (b,) of the base parameters."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def rotors(self) -> tuple[Rotor, ...]:
        """Identified or stated rotors."""
        if self.options.rotors is not None:
            stated = zip(self.model.joint_names, self.options.rotors, strict=True)
            return tuple(Rotor(name, value, None) for name, value in stated)
        base, rotors = self.base, list[Rotor]()
        for column, term in base.parameters.rotors.items():
            value, error = None if self.phi is None else float(self.phi[column]), None
            if base.identifiable[column] == "alone" and column in base.columns:
                place = int(np.flatnonzero(base.columns == column)[0])
                error, value = float(self.std[place]), float(self.beta[place]) if value is None else value
            rotors.append(Rotor(term.name, value, error))
        return tuple(rotors)

    def predict(
        self, q: ArrayLike, qd: ArrayLike | None = None, qdd: ArrayLike | None = None, gravity: ArrayLike | None = None
    ) -> Floats:
        """Predict the torques (n,) or (N, n) [Nm or N] of a motion: Y_b beta + known, with friction of steady sliding.

        q [rad or m], qd and qdd have the same shape; rates default to zero, gravity (3,) [m/s2] in base axes to that of
        the identification.
        """
        motion, single = motion_rows(self.model, q, qd=qd, qdd=qdd)
        if self.options.terms == "static" and any(rates.any() for rates in motion[1:]):
            raise InputError(f'"{self.model.name}" was identified from poses at rest: it predicts no motion')
        g = as_array("gravity", self.options.gravity if gravity is None else gravity, (3,))
        rows, rates, accelerations = motion
        known = (
            known_torque(self.model.assumed_actuation, rows) + known_rotors(self.model, self.options) * accelerations
        )
        down, places = np.broadcast_to(g, (len(rows), 3)), np.arange(len(rows), dtype=float)
        made = Samples("", rows, rates, accelerations, np.zeros_like(rows), known, places, 1.0, gravity=down)
        tau = self.predict_samples(made) + known
        return tau[0] if single else tau

    def with_gains(self, gains: Floats) -> Identification:
        """Return the identification for a robot whose torques are its raw efforts times these gains (n,)."""
        base, model = self.base, self.model
        model = replace(model, actuation=replace(model.assumed_actuation, effort_scale=gains))
        return replace(self, base=replace(base, parameters=replace(base.parameters, model=model)))

    def test(self, samples: Sequence[Samples]) -> Identification:
        """Return the identification with verdicts on test recordings."""
        worst = np.max([r.relative_rms for r in self.training], axis=0)
        predicted = [(part, self.predict_samples(part)) for part in samples]
        tests = (residuals.residual_verdict(self.model, *test, worst, self.seen) for test in predicted)
        return replace(self, tests=(*self.tests, *tests))

    def compare(self, samples: Samples) -> residuals.LogResidual:
        """Compute the residual on a recording."""
        return residuals.residual(samples, self.predict_samples(samples))

    def predict_samples(self, samples: Samples) -> Floats:
        """Predict torques (N, n) of a recording, less known torques, with friction that depends on its history."""
        heard = carrying(self.base, self.beta, [samples])[0]
        return np.concatenate([Y @ self.beta for _, Y in self.base.chunks(heard)])

    def base_notes(self, samples: Sequence[Samples]) -> list[str]:
        """Return a note for each recording without gravity that an unrecorded motion of the base explains.

        In windows of a quarter second horizontal gravity is fitted to what the model leaves of the torques, by those of
        the joints' places there and, as a rival that explains nothing, of places at other times.
        """
        if self.phi is None or self.options.terms == "static":
            return []
        notes, phi = [], link_parameters(self.robot().tree)
        for part in samples:
            if part.holds_gravity or not part.qd.any():
                continue
            rows = max(1, int(_WINDOW_S / float(np.median(np.diff(part.time)))))
            if len(part) // rows < _MIN_WINDOWS:
                continue
            unexplained, turned = _turned(self.model, phi, part, part.tau - self.predict_samples(part), rows)
            if unexplained < _TOLD_RATIO:
                notes.append(
                    f"{part.name}: residual torques are those of a moving base, by about "
                    f"{np.rad2deg(turned):.1g} deg: record gravity and base_rate with the joints"
                )
        return notes

    def robot(self) -> RobotModel:
        """Return the robot with the identified inertia, friction, rotors, springs and carried bodies.

        Its `without_payload` is the arm without carried bodies, if recordings show one or the caller declared one.
        Poses at rest determine only masses and their centres: such a robot has gravity torques but no dynamics.
        """
        parameters, consistent = self.base.parameters, self.phi
        if consistent is None:
            links = [self.model.link_names[i] for i in parameters.links]
            raise MissingInertiaError(self.model.name, links)
        static = self.options.terms == "static"
        phi = np.zeros((len(self.model.link_names), PER_LINK))
        for place, link in enumerate(parameters.links):
            phi[link, : parameters.per_link] = consistent[parameters.link_columns(place)]
            if static:  # the tensor about the centre of mass is unknown: zero, and refused for motion
                mass, moment = phi[link, 0], phi[link, 1:4]
                point = moment @ moment * np.eye(3) - np.outer(moment, moment)
                phi[link, 4:] = (point / mass)[np.triu_indices(3)]
        of_all = [not term.recording for term in parameters.actuation]  # not terms of a single recording
        values = consistent[len(parameters.links) * parameters.per_link :][of_all]
        actuation = self.model.assumed_actuation
        actuation = replace(actuation, friction=tuple(f for f in actuation.friction if not f.recording))
        if static:
            still = (f.only(lambda term: term.at_rest) for f in actuation.friction)
            actuation = replace(actuation, friction=tuple(f for f in still if f.parts), motor_inertia=())
        elif self.options.rotors is not None:  # after friction and before springs, as in `actuation_terms`
            rows = zip(self.model.joint_names, np.eye(self.model.n), strict=True)
            values = np.insert(values, len(values) - len(actuation.springs), self.options.rotors)
            actuation = replace(actuation, motor_inertia=tuple(MotorInertia(name, row) for name, row in rows))
        what = "mass and its centre" if static else "inertia, friction, rotors and springs"
        robot = replace(
            self.model,
            tree=tree_with_parameters(self.model.tree, phi.reshape(-1)),
            actuation=replace(actuation, values=values),
            unseen=() if self.moved_base else unseen_of(self.base, consistent),
            missing_inertia=(),
            missing_tensor=tuple(self.model.link_names[i] for i in parameters.links) if static else (),
            notes=(*self.model.notes, f"{what} identified from recordings"),
        )
        return self._carrying(robot, phi.reshape(-1))

    def _carrying(self, robot: RobotModel, phi: Floats) -> RobotModel:
        """Return a robot of these parameters, with `without_payload` set if the links have the bodies' mass."""
        loaded = robot
        for body in self.bodies:
            loaded = body.on(loaded)
        alone = 2.0 * phi - link_parameters(loaded.tree)
        if not self.bodies or (alone[::PER_LINK] < 0.0).any():
            return robot
        arm = replace(robot, tree=tree_with_parameters(robot.tree, alone), without_payload=None)
        return replace(robot, without_payload=arm)


def identify(
    logs: Sequence[MotionLog],
    model: RobotModel,
    options: IdentifyOptions | None = None,
    *,
    tests: Sequence[MotionLog] = (),
) -> Identification:
    """Identify base parameters by weighted least squares over all axes and recordings.

    min_beta sum_a w_a^2 ||tau_a - Y_b,a beta||^2 on filtered signals, over physically consistent parameters (with
    option `consistent`), with the parameters of the robot's file, if any, as the prior. Friction terms are added while
    they improve the prediction of held-out blocks of the recordings. The model's inertia may be missing.

    Args:
        logs: Recordings to fit.
        model: The robot; its actuation defines which friction, rotors and springs are identified with the links.
        options: Options that replace those of the robot's file.
        tests: Recordings to test the result on.

    Raises:
        InputError: A recording is of another robot, in other units, or too short.
        ExcitationError: The recordings do not excite all base parameters; nothing is fitted.

    Examples:
        >>> arm, w, t = catenary.load_robot("two_link"), np.array([1.0, 1.7]), np.linspace(0.0, 20.0, 4000)[:, None]
        >>> q, qd, qdd = np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)
        >>> tau = catenary.inverse_dynamics(arm, q, qd, qdd, [0.0, 0.0, -9.81])
        >>> ok = np.ones(len(q), bool)
        >>> log = catenary.MotionLog("run", arm.joint_names, arm.joint_units, q, ok, time=t[:, 0], qd=qd, tau=tau)
        >>> result = catenary.identify([log], arm)
        >>> bool(result.training[0].relative_rms.max() < 0.01)
        True
    """
    options = IdentifyOptions() if options is None else options
    if not logs:
        raise InputError("identify: expected at least one recording")
    samples, held_out = prepared(logs, tests, model, options)
    result = identify_logs(logs, samples, model, options).test(held_out)
    for note in result.base_notes([*samples, *held_out]):
        _log.warning("%s", note)
    return result


def identify_logs(
    logs: Sequence[MotionLog], samples: Sequence[Samples], model: RobotModel, options: IdentifyOptions
) -> Identification:
    """Identify from recordings, with the base's wrench if recorded; InputError where it predicts torques worse.

    Args:
        logs, samples: Recordings, and their samples by `prepared`.
        model, options: See `identify`.
    """
    on_base = with_base_wrench(model, logs)
    if on_base is model:
        return identify_samples(samples, model, options)
    held = prepared(logs, (), on_base, options, within_limits=False)[0]
    result = _of_arm(identify_samples(held, on_base, options), model, samples)
    with suppress(ExcitationError):
        alone = identify_samples(samples, result.model, replace(options, friction=()))
        for part, other in zip(result.training, alone.training, strict=True):
            if (worse := part.rms > _CONTRADICTED_RATIO * other.rms).any():
                raise InputError(
                    f'recording "{part.log}": base_force and base_moment contradict the torques of joint '
                    f"{model.joint_names[int(np.argmax(worse))]}: expected N and Nm that hold the base, in base axes, "
                    "about the base's origin"
                )
    return result


def _of_arm(whole: Identification, model: RobotModel, samples: Sequence[Samples]) -> Identification:
    """Convert an identification with base joints to the arm's own parameters, a subset."""
    full, first = whole.base.parameters, len(BASE_JOINTS)
    own = np.eye(full.model.n)[:, first:]
    actuation = driven_actuation(model.name, full.model.assumed_actuation, own, np.zeros(full.model.n))
    parameters, motion = Parameters(replace(model, actuation=actuation), full.terms), _motion(samples)
    rng, gravity = np.random.default_rng(whole.options.seed), np.array(whole.options.gravity)
    base = base_parameters(parameters, gravity, motion, rng, on_base=_base_of(samples)[0])
    among = np.array([[name == other for other in full.names] for name in parameters.names], dtype=float)
    onto = base.combination @ among @ np.linalg.pinv(whole.base.combination)
    seen = whole.seen and residuals.MovedRange(*(getattr(whole.seen, k)[first:] for k in ("low", "high", "speed")))
    result = replace(
        whole, base=base, beta=onto @ whole.beta, covariance=onto @ whole.covariance @ onto.T, rank=base.count,
        weights=whole.weights[first:], phi=None if whole.phi is None else among @ whole.phi, seen=seen,
    )  # fmt: skip
    return replace(result, training=tuple(result.compare(part) for part in samples))


def _motion(samples: Sequence[Samples]) -> tuple[Floats, Floats, Floats]:  # (N, n) each
    q, qd, qdd = (np.concatenate([getattr(part, key) for part in samples]) for key in ("q", "qd", "qdd"))
    return q, qd, qdd


def prepared(
    logs: Sequence[MotionLog],
    tests: Sequence[MotionLog],
    model: RobotModel,
    options: IdentifyOptions,
    *,
    within_limits: bool = True,
) -> tuple[list[Samples], list[Samples]]:
    """Return filtered samples to fit, and to test on, which include held-out blocks; see `prepare`.

    Args:
        logs, tests: Recordings to fit, and to test on.
        model, options: See `identify`; with `options.blocks`, alternate blocks are held out.
        within_limits: Refuse positions beyond the robot's limits.
    """
    fitted, tested = (
        [prepare(log, model, options, within_limits=within_limits) for log in part] for part in (logs, tests)
    )
    if options.blocks is None:
        return fitted, tested
    parted = [alternate_blocks(part, options.blocks) for part in fitted]
    return [part[0] for part in parted], [*(part[1] for part in parted), *tested]


def identify_samples(samples: Sequence[Samples], model: RobotModel, options: IdentifyOptions) -> Identification:
    """Identify from filtered samples.

    Args:
        model, options: See `identify`.
    """
    with threadpool_limits(limits=1):  # matrices are small: BLAS threads would only wait for each other
        known_rotors(model, options)  # refuses a number of rotors other than that of joints
        (geared, actuation), parts = _geared(model, options), tuple[FrictionPart, ...]()
        plain = _fit(samples, geared, replace(options, consistent=False))
        if options.terms == "full" and options.friction:
            heard = carrying(plain.base, plain.beta, samples)
            actuation, parts = choose_friction(plain.base, heard, plain.weights, actuation, options.friction)
        return replace(_fit(samples, replace(model, actuation=actuation), options, like=plain), friction=parts)


def gains_of(
    free: Sequence[Samples], loaded: Sequence[Samples], model: RobotModel, options: IdentifyOptions, load: float
) -> DriveGains:
    """Identify drive gains [Nm/A] from currents of an arm without and with a load of known mass.

    Args:
        free, loaded: Filtered rows of recordings without and with the load, torques in A.
        model, options: See `identify`.
        load: Mass of the load [kg].

    Raises:
        InputError: The robot has known torques or rotors, which are in Nm.
    """
    geared, actuation = _geared(model, options)
    if options.rotors is not None or actuation.known_torques:
        raise InputError("currents: torques of known rotors, cables or springs are in Nm: leave them out")
    with threadpool_limits(limits=1):
        return drive_gains(_fit([*free, *loaded], geared, replace(options, consistent=False)).base, free, loaded, load)


def _geared(model: RobotModel, options: IdentifyOptions) -> tuple[RobotModel, Actuation]:
    """Return a robot's actuation with the rotors to identify, and the robot with it but load-dependent friction."""
    own, added = model.assumed_actuation, rotors_beside(model) if options.find_rotors else ()
    rotors = (*own.motor_inertia, *added) if options.rotors is None else ()
    actuation = replace(own, values=None, motor_inertia=rotors)
    steady = tuple(friction.only(lambda term: not term.grows_with_load) for friction in own.friction)
    return replace(model, actuation=replace(actuation, friction=steady)), actuation


def _fit(
    samples: Sequence[Samples], model: RobotModel, options: IdentifyOptions, like: Identification | None = None
) -> Identification:
    """Fit with the model's friction, and with the axis weights of another fit, if given."""
    q, qd, qdd = _motion(samples)
    rng, parameters = np.random.default_rng(options.seed), Parameters(model, options.terms)
    on_base, moved_base = _base_of(samples)
    base = base_parameters(parameters, np.array(options.gravity), (q, qd, qdd), rng, on_base=on_base)
    loaded = like is not None and any(term.grows_with_load for term in base.parameters.actuation)
    weights = None if like is None else like.weights
    known = {} if like is None else dict(zip(like.base.names, like.beta, strict=True))
    beta = np.array([known.get(name, 0.0) for name in base.names])  # 0 for parameters that the other fit lacks
    for _ in range(_LOAD_ROUNDS if loaded else 1):
        if loaded:
            samples = carrying(base, beta, samples)
        reduced = triangles(base, samples)
        if weights is None:
            weights = axis_weights(options.weighting or model.assumed_actuation.weighting, samples, reduced)
        rotors = _rotors_beforehand(base, samples)
        reduced = reduced.near_zero(rotors, solve(reduced.stacked(weights)))
        R = reduced.stacked(weights)
        rank, condition, weakest = condition_of_triangle(R)
        if rank < base.count:
            still = [name for name, span in zip(model.joint_names, np.ptp(q, axis=0), strict=True) if span < _STILL]
            unseen = "".join(f"joint {name} unseen: move it. " for name in still)
            raise ExcitationError(
                f'robot "{model.name}": the recordings show {rank} of {base.count} base parameters (condition '
                f"{condition:.3g}); {unseen}Least of all a combination of {base.named(weakest)}. No parameters and no "
                "verdict follow: move every joint, over more of its range and faster; catenary excitation designs such "
                "a motion. Columns of positions in another joint's place look like this too",
                rank=rank,
                n_base=base.count,
            )
        beta = solve(R)
    assert weights is not None  # for the type checker: there is at least one round
    phi, drawn = None, None
    if options.consistent:
        if options.prior:
            drawn = likeliest_prior(base, R, reduced.variance(weights, beta))
        phi = consistent_fit(base, R, drawn)
        beta = base.combination @ phi
    result = Identification(
        base, beta, covariance(reduced, weights, beta), options, weights, rank, condition, training=(), phi=phi,
        seen=residuals.MovedRange(q.min(axis=0), q.max(axis=0), residuals.rms(qd)),
        moved_base=moved_base, prior=drawn is not None,
    )  # fmt: skip
    named = base.parameters.rotors
    hidden = tuple(named[int(base.columns[k])].name for k in rotors if result.std[k] > _HIDDEN_SHARE * rotors[k][1])
    return replace(result, training=tuple(result.compare(part) for part in samples), unshown=hidden)


def _rotors_beforehand(base: BaseParameters, samples: Sequence[Samples]) -> dict[int, tuple[int, float]]:
    """Return the axis and the prior standard deviation about zero of each base parameter that is a rotor."""
    tau, qdd = (np.concatenate([getattr(part, key) for part in samples]) for key in ("tau", "qdd"))
    sizes, rotors = {}, base.parameters.rotors
    for k, column in enumerate(base.columns.tolist()):
        if (term := rotors.get(column)) is not None:
            axis, speeding = int(np.argmax(np.abs(term.combination))), qdd @ term.combination
            size, rate = (float(residuals.rms(values)) for values in (tau[:, axis], speeding))
            sizes[k] = axis, ROTOR_SHARE * size / max(rate, 1e-9)
    return sizes


def carrying(base: BaseParameters, beta: Floats, samples: Sequence[Samples]) -> list[Samples]:
    """Return recordings with the torques of links, rotors and springs, on which friction may depend."""
    kept = np.isin(base.columns, base.parameters.carrying)
    torques = (np.concatenate([Y[:, :, kept] @ beta[kept] for _, Y in base.chunks(part)]) for part in samples)
    return [replace(part, carried=part.known + each) for part, each in zip(samples, torques, strict=True)]


def _base_of(samples: Sequence[Samples]) -> tuple[Floats | None, bool]:
    """Return recorded gravity and rates of the base (N, 3, 3), if any, and whether the base tilts."""
    if not any(part.holds_gravity for part in samples):
        return None, False
    parts = []
    for part in samples:
        turning = np.zeros((len(part), 2, 3)) if part.base is None else part.base
        parts.append(np.concatenate([np.broadcast_to(part.gravity, (len(part), 3))[:, None], turning], axis=1))
    rows = np.concatenate(parts)
    directions = rows[:, 0] / np.linalg.norm(rows[:, 0], axis=1, keepdims=True)
    spread = float(np.sqrt(np.mean(np.sum((directions - directions.mean(axis=0)) ** 2, axis=1))))
    return rows, spread > _TILTING_SHARE


def _turned(robot: RobotModel, phi: Floats, part: Samples, residual: Floats, rows: int) -> tuple[float, float]:
    """Return the residual after turning gravity, relative to turning it at other times, and the turn [rad RMS]."""
    kept, still = slice(0, len(part) // rows * rows), np.zeros_like(part.q)
    down = part.gravity / np.linalg.norm(part.gravity)
    across = np.linalg.svd(down[None])[2][1:]  # two directions that a turn adds gravity along
    columns = [torque_regressor(robot, part.q, still, still, axis)[kept] @ phi for axis in across]
    size = np.maximum(np.sqrt(np.mean(residual**2, axis=0)), 1e-9)
    by_window = (len(part) // rows, rows * robot.n)
    G = np.stack([(column / size).reshape(by_window) for column in columns], axis=2)
    e = (residual[kept] / size).reshape(by_window)

    def fitted(shift: int) -> tuple[float, Floats]:
        moved = np.roll(G, shift, axis=0)
        gravity = np.linalg.pinv(moved) @ e[:, :, None]
        return float(np.sum((e - (moved @ gravity)[:, :, 0]) ** 2)), gravity[:, :, 0]

    own, gravity = fitted(0)
    elsewhere = np.mean([fitted(int(share * len(G)))[0] for share in _ELSEWHERE])
    return own / float(elsewhere), float(np.sqrt(np.mean(np.sum(gravity**2, axis=1)))) / STANDARD_GRAVITY
