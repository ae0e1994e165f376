"""Explanation of recordings: by which causes, the robot as they show it, with bodies and shared drives, and findings.

A finding is a note where it is the arm's, a refusal with its option where it is the recording's.

There is advice only where the mended recording is as good as a sound one: no joint is left with 30 % of its torque,
masses are plausible, only faults of the same joints are nearly as likely, and the number that mends it is known to a
tenth.
"""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from catenary.arrays import Floats
from catenary.identification.explanations.evidence import Evidence, Fit
from catenary.identification.explanations.hypotheses import HYPOTHESES, UNSURE, Hypothesis, PossibleCause, Trial
from catenary.identification.explanations.priors import Belief, belief_of
from catenary.identification.explanations.regressor_columns import Rows, Supposed
from catenary.identification.identification import CarriedBody, Identification
from catenary.identification.samples import Samples
from catenary.robots.actuation import Friction, MotorInertia
from catenary.robots.model import RobotModel
from catenary.verdict.finding import Finding

GAINS = ("gain", "common gain", "currents")
_POOR = 0.3  # relative residual of a joint, beyond which nothing is advised about it
_IMPLAUSIBLE = 2.0  # squared distance of masses from the file's, per parameter
_UNSEEN_SHARE = 0.5  # of a joint's torque at usual motions, that a recording leaves open
_USUAL_ROWS, _USUAL_RANGE = 60, 0.6  # random motion: rows, and least amplitude [rad or m]
_MARGIN, _FURTHER_MARGIN = 5.0, 12.0  # [nats] that a cause gains at least, and a further one beside it
_MOST_CAUSES, _WEIGHED = 3, 8  # candidates that are weighed over all spreads
_SPREAD_ROUNDS = 4
_BODY_RADIUS_M = 0.05  # of the ball that a body is taken for, whose own inertia torques hardly show
_LEAST_SIGMAS = 1.0  # that a body's mass lies above zero


@dataclass(frozen=True)
class Cause:
    """A hypothesis that explains a recording."""

    hypothesis: Hypothesis
    candidate: PossibleCause
    gain: float  # [nats] of evidence over what was supposed before
    rivals: tuple[tuple[float, Hypothesis, PossibleCause], ...] = ()  # and by how many nats they are less likely


@dataclass(frozen=True)
class ExplainedRecording:
    """Explanation of a recording, with its residual."""

    evidence: Evidence
    causes: tuple[Cause, ...]
    supposed: Supposed
    fit: Fit

    def findings(self, unseen: Collection[str] = ()) -> list[Finding]:
        """Return the causes as findings; none is advised that needs the torque of an unseen joint alone."""
        return [_finding(self, cause, unseen) for cause in self.causes]


def find_explanation(evidence: Evidence, settled: Collection[str] = ()) -> ExplainedRecording:
    """Explain a recording by as few causes as its evidence asks for; hypotheses that are `settled` are left out."""
    with threadpool_limits(limits=1):  # matrices are small: BLAS threads would only wait for each other
        supposed, debt = evidence.plain, 0.0
        used, which = evidence.over_spreads(supposed)
        causes = list[Cause]()
        while len(causes) < _MOST_CAUSES:
            for _ in range(_SPREAD_ROUNDS):  # again at the spread of masses that the best one leaves
                ranked = _ranked(Trial(evidence, supposed, which), debt, settled)
                value, hypothesis, candidate, its_own = ranked[0]
                if value - used < _MARGIN or its_own == which:
                    break
                which = its_own
            if value - used < (_FURTHER_MARGIN if causes else _MARGIN):
                break
            rivals = tuple(
                (value - other, kind, rival)
                for other, kind, rival, _ in ranked[1:]
                if value - other < _MARGIN and (kind.name, rival.joints) != (hypothesis.name, candidate.joints)
            )
            causes.append(Cause(hypothesis, candidate, value - used, rivals))
            supposed, used = candidate.supposed, value
            evidence_now, which = evidence.over_spreads(supposed)
            debt = evidence_now - used  # price and integral, which further causes pay as well
        return ExplainedRecording(evidence, tuple(causes), supposed, evidence.fit(supposed, which))


def _ranked(trial: Trial, debt: float, settled: Collection[str]) -> list[tuple[float, Hypothesis, PossibleCause, int]]:
    """Return the best candidates with their evidence over all spreads, less prices, best first."""
    knows, identified = trial.evidence.belief.knows_masses, len(trial.evidence.belief.covariances) == 1
    candidates = []
    for hypothesis in HYPOTHESES.values():
        if (
            hypothesis.name not in settled
            and hypothesis.by_masses <= knows
            and hypothesis.by_identification <= identified
        ):
            price = hypothesis.price(trial.n)
            candidates += [(c.log_evidence - price, hypothesis, c) for c in hypothesis.candidates(trial)]
    candidates.sort(key=lambda each: -each[0])
    weighed = []
    for value, hypothesis, candidate in candidates[:_WEIGHED]:
        whole, which = trial.evidence.over_spreads(candidate.supposed)
        here = trial.log(candidate.supposed)
        weighed.append((whole + value - here - debt, hypothesis, candidate, which))
    weighed.sort(key=lambda each: -each[0])
    return weighed


