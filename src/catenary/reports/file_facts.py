"""What a file holds, as numbers with units for programs and as lines for people: robot, recording, model, dynamics.

Positions are in a joint's own `unit` (rad, m), errors in its `error_unit` (deg, mm). None: not stated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from catenary.reports.calibration import shortened
from catenary.units import DISPLAY

Part = Literal["training", "test"]
Line = tuple[str, str]  # what a fact is called, and what it says


@dataclass(frozen=True)
class FileFacts:
    """What is told of every kind of file."""

    def as_data(self) -> dict[str, Any]:
        """Return plain data; the keys are the fields below."""
        return asdict(self)

    def in_words(self) -> list[Line]:
        """Return the facts as people read them."""
        raise NotImplementedError


@dataclass(frozen=True)
class JointLimits:
    """A joint of a robot; infinite limits are none."""

    name: str
    unit: str
    lower: float
    upper: float


@dataclass(frozen=True)
class RobotFacts(FileFacts):
    """A robot's description."""

    name: str
    joints: tuple[JointLimits, ...]
    links: tuple[str, ...]
    frames: tuple[str, ...]
    tip: str
    moving_mass_kg: float
    massless_links: tuple[str, ...]
    links_without_inertia: tuple[str, ...]
    sources: tuple[str, ...]

    def in_words(self) -> list[Line]:  # noqa: D102
        joints = []
        for joint in self.joints:
            shown, scale = DISPLAY[joint.unit]
            free = np.isinf(joint.lower) and np.isinf(joint.upper)
            limits = "no limits" if free else f"{scale * joint.lower:g} to {scale * joint.upper:g} {shown}"
            joints.append(f"{joint.name} [{joint.unit}] {limits}")
        return [
            ("name", self.name),
            ("joints", "; ".join(joints)),
            ("links", ", ".join(self.links)),
            ("frames", ", ".join(self.frames)),
            ("tip", self.tip),
            ("moving mass", f"{self.moving_mass_kg:g} kg"),
            ("massless links", ", ".join(self.massless_links) or "none"),
            ("sources", "; ".join(self.sources) or "none stated"),
        ]


@dataclass(frozen=True)
class JointRange:
    """A joint of a recording: where it was commanded, and how far off it was measured."""

    name: str
    unit: str
    lowest: float
    highest: float
    error_unit: str
    error_rms: float | None
    error_largest: float | None


@dataclass(frozen=True)
class RecordingFacts(FileFacts):
    """A recording of commands and, where it has them, measurements."""

    name: str
    rows: int
    measured_rows: int  # with a trusted measurement
    robot: str | None
    simulated: bool  # false also where nobody says so
    sha256: str | None
    duration_s: float | None
    median_step_s: float | None
    gaps: int | None  # far longer than the median step
    longest_gap_s: float | None
    joints: tuple[JointRange, ...]

    def in_words(self) -> list[Line]:
        """Return the facts as people read them."""
        lines = [
            ("rows", f"{self.rows:,}, {self.measured_rows:,} with a trusted measurement"),
            ("joints", _names(self.joints)),
            ("robot", self.robot or "not stated"),
            ("simulated", "yes" if self.simulated else "not said"),
            ("sha256", self.sha256 or "unknown"),
        ]
        if self.duration_s is not None:
            lines.append(("duration", f"{self.duration_s:.1f} s, median step {self.median_step_s:.4g} s"))
        for joint in self.joints:
            shown, scale = DISPLAY[joint.unit]
            fact = f"{scale * joint.lowest:.2f} to {scale * joint.highest:.2f} {shown}"
            if joint.error_rms is not None:
                fact += f", error RMS {joint.error_rms:.3f}, largest {joint.error_largest:.2f} {joint.error_unit}"
            lines.append((joint.name, fact))
        return lines


