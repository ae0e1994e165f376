"""What a calibration came to, in one sentence."""

from collections.abc import Sequence
from typing import NamedTuple

from catenary.calibration.conformal import coverage_verdicts
from catenary.calibration.evaluate import MUCH_OUTSIDE, WORSE, Evaluation, Spread
from catenary.calibration.kind_choice import CLOSE
from catenary.reports.tip import TipErrors

MOST_JOINTS = 6  # that a sentence can name with their numbers


class JointGain(NamedTuple):
    """RMS errors of one joint in deg or mm, and what speaks against its correction."""

    name: str
    unit: str
    before: float
    after: float
    against: str  # empty where the correction is recommended


def gains_of(evaluation: Evaluation) -> list[JointGain]:
    """Return what the correction does for each joint: against it speaks an error near the fixed offset's or above."""
    gains = []
    for joint in evaluation.joints:
        against = _against(joint.rmse, joint.offset_rmse)
        if not against and joint.outside_valid_range > MUCH_OUTSIDE:
            against = f"{joint.outside_valid_range:.0%} of rows are outside its trained range"
        gains.append(JointGain(joint.name, joint.unit, joint.raw_rmse, joint.rmse, against))
    return gains


def gains_on_blocks(spread: Sequence[Spread]) -> list[JointGain]:
    """Return what the correction does for each joint on blocks of time, as a cross-validation saw it."""
    return [
        JointGain(s.joint, s.unit, s.offset_rmse_mean, s.rmse_mean, _against(s.rmse_mean, s.offset_rmse_mean))
        for s in spread
    ]


def headline(
    evaluation: Evaluation,
    *,
    unseen: bool = True,
    spread: Sequence[Spread] = (),
    tip: TipErrors | None = None,
) -> str:
    """Return the verdict on a correction in one sentence, its numbers as the tables have them.

    A correction is recommended for a joint where its error is at least 3 % below the fixed offset's, by the factor
    that a simpler kind of model is preferred within, and its inputs lie in the trained range.

    Args:
        evaluation: Its errors.
        unseen: Whether the model was not fitted to the data of the evaluation.
        spread: Errors over blocks of time that it did not see: these count where `unseen` is false.
        tip: What it does for the tip.
    """
    on_blocks = not unseen and bool(spread)
    gains = gains_on_blocks(spread) if on_blocks else gains_of(evaluation)
    if on_blocks:
        start = "On blocks of time that it did not see, the correction brings joints' RMS error after the fixed offset"
    else:
        start = "The" if unseen else "No test, since the model was fitted to this data: the"
        start += " correction brings the RMS error of joints as reported"
    sentence = f"{start} {_numbers(gains)}"
    if not unseen and not on_blocks:
        return f"{sentence}; whether to use it, other data must show."
    if tip is not None and unseen:
        sentence += f", and the tip's from {1e3 * tip.raw.rmse:.3f} to {1e3 * tip.model.rmse:.3f} mm"
    narrow = [
        joint.name
        for joint, verdict in zip(evaluation.joints, coverage_verdicts(evaluation), strict=True)
        if verdict == "too narrow"
    ] if unseen and evaluation.level is not None else []  # fmt: skip
    intervals = f"; its intervals are too narrow for {_listed(narrow)}" if narrow else ""
    return f"{sentence}: {recommendation(gains)}{intervals}."


def _numbers(gains: Sequence[JointGain]) -> str:
    """Return errors before and after, of the joints that gain most where there are many."""
    most = sorted(gains, key=lambda gain: gain.after / gain.before if gain.before > 0.0 else 1.0)[
        :MOST_JOINTS
    ]
    said = [f"from {g.before:.3f} to {g.after:.3f} {g.unit} ({g.name})" for g in gains if g in most]
    more = len(gains) - len(said)
    return ", ".join(said) + (f", and those of {more} more below" if more > 0 else "")


def recommendation(gains: Sequence[JointGain]) -> str:
    """Return for which joints the correction is recommended, and what speaks against it for the others."""
    good = [gain for gain in gains if not gain.against]
    if len(good) == len(gains):
        return "recommended for every joint" if len(gains) > 1 else "recommended"
    reasons: dict[str, list[str]] = {}
    for gain in gains:
        if gain.against:
            reasons.setdefault(gain.against, []).append(gain.name)
    said = "; ".join(f"{_listed(names)}: {reason}" for reason, names in reasons.items())
    return f"recommended for {len(good) or 'none'} of {len(gains)} joints ({said})"


def _listed(names: Sequence[str]) -> str:
    if len(names) > MOST_JOINTS:
        return f"{', '.join(names[:MOST_JOINTS])} and {len(names) - MOST_JOINTS} more"
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def _against(after: float, offset: float) -> str:
    if after > WORSE * offset:
        return "worse than the fixed offset"
    return "no better than the fixed offset" if CLOSE * after > offset else ""
