"""Findings of the checks of a recording, which refuse it, are accepted by name, or are notes."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from catenary.errors import DataError, InputError
from catenary.verdict.delay import Delay


@dataclass(frozen=True)
class FindingKind:
    """A kind of finding about recordings.

    Args:
        name: That `--accept` takes, and messages name.
        learning: Only recordings that are learnt from must be without it: a test does well with it.
    """

    name: str
    words: str
    learning: bool = False


_KINDS = (  # in the order of severity: by how much, and how surely, each makes all other numbers wrong
    FindingKind("units", "numbers in other units than stated"),
    FindingKind("range", "positions outside the robot's limits"),
    FindingKind("stamps", "time stamps that repeat, go back, or are in another unit than seconds"),
    FindingKind("swapped", "exchanged columns of joints"),
    FindingKind("sign", "a measurement, or a torque, of the wrong sign"),
    FindingKind("velocities", "velocities that do not belong to their positions"),
    FindingKind("unrelated", "a measurement that follows no command"),
    FindingKind("copied", "a measurement that is the command itself"),
    FindingKind("mixed", "a measurement that is a sum of several joints' commands"),
    FindingKind("scale", "a measurement that moves more, or less, than a cable allows"),
    FindingKind("turns", "measurements whole or half turns, or a counter's period, from the others"),
    FindingKind("clock", "two clocks that drift apart, joints with different delays, or rows that one clock lost"),
    FindingKind("delay", "measurements that lag or lead their commands"),
    FindingKind("zeros", "rows of zeros marked as measured"),
    FindingKind("stuck", "a measurement that freezes while its joint moves"),
    FindingKind("jump", "an error that steps and stays"),
    FindingKind("constant", "columns that never change", learning=True),
    FindingKind("short", "too little to learn from", learning=True),
    FindingKind("torques", "torques of another unit, such as motor currents"),
    FindingKind("gravity", "gravity in another direction than stated"),
    FindingKind("offset", "a joint's position or torque with a shifted zero"),
    FindingKind("arm", "a load, or a drive that joints share, which the robot's file lacks"),
    FindingKind("cable", "forces at a tool that its weight does not explain"),
    FindingKind("friction", "friction that differs from the identified"),
    FindingKind("tested", "recordings used for both training and testing"),
    FindingKind("twice", "duplicated segments"),
    FindingKind("drift", "an error that drifts along the recording"),
    FindingKind("filled", "measurements that were interpolated, or filled in with commands"),
    FindingKind("missing", "rows without a measurement whose motion differs from the others"),
    FindingKind("outliers", "single measurements far from all others"),
    FindingKind("dropped", "rows left out that carry more than their share of the error"),
    FindingKind("lag", "a controller's lag between setpoints and what the robot reports"),
    FindingKind("coarse", "measurements in coarse steps"),
)
FINDINGS = {kind.name: kind for kind in _KINDS}


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, or worth knowing, about a recording."""

    name: str  # of FINDINGS
    joints: tuple[str, ...]  # that it is about; none for the whole recording
    says: str  # what was got, and what was expected
    culprit: str = ""  # what most likely happened
    remedy: str = ""  # the option that mends it
    refuses: bool = True  # a model must not be made from it as it is; otherwise it is a note
    delay: Delay | None = None  # of findings about the delay

    @property
    def severity(self) -> tuple[bool, int]:
        """Its place among others: those that refuse come first, then it is as in FINDINGS."""
        return not self.refuses, list(FINDINGS).index(self.name)

    def __str__(self) -> str:
        where = f"{', '.join(self.joints)}: " if self.joints else ""
        likely = f"; likely {self.culprit}" if self.culprit else ""
        mend = f"; fix: {self.remedy}" if self.remedy else ""
        return f"{where}{self.says}{likely}{mend}"


def require_names(accept: Collection[str]) -> None:
    """Refuse names to accept that no finding has."""
    unknown = sorted(set(accept) - set(FINDINGS))
    if unknown:
        raise InputError(f"accept: no finding is called {', '.join(unknown)}; choices: {', '.join(FINDINGS)}")


def judge(findings: Sequence[tuple[str, Finding]], accept: Collection[str] = (), *, done: str = "fitted") -> list[str]:
    """Refuse recordings with a finding that is not accepted; return notes on all others.

    Args:
        findings: Pairs of a recording's name and a finding.
        accept: Names of findings to continue despite.
        done: What is done with the recordings, for messages.
    """
    require_names(accept)
    refused = [(where, finding) for where, finding in findings if finding.refuses and finding.name not in accept]
    if refused:
        names = sorted({finding.name for _, finding in refused})
        lines = [f'recording "{where}": {finding}' for where, finding in refused]
        go_on = " ".join(f"--accept {name}" for name in names)
        raise DataError("\n".join([*lines, f"nothing was {done}; to continue anyway: {go_on}"]), names)
    return [
        f"{where}: {'accepted ' + finding.name + ': ' if finding.refuses else ''}{finding}"
        for where, finding in findings
    ]