@dataclass(frozen=True)
class UnseenErrors:
    """A joint's errors on blocks of time that a model did not see: mean and standard deviation over the blocks."""

    rmse: float
    rmse_sd: float
    offset_rmse: float

    @property
    def is_worse_than_offset(self) -> bool:
        """Whether the fixed offset does better; two ways to sum the same offset differ in their last digits."""
        return self.rmse > self.offset_rmse * (1.0 + 1e-9)


@dataclass(frozen=True)
class HeldOutErrors:
    """A joint's errors on the last part of the recordings, which a model did not see."""

    rmse: float
    offset_rmse: float


@dataclass(frozen=True)
class ModelJoint:
    """A joint that a model corrects."""

    name: str
    unit: str
    error_unit: str
    cross_validation: UnseenErrors | None
    held_out: HeldOutErrors | None


@dataclass(frozen=True)
class FittedTo:
    """A recording that a model was fitted to."""

    name: str
    sha256: str | None


@dataclass(frozen=True)
class ModelFacts(FileFacts):
    """A calibration model."""

    model: str  # kind
    preset: str | None
    robot: str | None
    simulated: bool
    joints: tuple[ModelJoint, ...]
    inputs: tuple[str, ...]
    target: str
    fitted_to: tuple[FittedTo, ...]
    rows: int
    seed: int | None
    version: Mapping[str, Any]

    def in_words(self) -> list[Line]:
        """Return the facts as people read them."""
        fitted_to = (f"{log.name} (sha256 {str(log.sha256)[:12]})" for log in self.fitted_to)
        lines = [
            ("kind", self.model + (f", preset {self.preset}" if self.preset else "")),
            ("robot", self.robot or "not stated"),
            ("simulated", "yes: fitted to simulated recordings" if self.simulated else "no"),
            ("joints", _names(self.joints)),
            ("inputs", f"{len(self.inputs)}: {shortened(self.inputs)}"),
            ("target", self.target),
            ("fitted to", ", ".join(fitted_to)),
            ("rows", str(self.rows)),
            ("seed", "none" if self.seed is None else str(self.seed)),
            _version(self.version),
        ]
        for joint in self.joints:
            if (unseen := joint.cross_validation) is not None:
                spread = f"RMSE {unseen.rmse:.3f} ± {unseen.rmse_sd:.3f} {joint.error_unit} on unseen blocks of time"
                lines.append((joint.name, f"{spread} (fixed offset {unseen.offset_rmse:.3f})"))
        for joint in self.joints:
            if (last := joint.held_out) is not None:
                where = "on the last part of the recordings, which it did not see"
                error = f"RMSE {last.rmse:.3f} {joint.error_unit} {where}"
                lines.append((f"{joint.name}, held out", f"{error} (fixed offset {last.offset_rmse:.3f})"))
        return lines


@dataclass(frozen=True)
class TorqueErrors:
    """How far identified dynamics are from the torques of a recording, per joint."""

    name: str
    part: Part
    verdict: str | None  # of a test
    relative_rms: Mapping[str, float]  # by joint; of the torque's own RMS


@dataclass(frozen=True)
class DynamicsFacts(FileFacts):
    """Identified dynamics."""

    robot: str
    terms: str
    base_parameters: int
    condition: float
    physically_consistent: bool
    recordings: tuple[TorqueErrors, ...]
    version: Mapping[str, Any]

    def in_words(self) -> list[Line]:
        """Return the facts as people read them."""
        return [
            ("robot", self.robot),
            ("terms", self.terms),
            ("base parameters", f"{self.base_parameters}, condition {self.condition:.4g}"),
            ("physically consistent", "yes" if self.physically_consistent else "no"),
            *(
                (f"{r.name}, {r.verdict or 'fitted'}", ", ".join(f"{v:.3f}" for v in r.relative_rms.values()))
                for r in self.recordings
            ),
            _version(self.version),
        ]


def _names(joints: Sequence[JointRange | ModelJoint]) -> str:
    return ", ".join(f"{joint.name} [{joint.unit}]" for joint in joints)


def _version(version: Mapping[str, Any]) -> Line:
    return "version", ", ".join(f"{name} {number}" for name, number in version.items())