def explained_torques(
    model: RobotModel, samples: Samples, settled: Collection[str] = ()
) -> tuple[list[Finding], ExplainedRecording]:
    """Explain a recording that is to be fitted, by the masses of the robot's file.

    Args:
        model: The robot, its actuation as its file has it.
        settled: Hypotheses that are left out, such as `GAINS` of currents whose gains were just found.

    Returns:
        Findings that refuse it with the option that mends it, and notes on what the arm has beside its file, with the
        explanation that they come from.
    """
    explanation = find_explanation(Evidence(model, samples), settled)
    unseen = unseen_joints(explanation.evidence, explanation.supposed)
    says = "unseen: the motion does not determine its torque in usual motions: move it, also alone"
    notes = [Finding("short", (name,), says, refuses=False) for name in unseen]
    return [*explanation.findings(unseen), *notes], explanation


def findings_against(result: Identification, samples: Samples) -> list[Finding]:
    """Return the findings about a recording given an identified arm: a test, or a recording with a load.

    Args:
        result, samples: Identification of the arm, and filtered rows of the recording.
    """
    return find_explanation(Evidence(result.model, samples, belief_of(result))).findings()


def _finding(explanation: ExplainedRecording, cause: Cause, unseen: Collection[str]) -> Finding:
    evidence, hypothesis, candidate = explanation.evidence, cause.hypothesis, cause.candidate
    names = tuple(evidence.model.joint_names[i] for i in candidate.joints)
    says = f"{candidate.says}; log evidence +{cause.gain:.0f}"
    if hypothesis.name == "load":
        body, std = load_body(evidence, explanation.supposed, candidate.supposed.loads[-1])
        says = f"{candidate.says}: {body[0]:.2g} kg, standard deviation {std:.1g}; log evidence +{cause.gain:.0f}"
    rivals = "; ".join(f"{rival.says} (-{less:.1f})" for less, _, rival in cause.rivals)
    rivals = f"; nearly as likely: {rivals}" if rivals else ""
    if not candidate.remedy:
        with_arm = hypothesis.finding == "arm" and len(evidence.belief.covariances) > 1  # not yet identified
        culprit = "it is identified with the arm" if with_arm else ""
        return Finding(hypothesis.finding, names, says + rivals, culprit, refuses=False)
    alike = all(rival.remedy and rival.joints == candidate.joints for _, _, rival in cause.rivals)
    whose = list(candidate.joints) or list(range(evidence.model.n))
    sound = bool((explanation.fit.relative[whose] < _POOR).all()) and explanation.fit.implausible < _IMPLAUSIBLE
    moved = len(names) == evidence.model.n or not set(names) & set(unseen)
    doubts = (
        ("its number is not sure", not candidate.error < UNSURE), ("see rivals", not alike),
        ("too little motion to tell", not moved), ("it explains too little", not sound),
    )  # fmt: skip
    if reasons := [reason for reason, holds in doubts if holds]:
        says += f"; nothing is advised: {reasons[0]}"
        return Finding(hypothesis.finding, names, says + rivals, refuses=False)
    # with what velocities need, if they were recorded
    rates = r" \1" if evidence.rows.samples.derived is not None else ""
    options = [re.sub(r"\{rates:(.*?)\}", rates, c.remedy) for c in (candidate, *(c for _, _, c in cause.rivals))]
    return Finding(hypothesis.finding, names, says + rivals, "", " or ".join(options))


def unseen_joints(evidence: Evidence, supposed: Supposed) -> tuple[str, ...]:
    """Return the joints whose torque at usual motions a recording leaves open."""
    samples, model = evidence.rows.samples, evidence.model
    fit = evidence.fit(supposed, evidence.over_spreads(supposed)[1])
    rng, n = np.random.default_rng(0), model.n
    reach = np.maximum(np.ptp(samples.q, axis=0) / 2.0, _USUAL_RANGE)
    q = samples.q.mean(axis=0) + rng.uniform(-1.0, 1.0, (_USUAL_ROWS, n)) * reach
    rates = [np.sqrt(np.mean(values**2, axis=0)) for values in evidence.rows.motion(supposed)[1:]]
    qd, qdd = (rng.normal(size=q.shape) * np.maximum(rate, 0.5 * np.median(rate)) for rate in rates)
    zero, time = np.zeros_like(q), np.arange(float(_USUAL_ROWS))
    gravity = samples.gravity.mean(axis=0) if samples.holds_gravity else samples.gravity
    usual = Rows(model, Samples(samples.name, q, qd, qdd, zero, zero, time, 1.0, gravity), _USUAL_ROWS)
    under = replace(evidence.plain, gravity=supposed.gravity, shared=supposed.shared)
    X = np.concatenate([usual.links(under) @ evidence.rows.shown, usual.beside(under)[0]], axis=2)
    p = X.shape[2]
    spread = np.sqrt(np.mean(np.einsum("nij,jk,nik->ni", X, fit.covariance[:p, :p], X), axis=0))
    size = np.sqrt(np.mean((X @ fit.beta[:p]) ** 2, axis=0))
    return tuple(name for name, share in zip(model.joint_names, spread / size, strict=True) if share > _UNSEEN_SHARE)


