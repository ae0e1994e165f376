"""Estimate a payload from recordings in files."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from catenary.identification.doubts import torque_findings
from catenary.identification.files import load_identification
from catenary.identification.payload import PayloadEstimate, estimate_payload, payload_candidates
from catenary.identification.samples import prepare
from catenary.recording.logs import Reading, read_torque_recording
from catenary.verdict.finding import judge, require_names
from catenary.verdict.stamps import stamp_findings


@dataclass(frozen=True)
class PayloadResult:
    """Estimated payload, and the candidates on other links where its place was not given."""

    payload: PayloadEstimate
    candidates: tuple[PayloadEstimate, ...]
    notes: tuple[str, ...]

    def summary(self) -> dict[str, Any]:
        """Return plain data."""
        candidates = [asdict(other) for other in self.candidates]
        return {
            **asdict(self.payload),
            "location": self.payload.location,
            "candidates": candidates,
            "notes": list(self.notes),
        }


def payload_of_files(
    logs: Sequence[Path],
    model: Path,
    *,
    at: tuple[str, Sequence[float]] | None = None,
    unloaded: Sequence[Path] = (),
    cutoff_hz: float | None = None,
    reading: Reading | None = None,
    accept: tuple[str, ...] = (),
) -> PayloadResult:
    """Estimate the payload of an arm from recordings and the parameters identified without it.

    Recordings are judged first: torques of another sign or unit than those identified are no payload.

    Args:
        logs: Recordings with the payload.
        model: Parameters that identification wrote.
        at: Frame and place in it (3,) [m], if known.
        unloaded: Recordings without it, of the same day.
        cutoff_hz: Of the filter, when it shall not be that of the identification.
        reading: Mapping of recordings of another make, and what to change of them.
        accept: Findings about them to go on with, by name.

    Raises:
        DataError: Stamps, or torques of the wrong sign, of other axes or in another unit, that `accept` does not name.
        FileFormatError: A file is missing, damaged or of another kind.
        InputError: A recording is not of this robot, in other units, or too short; or an unknown frame.
    """
    result, card = load_identification(model)
    # numbers in degrees are refused by the robot's limits, numbers brought to rad since would pass as small ones
    mends = {key: texts for key, texts in card.get("mends", {}).items() if key != "units"}
    options = result.options if cutoff_hz is None else replace(result.options, cutoff_hz=cutoff_hz)
    require_names(accept)
    read = [read_torque_recording(path, result.model, reading, mends) for path in (*logs, *unloaded)]
    notes = judge([(log.name, each) for log in read for each in stamp_findings(log)], accept, done="weighed")
    notes += [f"{log.name}: {note}" for log in read for note in log.notes]
    samples = [prepare(log, result.model, options) for log in read]
    notes += [f"{part.name}: {note}" for part in samples for note in part.notes]
    tested = result.test(samples)
    doubts = [
        (s.name, each) for s in samples for each in torque_findings(tested, s, fitted=False, may_carry=True)
    ]
    notes += judge(doubts, accept, done="weighed")
    loaded, empty = samples[: len(logs)], samples[len(logs) :]
    if at is not None:
        best, *candidates = (estimate_payload(result, loaded, at=at, unloaded=empty),)
    else:
        best, *candidates = payload_candidates(result, loaded, unloaded=empty)
    if best.mass is None:
        notes.append(
            "the motion shows only mass times place, not the mass by itself; give its place with --at"
        )
    return PayloadResult(best, tuple(candidates), tuple(notes))
