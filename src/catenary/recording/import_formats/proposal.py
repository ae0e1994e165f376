"""Proposal of a mapping for a recording, as TOML to edit, with open questions where columns are ambiguous."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from catenary.bounded_parsers import toml_table
from catenary.config import parse_settings
from catenary.errors import InputError
from catenary.recording.import_formats.column_groups import (
    Candidate,
    PoseColumns,
    Role,
    candidates_of,
    moving_columns,
    ok_columns,
    poses_of,
)
from catenary.recording.import_formats.column_units import encoder_units, nominal_units
from catenary.recording.import_formats.columns import Stream, ends, listed, not_used, places_of
from catenary.recording.import_formats.mapping import SI, RecordingMapping, words_of
from catenary.recording.import_formats.recording_files import Sources
from catenary.recording.import_formats.table_time import UNITS, CoarseTimeError, time_columns, time_of, times_among
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.terminal_text import visible

_MAX_JOINTS_SHOWN = 8


class Proposal(NamedTuple):
    """A proposed mapping as TOML, with decisions, open questions and unused columns."""

    toml: str
    decisions: tuple[str, ...]
    questions: tuple[str, ...]
    not_used: tuple[str, ...] = ()

    def accepted(self) -> RecordingMapping:
        """Return the mapping, or refuse it if questions are open."""
        if self.questions:
            raise InputError(
                "the proposal has open questions: " + "; ".join(self.questions) + ". Answer, or edit it:\n" + self.toml
            )
        return parse_settings(toml_table(self.toml, "proposal"), RecordingMapping, "proposal")


@dataclass
class _Draft:
    """Lines of TOML, decisions and questions."""

    answers: Mapping[str, str]
    top: list[str] = field(default_factory=list)
    tables: list[str] = field(default_factory=list)
    decisions: list[str] = field(default_factory=list)
    questions: dict[str, tuple[str, dict[str, str]]] = field(default_factory=dict)  # text and choices, by subject
    heard: set[str] = field(default_factory=set)
    used: dict[str, set[str]] = field(default_factory=dict)  # columns of streams

    def ask(self, about: str, text: str, choices: Mapping[str, str], *, is_free: bool = False) -> str | None:
        """Return the answer: a choice or an unambiguous part of one, any text if `is_free`; None if unanswered."""
        if about not in self.answers:
            self.questions[about] = (text, dict(choices))
            return None
        self.heard.add(about)
        answer = self.answers[about]
        if is_free or answer in choices:
            return answer
        fits = [choice for choice in choices if answer.lower() in choice.lower()]
        fits = fits or [choice for choice, words in choices.items() if answer.lower() in words.lower()]
        if len(fits) == 1:
            return fits[0]
        raise InputError(f"--answer {about}={answer}: expected one of {', '.join(choices)}: {text}")


def propose(
    sources: Sources, *, robot: str | None = None, units: str | None = None, answers: Mapping[str, str] | None = None
) -> Proposal:
    """Propose the columns of each quantity.

    Args:
        sources: Files of the recording.
        robot: Catalogue name or file of a robot, for names, units and limits of joints.
        units: Units of q_nominal, and of q_encoder if it states none.
        answers: Answers to open questions.
    """
    draft = _Draft(answers or {})
    model = None if robot is None else load_robot(robot)
    candidates = _not_set_aside(candidates_of(sources.streams, sources.today, model), draft)
    nominal, encoder = _positions(candidates, sources.streams, draft)
    if encoder is not None and encoder.is_potentiometer:
        text = (
            f"whether the potentiometers {encoder.name} are q_encoder: they show encoders that were set wrong, beyond "
            "their own error (a dVRK lets them differ by 5 deg and 5 mm), and hardly what cables do"
        )
        if draft.ask("q_encoder", text, {encoder.references[0]: "they are", "none": "they are not"}) == "none":
            encoder = None
    if nominal is not None and model is not None and len(nominal.columns) > model.n:
        every = nominal.columns
        nominal = _some_of(nominal, model.n, "q_nominal", f"are the joints of {model.name}", draft)
        if encoder is not None and len(encoder.columns) == len(every):
            encoder = encoder.part([encoder.columns[every.index(column)] for column in nominal.columns])
    if nominal is not None and model is not None and len(nominal.columns) < model.n and not nominal.stream.joints:
        text = f"which columns are the {model.n} joints of {model.name} ({', '.join(model.joint_names)})"
        only = {",".join(nominal.references): f"only these {len(nominal.columns)} were recorded, or any others"}
        nominal = _as_answered(draft.ask("q_nominal.columns", text, only, is_free=True), sources.streams) or nominal
    draft.top += [] if robot is None else [f"robot = {_text(robot)}"]
    if nominal is not None:
        chosen, why, is_sure = nominal_units(nominal, model, units)
        chosen, why = (chosen, why) if is_sure else _units_to_state("q_nominal", chosen, why, draft)
        _write(draft, "q_nominal", nominal, chosen, why)
        if encoder is not None:
            its, why, is_sure = encoder_units(encoder, nominal, chosen, units)
            its, why = (its, why) if is_sure else _units_to_state("q_encoder", its, why, draft)
            _write(draft, "q_encoder", encoder, its, why)
        _further(candidates, nominal, draft)
    used = [one.stream for one in (nominal, encoder) if one is not None]
    if encoder is None:
        own = set[str]() if nominal is None else {*nominal.columns}
        poses = [pose for pose in poses_of(sources.streams) if not pose.is_own and not own & {*pose.taken}]
        tracked = _tracked(poses, model, nominal, draft)
        used += [stream for stream in sources.streams if tracked is not None and stream.name == tracked.stream]
    _times({stream.name: stream for stream in used}, draft, sources.today)
    for stream in sources.streams:
        draft.decisions += [f"{stream.name}: {note}" for note in stream.notes]
        moved = moving_columns(stream, sources.today) if stream.type == "table" else None
        draft.decisions += [] if moved is None else [f"{stream.name}: {moved.said()}"]
    left = not_used(sources.streams, draft.used)
    draft.decisions += [f"not used: {listed(left)}"] * bool(left)
    unheard = [about for about in draft.answers if about not in draft.heard]
    questions = tuple(
        f"{text}: " + " or ".join(f"--answer {about}={visible(choice)}" for choice in choices)
        for about, (text, choices) in draft.questions.items()
    )
    if unheard:
        none = "nothing is open: leave --answer out and say --yes, or name columns and units by --map"
        raise InputError(f"--answer {unheard[0]}: the proposal does not ask this: {'; '.join(questions) or none}")
    comments = [f"# {line}" for line in draft.decisions]
    for about, (text, choices) in draft.questions.items():
        comments += [
            f"# OPEN: {text}",
            *(f"#   --answer {about}={choice}   {words}" for choice, words in choices.items()),
        ]
    lines = map(visible, [*comments, *draft.top, *draft.tables])
    toml = "".join(line.replace("\n", "\\n").replace("\t", " ") + "\n" for line in lines)  # no comment has line feeds
    return Proposal(toml, tuple(draft.decisions), questions, left)


def answers_of(options: Sequence[str]) -> dict[str, str]:
    """Return answers such as "q_encoder=cam" by question."""
    parted = {option: option.partition("=") for option in options}
    for option, (about, _, answer) in parted.items():
        if not about.strip() or not answer.strip():
            raise InputError(f"--answer {option}: expected QUESTION=ANSWER, such as q_encoder=cam")
    return {about.strip(): answer.strip() for about, _, answer in parted.values()}


def _units_to_state(quantity: str, units: Sequence[str], why: str, draft: _Draft) -> tuple[tuple[str, ...], str]:
    """Return uncertain units as answered, or as inferred with an open question."""
    about, stand = f"{quantity}.units", ",".join(units)
    other = ",".join({"rad": "deg", "deg": "rad", "m": "mm", "mm": "m"}.get(unit, unit) for unit in units)
    choices = {stand: "as they stand below", other: "or any of rad, deg, m, mm for each"}
    answer = draft.ask(about, f"the units of {quantity} ({why})", choices, is_free=True)
    words = words_of(answer)
    if answer is None:
        return tuple(units), f"OPEN: {why}"
    if len(words) not in (1, len(units)) or not set(words) <= set(SI):
        raise InputError(f"--answer {about}={answer}: expected one of {', '.join(SI)} for each of {len(units)} columns")
    return tuple(words * len(units) if len(words) == 1 else words), "as answered"


def _not_set_aside(candidates: Sequence[Candidate], draft: _Draft) -> list[Candidate]:
    """Return the columns that move; for an arm at rest, instead of other positions, those named as joint positions."""
    kept = [one for one in candidates if one.moves]
    others = [one for one in kept if one.kind != "position" or one.role == "measured outside"]
    resting = [one for one in candidates if len(one.columns) > 1]  # a column alone may be anything
    still = [one for one in resting if one.says_position]
    if len(others) == len(kept):  # no position moves: any may be of joints
        still = still or [one for one in resting if one.kind == "position" and one.role != "measured outside"]
    if still and not any(one.says_position for one in kept):
        draft.decisions += [f"{one.name} never changes: the arm stands still" for one in still]
        kept = [*still, *others]
    draft.decisions += [
        f"{one.name} never changes, and was set aside" for one in candidates if not (one.moves or one in kept)
    ]
    return kept


def _as_answered(answer: str | None, streams: Sequence[Stream]) -> Candidate | None:
    """Return the columns listed in an answer; None without an answer."""
    places = [place for reference in words_of(answer) for place in places_of(reference, streams)]
    columns = tuple(place.column for place in places)
    of = [stream for stream in streams if columns and stream.name == places[0].stream]
    return Candidate(of[0], columns, "position", "unknown", ("",) * len(columns)) if of else None


def _positions(
    candidates: Sequence[Candidate], streams: Sequence[Stream], draft: _Draft
) -> tuple[Candidate | None, Candidate | None]:
    """Choose q_nominal, reported or commanded positions, and q_encoder, measured ones."""

    def of(role: Role) -> list[Candidate]:
        return [one for one in candidates if one.kind == "position" and one.role == role]

    outside, commanded, actual, measured = of("measured outside"), of("commanded"), of("actual"), of("measured")
    own, estimated, unknown = of("own"), of("estimated"), of("unknown")
    reported = [*own, *estimated, *of("reported")]
    # beside motors: joints that follow from these, or have sensors of their own
    beside = of("reported") if own and not (estimated or commanded or actual) else []
    if not own and not estimated:
        reported, measured = [*reported, *measured], []
    if not reported and not commanded and not outside and not measured:
        reported = unknown
        pair = None if actual else _command_and_measurement(reported)
        if pair is not None:
            both = f"{ends(pair[0].references)} or {ends(pair[1].references)}"
            text = f"which is q_nominal: {both}; the other is q_encoder"
            words = {one.references[0]: f"{ends(one.references)} is q_nominal" for one in pair}
            return pair[::-1] if draft.ask("q_nominal", text, words) == pair[1].references[0] else pair
    elif not reported and not commanded and not actual and outside:
        reported = [one for one in unknown if len(one.columns) == len(outside[0].columns)]
    if not outside and measured and own:
        outside = measured
        draft.decisions.append(f"q_nominal is what the robot reports ({own[0].name}), q_encoder what was measured")
    elif not outside and (measured or beside or (actual and (reported or commanded))):
        outside = measured or beside or actual
        doubt = outside[0]
        answer = draft.ask(
            "q_encoder",
            f"whether {doubt.name} was measured at the joints (an encoder there, a camera); where the motors' "
            "encoders gave it, it is what the robot reports: q_nominal",
            {doubt.references[0]: f"{doubt.name} was measured at the joints", "none": f"{doubt.name} is q_nominal"},
        )
        if answer == "none":
            outside, reported = [], outside
        elif beside:
            reported = own
        elif commanded and actual:
            reported = []
    pots = [one for one in outside if one.is_potentiometer]
    if not reported and not commanded and not measured and pots and len(pots) < len(outside):  # a dVRK's raw ones
        outside, reported = pots, [one for one in outside if one not in pots]
    choices = reported or commanded or ([] if outside else actual)
    if not choices:
        answer = draft.ask(
            "q_nominal.columns",
            "which columns are q_nominal, what the robot reports or was commanded",
            {"COLUMN,COLUMN,...": "columns in the order of the joints, as --map has them"},
            is_free=True,
        )
        one = _as_answered(answer, streams)
        if one is None:
            return None, None
        choices = [one]
    truth = _one(outside, "q_encoder", draft, len(choices[0].columns)) if outside else None
    nominal = _one(choices, "q_nominal", draft, len(truth.columns) if truth is not None else None)
    if reported and commanded and nominal.role != "commanded":
        draft.decisions.append(
            f"q_nominal is what the robot reports ({nominal.name}), not what it was commanded ({commanded[0].name})"
        )
    if truth is None:
        if reported and commanded and nominal.role != "commanded" and commanded[0].is_followed_by(nominal):
            draft.decisions.append(
                f"if a sensor at the joints measured {nominal.name}: --map q_nominal="
                f"{','.join(commanded[0].references)} --map q_encoder={','.join(nominal.references)}"
            )
        return nominal, None
    return _same_joints(nominal, truth, draft)


def _command_and_measurement(candidates: Sequence[Candidate]) -> tuple[Candidate, Candidate] | None:
    """Return two groups of columns, or halves of one array, of which one follows the other or is in another table."""
    if len(candidates) == 1 and len(candidates[0].columns) % 2 == 0:
        columns, half = candidates[0].columns, len(candidates[0].columns) // 2
        candidates = [candidates[0].part(columns[:half]), candidates[0].part(columns[half:])]
    if len(candidates) != 2:
        return None
    a, b = candidates
    of_two = a.is_of_several and a.stream.name != b.stream.name and len(a.columns) == len(b.columns)
    return (a, b) if of_two or a.is_followed_by(b) else None


def _one(choices: Sequence[Candidate], what: str, draft: _Draft, count: int | None) -> Candidate:
    """Choose the only candidate, or the only one with `count` joints; ask if several are left."""
    fitting = [one for one in choices if count is not None and len(one.columns) == count] or list(choices)
    fitting = [one for one in fitting if len(one.columns) > 1] or fitting  # a gripper's is one
    typed = [one for one in fitting if one.stream.type.endswith("JointState")] or fitting
    if len(typed) == 1:
        return typed[0]
    named = {one.references[0]: one for one in typed}
    text = f"which is {what}: {' or '.join(one.name for one in typed[:5])}"
    answer = draft.ask(what, text, {key: one.name for key, one in named.items()})
    return typed[0] if answer is None else named[answer]


def _same_joints(nominal: Candidate, truth: Candidate, draft: _Draft) -> tuple[Candidate, Candidate]:
    """Reduce both to the same joints, by name if both have names."""
    if all(truth.joints) and all(nominal.joints):
        shared = [joint for joint in nominal.joints if joint in truth.joints]
        if shared and set(shared) in (set(truth.joints), set(nominal.joints)):
            return nominal.of_joints(shared), truth.of_joints(shared)
        draft.ask(
            "joints",
            f"which joints of {truth.name} ({', '.join(truth.joints)}) are which of {nominal.name} "
            f"({', '.join(nominal.joints)})",
            {"in order": "the first is the first, and so on"},
        )
    count = min(len(truth.columns), len(nominal.columns))
    if len(nominal.columns) > count:
        return _some_of(nominal, count, "q_nominal", f"go with {truth.name}", draft), truth
    return nominal, _some_of(truth, count, "q_encoder", f"go with {nominal.name}", draft)


def _some_of(one: Candidate, count: int, quantity: str, why: str, draft: _Draft) -> Candidate:
    """Choose `count` columns of a group; ask if it has more."""
    if len(one.columns) == count:
        return one
    about, first = f"{quantity}.columns", ",".join(one.references[:count])
    text = f"which {count} of the {len(one.columns)} columns of {one.name} {why}"
    answer = draft.ask(about, text, {first: "as they stand below, or any others"}, is_free=True)
    chosen = [place.column for reference in words_of(answer) for place in places_of(reference, [one.stream])]
    if answer is not None and (len(chosen) != count or not set(chosen) <= set(one.columns)):
        raise InputError(f"--answer {about}={answer}: expected {count} of {', '.join(one.references)}")
    return one.part(chosen or one.columns[:count])


def _further(candidates: Sequence[Candidate], nominal: Candidate, draft: _Draft) -> None:
    """Add velocity and effort of the same stream and joints, or of their places in arrays as long."""
    named = [one.columns for one in candidates if one.stream.name == nominal.stream.name]
    whole = next((columns for columns in named if {*nominal.columns} <= {*columns}), nominal.columns)
    count, places = len(whole), [whole.index(column) for column in nominal.columns]
    for kind, quantity in (("velocity", "qd"), ("effort", "tau")):
        of_kind = [one for one in candidates if one.kind == kind and one.stream.name == nominal.stream.name]
        of_kind = of_kind or [one for one in candidates if one.kind == kind and {*one.columns} == {*nominal.columns}]
        same = [one for one in of_kind if set(nominal.joints) <= set(one.joints) and all(nominal.joints)]
        parts = [one.of_joints(nominal.joints) for one in same]
        parts = parts or [
            one.part([one.columns[place] for place in places]) for one in of_kind if len(one.columns) == count
        ]
        if nominal.role != "commanded":
            parts = [one for one in parts if one.role != "commanded"] or parts
        if len(parts) == 1 and parts[0].is_whole:
            its, scale = parts[0].stated_units(), parts[0].stated_scale()
            by = "by the names of the columns" if its or scale else ""
            words = f"Nm and N a unit, {by}" if scale else "taken in Nm and N"
            words = words if quantity == "tau" else f"per second, {by or 'as q_nominal'}"
            _write(draft, quantity, parts[0], its or () if quantity == "qd" else (), words, scale or ())
        elif len(parts) > 1:
            draft.decisions.append(f"{quantity} may be {' or '.join(one.name for one in parts[:5])}; none was taken")
    currents = [one.name for one in candidates if one.kind == "current"]
    if currents:
        draft.decisions.append(f"{currents[0]} seems to hold currents: tau needs a scale, Nm per unit")


def _tracked(
    poses: Sequence[PoseColumns], model: RobotModel | None, nominal: Candidate | None, draft: _Draft
) -> PoseColumns | None:
    """Ask whether a tracked pose measures the joints; return the chosen one."""
    if not poses:
        draft.decisions.append(
            "no measurement of the joints apart from the robot's own was found: a fit needs q_encoder, an "
            "identification does not"
        )
        return None
    named = {} if model is None else {one.references[0]: one for one in poses}
    answer = draft.ask(
        "q_encoder",
        f"whether {' or '.join(pose.name for pose in poses[:5])} tells where the joints were; then it needs "
        f"{'the robot (--robot), and ' if model is None else ''}which of its frames the marker is on",
        {key: f"{one.name} does" for key, one in named.items()} | {"none": "it does not, or is not wanted"},
    )
    if answer == "none":
        return None
    one = poses[0] if answer is None else named[answer]
    width = len(one.taken)
    turns = one.orientation if width > 3 else "xyzw"
    joints = 0 if nominal is None else len(nominal.columns)
    match = "pose" if width > 3 and joints > 3 else "position"
    frame = '# frame = "..."  # of the robot, that the marker is on; its tip where none is given'
    links = {} if model is None else {of.link: name for name, of in reversed([*model.frames.items()])}
    if model is not None and 0 < joints < model.n == 1 + max(links):  # a link for each joint
        frame = f'frame = "{links[joints - 1]}"  # which the last joint that was recorded moves'
    lines = [
        "[q_encoder.pose]",
        f"columns = [{', '.join(map(_text, one.references))}]",
        *[f'unit = "{one.units[0]}"  # by its size or name'] * (one.units[0] != "m"),
        *[f'orientation = "{turns}"  # {one.doubt or "of the quaternion"}'] * (turns != "xyzw"),
        *[f'angle_unit = "{one.units[1]}"  # by its size or name'] * (one.units[1] != "rad"),
        f'match = "{match}"  # "position" tells three joints at most, "pose" six',
        frame,
        "# T_base_tracker and T_marker_frame are found from the recording where they are not given",
    ]
    if answer is None:
        lines = ["# joints from a tracked marker: take the # away", *(f"# {line}" for line in lines)]
    else:
        draft.used.setdefault(one.stream, set()).update(one.taken)
    draft.tables += ["", *lines]
    return None if answer is None else one


def _times(used: Mapping[str, Stream], draft: _Draft, today: float) -> None:
    columns, units, notes = list[str](), list[str](), list[str]()
    tables = [stream for stream in used.values() if stream.type == "table"]
    trusted = [(stream.name, column) for stream in tables for column in ok_columns(stream)]
    if trusted:
        names = [f"{table}:{column}" if len(tables) > 1 else column for table, column in trusted]
        draft.top.append(f"ok = [{', '.join(map(_text, names))}]")
    for stream in tables:
        draft.used[stream.name].update(column for table, column in trusted if table == stream.name)
        named = time_columns(stream)
        column: str | None = named[0] if named else None
        if len(named) > 1:
            text = f"which column is the time: {' or '.join(named[:5])}"
            column = draft.ask("time", text, dict.fromkeys(named, "is the time")) or column
        draft.used[stream.name].update(times_among(stream, [column or ""]))
        try:
            time = time_of(stream, named and [column or ""], None, None, today=today)
        except CoarseTimeError as error:
            rate = draft.ask("rate_hz", str(error), {"HZ": "rows a second"}, is_free=True)
            draft.top += [f"rate_hz = {rate}"] * (rate is not None)
            continue
        except InputError as error:
            unit = draft.ask("time_unit", f"the time: {error}", dict.fromkeys(UNITS, "of all tables"), is_free=True)
            if unit is None:
                columns.append(column or "")
                units.append("")
                continue
            time = time_of(stream, [column or ""], unit, None, today=today)
        if time is not None and time.column:
            columns.append(time.column)
            units.append(time.unit)
            notes.append(time.said)
        elif time is None:
            draft.decisions.append(f"{stream.name}: no column is the time; rate_hz gives rows one")
            draft.top.append("# rate_hz = 100.0  # rows a second: the table has no time")
    if columns:
        names = list(dict.fromkeys(map(_text, columns)))
        draft.top.append(f"time = {names[0] if len(names) == 1 else '[' + ', '.join(names) + ']'}")
        if len(set(units)) == 1 and units[0]:
            draft.top.append(f"time_unit = {_text(units[0])}  # {visible('; '.join(notes))}")
        elif "" in units:
            draft.top.append('# time_unit = "s"  # OPEN: s, ms, us, ns or such as 4000Hz, of all tables')
        else:
            draft.top.append(f"# {visible('; '.join(notes))}")


def _write(
    draft: _Draft, quantity: str, one: Candidate, units: Sequence[str], why: str, scale: Sequence[float] = ()
) -> None:
    draft.used.setdefault(one.stream.name, set()).update(one.columns)
    ranges = [f"{low:.3g} to {high:.3g}" for low, high in one.ranges[:_MAX_JOINTS_SHOWN]]
    rate = f"{one.rate:.4g} Hz, " if np.isfinite(one.rate) else ""
    draft.tables += [
        "",
        f"[{quantity}]",
        f"# {one.stream.type}, {rate}{one.stream.rows} rows, {'; '.join(ranges)}",
        "columns = [" + ", ".join(map(_text, one.references)) + "]",
    ]
    if units or set(scale) - {1.0}:
        what, values = ("units", map(_text, units)) if units else ("scale", map(str, scale))
        draft.tables.append(f"{what} = [{', '.join(values)}]  # {visible(why)}")
    else:
        draft.tables.append(f"# {visible(why)}")


def _text(value: str) -> str:
    return visible(json.dumps(value, ensure_ascii=False))
