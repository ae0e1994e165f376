"""What a recording for identification shows of its robot: whether it can be fitted, and what speaks against it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from catenary.archives import read_arrays
from catenary.errors import ExcitationError, InputError
from catenary.identification.identification import Identification, identify_samples
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import Samples, prepare
from catenary.identification.torque_doubts import torque_findings
from catenary.plant import MotionLog
from catenary.robots.model import RobotModel
from catenary.verdict.finding import Finding
from catenary.verdict.stamps import stamp_findings

REST = 1e-3  # RMS [rad/s, m/s] of a joint that stands still


def holds_torques(path: Path) -> bool:
    """Return whether an archive is a recording for identification: positions `q`, with torques or raw efforts."""
    arrays = read_arrays(path)
    return "q" in arrays and bool({"tau", "effort"} & set(arrays)) and "q_des" not in arrays


def torque_verdict(log: MotionLog, model: RobotModel) -> tuple[list[str], list[str], tuple[Finding, ...]]:
    """Return what is wrong with a recording for identification, what is worth knowing, and the findings among them.

    It is fitted as `identify --free --friction none` fits it, to full dynamics, or to gravity where it has no time.
    """
    terms = "static" if log.time is None else "full"
    options = IdentifyOptions(terms=terms, consistent=False, friction=())  # type: ignore[arg-type]  # one of the two
    found: tuple[Finding, ...] = tuple(stamp_findings(log))
    faults = [f"{each.name}: {each}" for each in found if each.refuses]
    remarks = [f"{each.name}: {each}" for each in found if not each.refuses]
    try:
        samples = prepare(log, model, options)
        remarks += [*samples.notes, *_still(model, samples, terms)]
        result = identify_samples([samples], model, options)
    except (InputError, ExcitationError) as error:
        return [*faults, str(error)], remarks, found
    doubts = tuple(torque_findings(result, samples, fitted=True))
    faults += [f"{each.name}: {each}" for each in doubts]
    return faults, [*remarks, *_fit_in_words(result)], (*found, *doubts)


def _still(model: RobotModel, samples: Samples, terms: str) -> list[str]:
    speed = np.sqrt(np.mean(samples.qd**2, axis=0))
    still = [name for name, v in zip(model.joint_names, speed, strict=True) if v < REST]
    return [f"stands still: {', '.join(still)}"] if still and terms == "full" else []


def _fit_in_words(result: Identification) -> Sequence[str]:
    left = result.training[0].relative_rms
    shares = ", ".join(f"{n} {v:.3f}" for n, v in zip(result.model.joint_names, left, strict=True))
    return [
        f"for identification: shows all {result.base.count} base parameters ({result.options.terms}), condition "
        f"{result.condition:.3g}",
        f"fitted by itself, with Coulomb and viscous friction, this share of the torque (RMS) is left: {shares}",
    ]
