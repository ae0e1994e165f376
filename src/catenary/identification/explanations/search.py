"""Explain a recording: the cause that gains most evidence, further ones, and rivals that gain nearly as much."""

from collections.abc import Collection
from dataclasses import dataclass

from threadpoolctl import threadpool_limits

from catenary.identification.explanations.evidence import Evidence, Fit
from catenary.identification.explanations.hypotheses import HYPOTHESES, Hypothesis, PossibleCause, Trial
from catenary.identification.explanations.supposed import Supposed

_MARGIN, _FURTHER_MARGIN = 5.0, 12.0  # [nats] that a cause gains at least, and a further one beside it
_MOST_CAUSES, _WEIGHED = 3, 8  # candidates that are weighed over all spreads
_SPREAD_ROUNDS = 4


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

    causes: tuple[Cause, ...]
    supposed: Supposed
    fit: Fit


def find_explanation(evidence: Evidence, settled: Collection[str] = ()) -> ExplainedRecording:
    """Explain a recording by as few causes as its evidence asks for; hypotheses that are `settled` are left out."""
    with threadpool_limits(limits=1):  # matrices are small: BLAS threads would only wait for each other
        return _explained(evidence, settled)


def _explained(evidence: Evidence, settled: Collection[str]) -> ExplainedRecording:
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
    return ExplainedRecording(tuple(causes), supposed, evidence.fit(supposed, which))


def _ranked(trial: Trial, debt: float, settled: Collection[str]) -> list[tuple[float, Hypothesis, PossibleCause, int]]:
    """Return the best candidates with their evidence over all spreads, less prices, best first."""
    knows, identified = trial.evidence.belief.knows_masses, len(trial.evidence.belief.covariances) == 1
    found = []
    for hypothesis in HYPOTHESES.values():
        if (
            hypothesis.name not in settled
            and hypothesis.by_masses <= knows
            and hypothesis.by_identification <= identified
        ):
            price = hypothesis.price(trial.n)
            found += [(c.log_evidence - price, hypothesis, c) for c in hypothesis.candidates(trial)]
    found.sort(key=lambda each: -each[0])
    weighed = []
    for value, hypothesis, candidate in found[:_WEIGHED]:
        whole, which = trial.evidence.over_spreads(candidate.supposed)
        here = trial.log(candidate.supposed)
        weighed.append((whole + value - here - debt, hypothesis, candidate, which))
    weighed.sort(key=lambda each: -each[0])
    return weighed
