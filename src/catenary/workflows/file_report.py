"""What check says of a file: kind, facts, faults, and the command to use next."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from textwrap import shorten
from typing import TYPE_CHECKING, Any

from catenary.reports.page import Table
from catenary.verdict.finding import Finding

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMAT = "catenary.check.1"  # of what --json prints
ROWS = 18  # of a screen of 24, that facts, joints, faults and remarks of two rows share
LONGEST = 170  # letters of a remark on it
Line = tuple[str, str]  # what a fact is called, and what it says
SOUND = "nothing wrong found"
DOUBTS = ("jump", "drift", "filled", "missing", "units")  # notes by which errors are those of something else


@dataclass
class FileReport:
    """Kind, facts and faults of a file."""

    kind: str  # "robot", "calibration model", "identified dynamics" or a recording
    facts: dict[str, Any] = field(default_factory=dict)
    lines: list[Line] = field(default_factory=list)  # the facts as people read them
    faults: list[str] = field(default_factory=list)  # make it unfit for its use, or its numbers doubtful
    remarks: list[str] = field(default_factory=list)  # worth knowing
    findings: tuple[Finding, ...] = ()  # about a recording; in words they are faults, or remarks
    joints: Table | None = None  # of a recording
    sound: str = SOUND  # the verdict where there is no fault
    draw: "Callable[[], Figure] | None" = None  # a recording's delay
    next: str = ""  # the command line to use next, or what else to do

    def tell(self, key: str, fact: Any, text: str | None = None, *, called: str = "") -> None:
        """Add a fact, and its line in words: the fact itself where it is a text."""
        self.facts[key] = fact
        self.lines.append((called or key.replace("_", " "), str(fact) if text is None else text))

    @property
    def verdict(self) -> str:
        """What it comes to, in a sentence."""
        if self.faults:
            return f"{len(self.faults)} fault(s) found"
        doubted = [" of ".join(filter(None, (x.name, ", ".join(x.joints)))) for x in self.findings if x.name in DOUBTS]
        return f"in doubt: {', '.join(doubted)}; otherwise {self.sound}" if doubted else self.sound

    @property
    def shown_remarks(self) -> list[str]:
        """What a screen has room for; findings that have a line among the facts are not repeated."""
        if self.joints is None:
            return self.remarks
        told = ("units not stated", *(f"{name}: " for name, _ in self.lines))
        remarks = [shorten(each, LONGEST, placeholder=" ...") for each in self.remarks if not each.startswith(told)]
        room = ROWS - len(self.lines) - len(self.joints.records) - 2 * len(self.faults)
        most = max(1, room // 2 - 1)
        more = len(remarks) - most
        return [*remarks[:most], *[f"{more} more, and all of these whole: --json"] * (more > 0)]

    def as_data(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "format": FORMAT,
            "kind": self.kind,
            "facts": self.facts,
            "faults": self.faults,
            "remarks": self.remarks,
            "findings": [asdict(finding) for finding in self.findings],
            "verdict": self.verdict,
            "next": self.next,
        }