def day_findings(model: RobotModel, days: Sequence[Samples], belief: Belief | None = None) -> list[tuple[str, Finding]]:
    """Return (recording's name, finding) pairs about several recordings, judged by the arm that the others show.

    Each half of the recordings is judged by the other half.

    Args:
        belief: Prior of the arm's parameters; the file's when None.
    """
    if len(days) < 2:
        explained = [find_explanation(Evidence(model, day, belief)) for day in days if belief is not None]
        return [(days[0].name, finding) for explanation in explained for finding in explanation.findings()]
    findings, middle = [], len(days) // 2
    for own, others in ((days[:middle], days[middle:]), (days[middle:], days[:middle])):
        shown = belief
        for other in others:
            of_other = Evidence(model, other, shown)
            _, which = of_other.over_spreads(of_other.plain)
            shown = posterior(of_other, of_other.fit(of_other.plain, which), which)
        findings += day_findings(model, own, shown)
    return findings


def posterior(evidence: Evidence, fit: Fit, which: int = 0) -> Belief:
    """Return the belief about an arm after a recording, from its fit under one of the belief's spreads."""
    mean, P = evidence.belief.mean, evidence.belief.covariance(which)
    onto = evidence.onto
    gain = P @ onto @ evidence.precision(which)
    (size, m), p = onto.shape, evidence.shown + evidence.columns(evidence.plain)[2]
    G = np.eye(size + p - m, p, m - size)  # what is new beside the belief is as it was found
    G[:size] = np.hstack([gain, np.zeros((size, p - m))])
    C: Floats = G @ fit.covariance[:p, :p] @ G.T
    C[:size, :size] += P - gain @ onto.T @ P
    C = 0.5 * (C + C.T) + 1e-12 * np.diag(np.diag(C))
    had = np.concatenate([mean, np.zeros(p - m)])
    return evidence.belief.after(had + G @ (fit.beta[:p] - np.concatenate([onto.T @ mean, np.zeros(p - m)])), C)


def arm_as_found(
    model: RobotModel, recordings: Sequence[ExplainedRecording]
) -> tuple[RobotModel, tuple[CarriedBody, ...]]:
    """Return a robot with what explains its recordings, and the bodies that are part of its masses now.

    Args:
        model: The robot as its file has it.
        recordings: A drive is taken from any of them; a body only where all carry one on the same link, as masses would
            be those of one recording otherwise.
    """
    drives = dict.fromkeys(drive for one in recordings for drive in one.supposed.shared)
    for drive in drives:
        model = _with_shared_drive(model, *drive)
    bodies = list[CarriedBody]()
    for link in recordings[0].supposed.loads if recordings else ():
        if all(link in one.supposed.loads for one in recordings):
            shown = [load_body(one.evidence, one.supposed, link) for one in recordings]
            body, std = np.mean([each for each, _ in shown], axis=0), max(std for _, std in shown)
            if body[0] > _LEAST_SIGMAS * std:
                bodies.append(_carried_body(model, link, body))
                model = bodies[-1].on(model)
    return model, tuple(bodies)


def _with_shared_drive(model: RobotModel, i: int, j: int, sign: float) -> RobotModel:
    """Return a robot with friction and a rotor on q_i + sign q_j, and a rotor on each of the two joints."""
    actuation, eye, names = model.assumed_actuation, np.eye(model.n), model.joint_names
    along, name = eye[i] + sign * eye[j], f"{names[i]} {'+' if sign > 0.0 else '-'} {names[j]}"
    own = [MotorInertia(names[k], eye[k]) for k in (i, j) if not any(r.combination[k] for r in actuation.motor_inertia)]
    return replace(
        model,
        actuation=replace(
            actuation,
            values=None,
            friction=(*actuation.friction, Friction(name, along, offset=False)),
            motor_inertia=(*actuation.motor_inertia, *own, MotorInertia(name, along)),
        ),
    )


def _carried_body(model: RobotModel, link: int, body: Floats) -> CarriedBody:
    tip = model.frame()
    name, pose = (model.tip, tip.pose) if tip.link == link else (model.link_names[link], None)
    place = body[1:4] / body[0]
    place = place if pose is None else pose.rotation.T @ (place - pose.position)
    ball = 0.4 * float(body[0]) * _BODY_RADIUS_M**2
    return CarriedBody(name, float(body[0]), tuple(place.tolist()), (ball, 0.0, 0.0, ball, 0.0, ball))


def load_body(evidence: Evidence, supposed: Supposed, link: int) -> tuple[Floats, float]:
    """Return the parameters (10,) of a body on a link that is supposed to carry one, and its mass' deviation [kg]."""
    _, which = evidence.over_spreads(supposed)
    load = evidence.belief.load
    body, unsure = evidence.body(link, load, evidence.fit(supposed, which), which, supposed.loads)
    return load @ body, float(load[0, 0] * np.sqrt(max(unsure[0, 0], 0.0)))
