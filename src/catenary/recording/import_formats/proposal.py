"""The mapping that a recording suggests, as TOML to edit; what cannot be told is asked, never chosen in silence."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from catenary.config import parse_settings
from catenary.documents import toml_table
from catenary.errors import InputError
from catenary.recording.import_formats.column_groups import (
    Candidate,
    Kind,
    Role,
    candidates_of,
    ok_columns,
    pose_references,
)
from catenary.recording.import_formats.column_units import encoder_units, nominal_units
from catenary.recording.import_formats.columns import Stream
from catenary.recording.import_formats.mapping import RecordingMapping
from catenary.recording.import_formats.sources import Sources
from catenary.recording.import_formats.table_time import time_columns, time_of
from catenary.robots.catalog import load_robot
from catenary.visible import visible

_JOINTS_SHOWN = 8


@dataclass(frozen=True)
class Proposal:
    """A mapping as TOML, what was decided in it, and what is left to the reader."""

    toml: str
    decisions: tuple[str, ...]
    questions: tuple[str, ...]

    def accepted(self) -> RecordingMapping:
        """Return the mapping."""
        if self.questions:
            raise InputError(
                "the proposed mapping leaves open: " + "; ".join(self.questions) + ". Edit it:\n" + self.toml
            )
        return parse_settings(toml_table(self.toml, "proposal"), RecordingMapping, "proposal")


@dataclass
class _Draft:
    """Lines of TOML, decisions and questions."""

    top: list[str] = field(default_factory=list)
    tables: list[str] = field(default_factory=list)
    decisions: list[str] = field(default_factory=list)
    questions: list[str] = field(default_factory=list)


def propose(sources: Sources, *, robot: str | None = None, units: str | None = None) -> Proposal:
    """Propose which columns are which quantity: by type, name, rate and range.

    Args:
        sources: A recording.
        robot: Catalogue name or file: units of the joints.
        units: Of the joints: of q_nominal, and of q_encoder where the names of its columns say none.
    """
    draft = _Draft()
    model = None if robot is None else load_robot(robot)
    found = candidates_of(sources.streams)
    for one in [one for one in found if not one.moves]:
        draft.decisions.append(f"{one.name} never changes, and was set aside")
    found = [one for one in found if one.moves]
    nominal, encoder = _positions(found, draft)
    if robot is not None:
        draft.top.append(f"robot = {_text(robot)}")
    if nominal is not None:
        chosen, why, is_sure = nominal_units(nominal, model, units)
        draft.questions += [] if is_sure else [f"the units of q_nominal ({why})"]
        _write(draft, "q_nominal", nominal, chosen, why if is_sure else f"OPEN: {why}")
        if encoder is not None:
            its, why, is_sure = encoder_units(encoder, nominal, chosen, units)
            draft.questions += [] if is_sure else [f"the units of q_encoder ({why})"]
            _write(draft, "q_encoder", encoder, its, why if is_sure else f"OPEN: {why}")
            if encoder.is_potentiometer:
                draft.questions.append(
                    f"whether the potentiometers {encoder.name} are q_encoder: they show encoders that were set wrong, "
                    "beyond their own error (a dVRK lets them differ by 5 deg and 5 mm), and hardly what cables do"
                )
        _further(found, nominal, draft)
    poses = [pose for stream in sources.streams for pose in pose_references(stream)]
    if encoder is None:
        _without_encoder(poses, robot, draft)
    _times(sources.streams, nominal, encoder, draft)
    for stream in sources.streams:
        draft.decisions += [f"{stream.name}: {note}" for note in stream.notes]
    return Proposal(_toml(draft), tuple(draft.decisions), tuple(draft.questions))


def _positions(found: Sequence[Candidate], draft: _Draft) -> tuple[Candidate | None, Candidate | None]:
    """Choose what the robot reports, or was told, and what measured the joints beside it."""

    def of(role: Role) -> list[Candidate]:
        return [one for one in found if one.kind == "position" and one.role == role]

    outside, reported, commanded, actual = (of("measured outside"), of("reported"), of("commanded"), of("actual"))
    if not reported and not commanded and not outside:
        reported = of("unknown")
        pair = None if actual else _command_and_measurement(reported)
        if pair is not None:
            draft.questions.append(
                f"which is q_nominal: {_ends(pair[0])} or {_ends(pair[1])}, which moves with it; the other is q_encoder"
            )
            return pair
    elif not reported and not commanded and not actual:
        reported = [one for one in of("unknown") if len(one.columns) == len(outside[0].columns)]
    if not outside and actual and (reported or commanded):
        outside = actual
        draft.questions.append(
            f"whether {actual[0].name} was measured at the joints (an encoder there, a camera); where the motors' "
            "encoders gave it, it is what the robot reports: q_nominal"
        )
        if commanded:
            reported = []
    choices = reported or commanded or ([] if outside else actual)
    if not choices:
        draft.questions.append("which columns are q_nominal, what the robot reports or was told")
        return None, None
    truth = _one(outside, "q_encoder", draft, len(choices[0].columns)) if outside else None
    nominal = _one(choices, "q_nominal", draft, len(truth.columns) if truth is not None else None)
    if reported and commanded and nominal.role == "reported":
        draft.decisions.append(
            f"q_nominal is what the robot reports ({nominal.name}), not what it was told ({commanded[0].name})"
        )
    if truth is None:
        if reported and commanded and nominal.role == "reported" and commanded[0].is_followed_by(nominal):
            draft.decisions.append(
                f"if a sensor at the joints measured {nominal.name}, it is q_encoder, and {commanded[0].name} is "
                "q_nominal"
            )
        return nominal, None
    return _same_joints(nominal, truth, draft)


def _command_and_measurement(found: Sequence[Candidate]) -> tuple[Candidate, Candidate] | None:
    """Return two groups of columns of which one follows the other, or the two halves of an array without names."""
    if len(found) == 1 and len(found[0].columns) % 2 == 0:
        columns, half = found[0].columns, len(found[0].columns) // 2
        found = [found[0].part(columns[:half]), found[0].part(columns[half:])]
    return (found[0], found[1]) if len(found) == 2 and found[0].is_followed_by(found[1]) else None


def _ends(one: Candidate) -> str:
    return f"{one.references[0]} ... {one.references[-1]}"


def _one(choices: Sequence[Candidate], what: str, draft: _Draft, count: int | None) -> Candidate:
    """Choose the only one, or the only one of as many joints; ask where several are left."""
    fitting = [one for one in choices if count is not None and len(one.columns) == count] or list(choices)
    typed = [one for one in fitting if one.stream.type.endswith("JointState")] or fitting
    if len(typed) > 1:
        draft.questions.append(f"which is {what}: {' or '.join(one.name for one in typed[:5])}")
    return typed[0]


def _same_joints(nominal: Candidate, truth: Candidate, draft: _Draft) -> tuple[Candidate, Candidate]:
    """Bring both to the same joints: by name where both have names."""
    if all(truth.joints) and all(nominal.joints):
        shared = [joint for joint in nominal.joints if joint in truth.joints]
        if shared and set(shared) in (set(truth.joints), set(nominal.joints)):
            both = tuple(
                one.part([one.columns[one.joints.index(joint)] for joint in shared]) for one in (nominal, truth)
            )
            return both[0], both[1]
        draft.questions.append(
            f"which joints of {truth.name} ({', '.join(truth.joints)}) are which of {nominal.name} "
            f"({', '.join(nominal.joints)})"
        )
    count = min(len(truth.columns), len(nominal.columns))
    if len(truth.columns) != len(nominal.columns):
        draft.questions.append(
            f"which {len(truth.columns)} of the {len(nominal.columns)} columns of {nominal.name} go with {truth.name}"
        )
    return nominal.part(nominal.columns[:count]), truth.part(truth.columns[:count])


def _further(found: Sequence[Candidate], nominal: Candidate, draft: _Draft) -> None:
    """Add velocity and effort of the same stream and joints."""
    names: tuple[tuple[Kind, str], ...] = (("velocity", "qd"), ("effort", "tau"))
    for kind, quantity in names:
        of_kind = [one for one in found if one.kind == kind and one.stream.name == nominal.stream.name]
        same = [one for one in of_kind if set(nominal.joints) <= set(one.joints) and all(nominal.joints)]
        parts = [one.part([one.columns[one.joints.index(joint)] for joint in nominal.joints]) for one in same]
        parts = parts or [one for one in of_kind if len(one.columns) == len(nominal.columns)]
        if len(parts) == 1 and parts[0].is_whole:
            said = "taken in Nm and N" if quantity == "tau" else "as q_nominal, per second"
            _write(draft, quantity, parts[0], (), said)
        elif len(parts) > 1:
            draft.decisions.append(f"{quantity} may be {' or '.join(one.name for one in parts[:5])}; none was taken")
    currents = [one.name for one in found if one.kind == "current"]
    if currents:
        draft.decisions.append(f"{currents[0]} seems to hold currents: tau needs a scale, Nm per unit")


def _without_encoder(poses: Sequence[str], robot: str | None, draft: _Draft) -> None:
    if not poses:
        draft.decisions.append(
            "nothing was found that measured the joints beside the robot itself: a fit needs q_encoder, an "
            "identification does not"
        )
        return
    draft.questions.append(
        f"whether {' or '.join(poses[:5])} tells where the joints were; then it needs the robot and two transforms"
    )
    lines = [
        "# joints from a tracked marker: take the # away, and fill in the robot (above) and the transforms",
        "# [q_encoder.pose]",
        f"# columns = {_text(poses[0])}",
        '# match = "position"     # or "pose", for more joints than a position tells',
        "# T_base_tracker = { position_m = [0, 0, 0], quaternion_wxyz = [1, 0, 0, 0] }",
        "# T_marker_frame = { position_m = [0, 0, 0], quaternion_wxyz = [1, 0, 0, 0] }",
    ]
    draft.tables += ["", *lines]


def _times(streams: Sequence[Stream], nominal: Candidate | None, encoder: Candidate | None, draft: _Draft) -> None:
    used = {one.stream.name: one.stream for one in (nominal, encoder) if one is not None}
    columns, units, said = list[str](), list[str](), list[str]()
    for stream in used.values():
        if stream.type != "table":
            continue
        valid = ok_columns(stream)
        if valid:
            draft.top.append(f"ok = [{', '.join(map(_text, valid))}]")
        named = time_columns(stream)
        try:
            found = time_of(stream, named[:1] if len(named) > 1 else (), None, None)
        except InputError as error:
            draft.questions.append(f"the time: {error}")
            columns.append(named[0])
            units.append("")
            continue
        if len(named) > 1:
            draft.questions.append(f"which column is the time: {' or '.join(named[:5])}")
        if found is not None and found.column:
            columns.append(found.column)
            units.append(found.unit)
            said.append(found.said)
        elif found is None:
            draft.decisions.append(f"{stream.name}: no column is the time; rate_hz gives rows one")
            draft.top.append("# rate_hz = 100.0  # rows a second: the table has no time")
    if columns:
        names = list(dict.fromkeys(map(_text, columns)))
        draft.top.append(f"time = {names[0] if len(names) == 1 else '[' + ', '.join(names) + ']'}")
        if len(set(units)) == 1 and units[0]:
            draft.top.append(f"time_unit = {_text(units[0])}  # {visible('; '.join(said))}")
        elif "" in units:
            draft.top.append('# time_unit = "s"  # OPEN: s, ms, us or ns, of all tables')
        else:
            draft.top.append(f"# {visible('; '.join(said))}")


def _write(draft: _Draft, quantity: str, one: Candidate, units: Sequence[str], why: str) -> None:
    ranges = [f"{low:.3g} to {high:.3g}" for low, high in one.ranges[:_JOINTS_SHOWN]]
    rate = f"{one.rate:.4g} Hz, " if np.isfinite(one.rate) else ""
    draft.tables += [
        "",
        f"[{quantity}]",
        f"# {one.stream.type}, {rate}{one.stream.rows} rows, {'; '.join(ranges)}",
        "columns = [" + ", ".join(map(_text, one.references)) + "]",
    ]
    if units:
        draft.tables.append(f"units = [{', '.join(map(_text, units))}]  # {visible(why)}")
    else:
        draft.tables.append(f"# {visible(why)}")


def _toml(draft: _Draft) -> str:
    """Return the text; a comment has no line feeds, whatever the names in it hold."""
    said = [f"# {line}" for line in draft.decisions] + [f"# OPEN: {line}" for line in draft.questions]
    lines = [*said, *draft.top, *draft.tables]
    return "\n".join(visible(line).replace("\n", "\\n").replace("\t", " ") for line in lines) + "\n"


def _text(value: str) -> str:
    return visible(json.dumps(value, ensure_ascii=False))
