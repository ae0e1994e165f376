"""Import of third-party recordings into a MotionLog, by a mapping of columns to quantities."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from catenary.arrays import Flags, Floats, Integers
from catenary.bounded_parsers import cut
from catenary.errors import InputError
from catenary.plant import Joints, MotionLog, joint_indices, joints_text, nameless
from catenary.recording.import_formats.column_groups import Candidate, joints_meant
from catenary.recording.import_formats.column_units import Units, encoder_units, factors, joint_units_of
from catenary.recording.import_formats.columns import Place, Stream, listed, not_used, places_of
from catenary.recording.import_formats.mapping import JOINT_QUANTITIES, Quantity, RecordingMapping, TrackedPose
from catenary.recording.import_formats.recording_files import Sources
from catenary.recording.import_formats.sampled_signals import Series, TopicReport, interpolate
from catenary.recording.import_formats.synchronisation import CommonMotion, InSi, OneClock
from catenary.recording.import_formats.table_time import times_among
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.topics import SECOND
from catenary.transmission.cable_elasticity import joint_forces
from catenary.verdict.whole_turns import TURN, in_one_turn, unwrapped

_SIGNED = "-"
_BESIDE_NS = 10_000_000  # [ns] before and after a pose, for a speed by finite differences


class _Found(NamedTuple):
    """Places of a quantity's columns, and the sign of each."""

    places: list[Place]
    sign: Floats


class _Columns:
    """Places of each quantity's columns, and the columns to read from each stream."""

    def __init__(self, where: str, mapping: RecordingMapping, streams: Sequence[Stream]) -> None:
        """Find the columns that a mapping names."""
        self._streams = streams
        self.requested: dict[str, dict[str, None]] = {}
        self.found: dict[str, _Found] = {}  # of JOINT_QUANTITIES, "ok", "signal NAME" and "pose"
        for key in JOINT_QUANTITIES:
            quantity: Quantity | None = getattr(mapping, key)
            if quantity is not None and quantity.pose is not None:
                from catenary.recording.import_formats.tracked_pose import pose_places  # brings kinematics

                self._keep("pose", pose_places(quantity.pose, streams))
            elif quantity is not None:
                self._find(key, quantity.columns, optional=quantity.optional)
        if mapping.ok:
            self._find("ok", mapping.ok)
        for key, signal in mapping.signals.items():
            self._find(f"signal {key}", signal.columns, optional=signal.optional)
        base = self.found["q_nominal"].places
        for key in self.joints:
            if len(self.found[key].places) != len(base):
                n = len(self.found[key].places)
                raise InputError(f"{where}: {key} has {n} columns, q_nominal {len(base)}; expected as many")
        self.tip: tuple[str, tuple[str, ...]] | None = None
        if mapping.robot is not None:
            from catenary.recording.import_formats.tracked_pose import tip_columns

            self.tip = tip_columns(streams, base[0].stream)
        if self.tip is not None:
            self._want([Place(self.tip[0], column) for column in self.tip[1]])
        for stream in streams:
            if stream.name in mapping.reported:
                self.requested.setdefault(stream.name, {})
            if stream.type == "table" and stream.name in self.requested:
                self._want([Place(stream.name, column) for column in times_among(stream, mapping.time)])

    @property
    def joints(self) -> list[str]:
        """Quantities with a column for each joint."""
        return [key for key in JOINT_QUANTITIES if key in self.found]

    def _find(self, key: str, references: Sequence[str], *, optional: bool = False) -> None:
        """Find the columns of references, and mark them to be read; skip a missing optional quantity."""
        places, signs = list[Place](), list[float]()
        for reference in references:
            try:
                of_reference, sign = places_of(reference, self._streams), 1.0
            except InputError as error:
                if optional:
                    return
                if not reference.startswith(_SIGNED):
                    raise InputError(f"{key}: {error}") from error
                of_reference, sign = places_of(reference[1:], self._streams), -1.0
            places += of_reference
            signs += [sign] * len(of_reference)
        self._keep(key, places, signs)

    def _keep(self, key: str, places: list[Place], signs: Sequence[float] = ()) -> None:
        self.found[key] = _Found(places, np.array(signs))
        self._want(places)

    def _want(self, places: Sequence[Place]) -> None:
        for place in places:
            self.requested.setdefault(place.stream, {})[place.column] = None


class Synchronisation(NamedTuple):
    """A motion log, with reports on its source streams."""

    log: MotionLog
    topics: tuple[TopicReport, ...]
    without_encoder: int  # rows whose `ok` is not set
    rows: Integers  # (N,) index of each row of the log in q_nominal's stream


class NoRowError(InputError):
    """No row has all required quantities."""


def columns_wanted(sources: Sources, mapping: RecordingMapping) -> Mapping[str, Collection[str]]:
    """Return the columns of each stream that a mapping needs, time included; q_nominal's stream first.

    Args:
        sources, mapping: Files of the recording, and columns of each quantity.
    """
    return _Columns(", ".join(path.name for path in sources.paths), mapping, sources.streams).requested


def synchronise(
    sources: Sources, mapping: RecordingMapping, *, model: RobotModel | None = None, is_piece: bool = False
) -> Synchronisation:
    """Read a recording by a mapping, with all quantities at the times of q_nominal.

    Quantities with other stamps are interpolated between their two neighbours in time, and `ok` is cleared where
    q_encoder has no neighbours within the largest gap. Rows without q_nominal, qd, tau or a signal are left out.

    Args:
        sources, mapping: Files of the recording, and columns of each quantity.
        model: Robot; the mapping's if None.
        is_piece: The files are a piece of a longer recording, in which q_encoder may be missing, and the sample
            decides on optional quantities.

    Raises:
        InputError: A column is missing, units contradict the joints', or no row is left.
    """
    where = ", ".join(path.name for path in sources.paths)
    if model is None and mapping.robot is not None:
        model = load_robot(mapping.robot)
    columns = _Columns(where, mapping, sources.streams)
    mapping, in_file = _with_texts(where, mapping, sources.streams, columns.found["q_nominal"].places)
    notes = _ordered_by_name(columns, mapping, sources.streams, model)
    places_of_key, joints = columns.found, {key: columns.found[key] for key in columns.joints}
    base = places_of_key["q_nominal"].places
    names, more_notes = _joint_names(mapping, model, base, sources.streams)
    notes += more_notes
    seen = {key: _candidate(own.places, sources.streams, names) for key, own in joints.items()}
    nominal = seen["q_nominal"]
    units, inferred, assumed, more_notes = joint_units_of(mapping, nominal, model, names)
    notes += more_notes
    streams = sources.read({stream: list(columns) for stream, columns in columns.requested.items()})
    for place in (
        places_of_key["ok"].places if "ok" in places_of_key else ()
    ):  # 1 for a number other than 0, NaN for no number
        values = streams[place.stream].columns[place.column].astype(np.float64)
        truths = np.where(np.isfinite(values), values != 0.0, np.nan)
        streams[place.stream] = streams[place.stream].with_column(place.column, truths)
    for stream in streams.values():
        notes += [f"{stream.name}: {note}" for note in stream.notes]
    scaled, jumped = dict[str, Floats](), set[str]()
    for key, own in joints.items():
        scaled[key] = own.sign * _scale(key, mapping, seen[key], nominal, units, inferred or units, notes)
    for key, own in places_of_key.items():  # before unwrapping and interpolation
        count = 0
        for j, place in enumerate(own.places if key in (*joints, "pose") else ()):
            stream = streams[place.stream]
            values = stream.numbers(place.column, 0.0 if key in ("tau", "pose") else scaled[key][j])
            if none := int((np.isnan(values) & np.isfinite(stream.columns[place.column])).sum()):
                streams[place.stream], count = stream.with_column(place.column, values), count + none
        notes += [f"{key}: {count} number(s) mean that nothing was measured"] * bool(count)
        if key in ("q_nominal", "q_encoder", "q_reported"):
            streams, turns = unwrap_columns(streams, own.places, scaled[key], units, names)
            notes += [f"{key} of {name}: jumps by a turn {k} time(s); unwrapped" for name, k in turns.items()]
            jumped |= set(turns)
    if columns.tip is not None and model is not None and set(names) == set(model.joint_names):
        from catenary.recording.import_formats.tracked_pose import tip_said

        told_by = streams[base[0].stream]
        order = [names.index(name) for name in model.joint_names]
        q = np.column_stack([told_by.columns[base[i].column] * scaled["q_nominal"][i] for i in order])
        notes += tip_said(model, q, told_by, streams[columns.tip[0]], columns.tip[1])
    places = {key: each.places for key, each in places_of_key.items()}
    used = {place.stream for several in places.values() for place in several} | set(mapping.reported)
    in_si = {key: partial(_in_si, key, getattr(mapping, key), scaled[key]) for key in joints}
    seeing = [key for key in joints if key in ("q_encoder", "q_reported")]
    common = {key: CommonMotion(in_si["q_nominal"], in_si[key], units) for key in seeing}
    pose = None if mapping.q_encoder is None else mapping.q_encoder.pose
    if pose is not None and model is not None:
        common["pose"] = _common_path(model, pose, in_si["q_nominal"], names, len(places["pose"]))
    of_log = {name: one for name, one in streams.items() if name in used}
    clock = OneClock(of_log, places, mapping, sources.today, common)
    del streams, of_log  # to save memory

    rows = {key: in_si[key](clock.rows(key)) for key in joints}
    further = {
        key: clock.rows(f"signal {key}") * signal.scale * places_of_key[f"signal {key}"].sign
        for key, signal in mapping.signals.items()
        if f"signal {key}" in places_of_key
    }
    for key in [k for k in ("qd", "tau") if k in rows and getattr(mapping, k).optional]:
        if not np.isfinite(seen[key].ranges if is_piece else rows[key]).any():
            del rows[key]
    required = {**rows, **{f"signal {key}": values for key, values in further.items()}}
    whole = _whole_rows(required, names, notes)
    if not whole.any():
        raise NoRowError("; ".join([f"{where}: no row has all of {', '.join(required)}", *notes]))
    if pose is not None and model is not None:
        rows["q_encoder"] = _tracked(clock, pose, model, scaled["q_nominal"], names, notes)
    rows["q_nominal"], measured, more_notes = in_one_turn(
        rows["q_nominal"], rows.get("q_encoder"), units, names, model, jumped
    )
    notes += more_notes
    rows |= {} if measured is None else {"q_encoder": measured}
    is_there = np.ones(len(whole), dtype=bool) if measured is None else np.isfinite(measured).all(axis=1)
    # 1 if both neighbours of an interpolated row are ok
    ok = np.asarray(is_there & (clock.rows("ok") == 1.0).all(axis=1) if "ok" in places_of_key else is_there)
    if measured is not None and not ok.any() and not is_piece:
        why = "ok is set on none that has q_encoder" if is_there.any() else "q_encoder is measured on none"
        raise InputError("; ".join([f"{where}: no usable row: {why}", *clock.notes]))
    lost = int((~ok[whole]).sum())
    unseen = "" if measured is None else _by_joint(~np.isfinite(measured[whole]), names)
    notes += [f"{lost} of {int(whole.sum())} rows have no q_encoder{unseen}"] * bool(lost)
    left = () if mapping.name else not_used(sources.streams, columns.requested)
    notes += [f"not used: {listed(left)}"] * bool(left)
    signals = {
        (key if values.shape[1] == 1 else f"{key}[{i}]"): (column[whole], mapping.signals[key].units)
        for key, values in further.items()
        for i, column in enumerate(values.T)
    }
    time, began = clock.time(whole)
    stated_robot = None if sources.about is None else sources.about.robot
    if model is not None and stated_robot not in (None, model.name):
        notes.append(f"the recording says that it is of {stated_robot}; read as of {model.name}")
    log = MotionLog(
        name=sources.name,
        joint_names=names,
        joint_units=units,
        **{key: values if whole.all() else values[whole] for key, values in rows.items()},
        ok=ok[whole],
        time=time,
        began=began,
        signals={name: values for name, (values, _) in signals.items()},
        signal_units={name: unit for name, (_, unit) in signals.items()},
        robot=stated_robot or mapping.default_robot or None if model is None else model.name,
        simulated=sources.about is not None and sources.about.simulated,
        sha256=sources.sha256,
        units_assumed=assumed,
        repeated=clock.repeated,
        settled=_settled(mapping, joints, in_file=in_file),
        arrivals=clock.arrivals,
        notes=(
            *([] if mapping.name else [f"imported from {where}: {_summary(mapping, joints)}"]),
            *dict.fromkeys([*sources.notes, *clock.notes, *notes]),
        ),
    )
    if model is not None:
        in_order = Joints(tuple(name for name in model.joint_names if name in names))
        log = log.in_order_of(in_order, of=f'robot "{model.name}" has')
    return Synchronisation(log, clock.reports, int((~log.ok).sum()), clock.rows_of_base[whole])


def _scale(
    key: str,
    mapping: RecordingMapping,
    one: Candidate,
    nominal: Candidate,
    units: Units,
    inferred: Units,
    notes: list[str],
) -> Floats:
    """Return factors of a quantity's columns to SI (n,), from the mapping, the columns or q_nominal."""
    quantity, n = getattr(mapping, key), len(units)
    stated, factor = factors(key, quantity, units, n)
    if key == "tau" and not quantity.scale and not mapping.name:
        named = one.stated_scale() or (1.0,) * n
        notes += [f"tau: taken times {', '.join(f'{s:g}' for s in named)} by the names of its columns"] * (
            set(named) != {1.0}
        )
        return factor * named
    if stated is not None or key == "tau" or mapping.name:
        return factor
    own = one.stated_units() or inferred
    if key == "q_encoder":
        its = (mapping.q_nominal.units * n)[:n] if mapping.q_nominal.units else own
        own, why, is_sure = encoder_units(one, nominal, its, None)
        own, why = (own, why) if is_sure and not mapping.q_nominal.scale else (units, "as the joints'")
        notes.append(f"q_encoder: its units were not stated; taken in {', '.join(own)}: {why}")
    return factors(key, quantity.model_copy(update={"units": own}), units, n)[1]


def _with_texts(
    where: str, mapping: RecordingMapping, streams: Sequence[Stream], places: Sequence[Place]
) -> tuple[RecordingMapping, bool]:
    """Return a mapping with joint names and units from a file's own texts, and whether these state units."""
    texts = next(stream.texts for stream in streams if stream.name == places[0].stream)
    n = len(places)

    def own(array: str | None) -> tuple[str, ...]:
        named = texts.get(array or "", ())
        if array is not None and named and len(named) != n:
            raise InputError(
                f"{where}: {array}: expected (n,) texts, {n} as there are columns of q_nominal, got {len(named)}"
            )
        return named

    for stated, what in ((mapping.joint_names, "joint names"), (mapping.joint_units, "units")):
        if stated and len(stated) != n:
            raise InputError(f"{where}: has {n} joints, but {len(stated)} {what} were given ({','.join(stated)})")
    names, units = own(mapping.names_in), own(mapping.units_in)
    if not names and not units:
        return mapping, False
    stated = mapping.joint_units
    if stated and mapping.joint_names and names:
        had = Joints(mapping.joint_names, stated)
        order = joint_indices(Joints(names), had, whose="the robot that was named", of=f"{where} is of")
        stated = tuple(stated[j] for j in order)
    if stated and units and stated != units:
        raise InputError(f"{where}: states the units {','.join(units)}, but {','.join(stated)} were given")
    update = {"joint_names": names or mapping.joint_names, "joint_units": stated or units}
    return mapping.model_copy(update=update), bool(units)


def _candidate(places: Sequence[Place], streams: Sequence[Stream], names: Sequence[str]) -> Candidate:
    """Return columns with their numbers, to infer units from."""
    by_name = {stream.name: stream for stream in streams}
    columns = {place.column: by_name[place.stream].columns[place.column] for place in places}
    own = tuple("" for _ in names) if tuple(names) == nameless(len(names)) else tuple(names)
    stream = replace(by_name[places[0].stream], columns=columns)
    return Candidate(stream, tuple(place.column for place in places), "position", "unknown", own)


def _joint_names(
    mapping: RecordingMapping, model: RobotModel | None, places: Sequence[Place], streams: Sequence[Stream]
) -> tuple[tuple[str, ...], list[str]]:
    """Return joint names: the mapping's, the robot's matched to the recording's, the recording's, or J1, J2, ..."""
    n = len(places)
    if mapping.joint_names:
        if model is not None:
            joint_indices(Joints(mapping.joint_names), model, whose=f'robot "{model.name}"', of="joint_names are")
        return mapping.joint_names, []
    own = recorded_joints(places, streams)
    if model is None:
        return own or nameless(n), []
    if n > model.n:
        raise InputError(f'robot "{model.name}" has {model.n} joints, q_nominal {n} columns; give joint_names')
    own_names = own or tuple(place.column for place in places)
    meant = joints_meant(own_names, model)
    is_known, listed = all(meant) and len(set(meant)) == n, len(mapping.q_nominal.columns) == n
    names = meant if is_known else model.joint_names[:n]
    # a number in a column's name is rarely a joint's number unless all columns have one
    astray = any(each not in ("", j) and not each[-1].isdigit() for j, each in zip(names, meant, strict=True))
    if astray or (own and not is_known and not listed):
        raise InputError(
            f'q_nominal: {", ".join(map(cut, own_names))} are not clearly joints of robot "{model.name}", which has '
            f"{joints_text(model)}; list the columns in the order of its joints, or give joint_names"
        )
    matched = f"{'by their names' if is_known else 'in order'} ({', '.join(map(cut, own_names))} in the recording)"
    note = f'columns of q_nominal are {", ".join(names)} of robot "{model.name}", {matched}'
    return names, [note] * (names != own_names)


def recorded_joints(places: Sequence[Place], streams: Sequence[Stream]) -> tuple[str, ...]:
    """Return the recording's joint names of columns; empty if a name is missing or occurs twice."""
    own = []
    for place in places:
        stream = next(s for s in streams if s.name == place.stream)
        array, _, index = place.column.partition("[")
        own.append(index[:-1] if index[:-1] in stream.joints.get(array, ()) else "")
    return tuple(own) if all(own) and len(set(own)) == len(own) else ()


def _ordered_by_name(
    columns: _Columns, mapping: RecordingMapping, streams: Sequence[Stream], model: RobotModel | None
) -> list[str]:
    """Sort columns of arrays and patterns into the order of q_nominal's joints by name; return notes."""

    def names_of(key: str) -> tuple[str, ...]:
        places = columns.found[key].places
        own = names = recorded_joints(places, streams) or tuple(place.star for place in places)
        if model is not None:
            names = joints_meant([o or p.column for o, p in zip(own, places, strict=True)], model)
        names = names if all(names) else own
        return names if all(names) and len(set(names)) == len(names) else ()

    in_recording, notes = names_of("q_nominal"), []
    for key in columns.joints:
        own, own_columns = names_of(key), columns.found[key]
        orders = [in_recording, mapping.joint_names] if key != "q_nominal" else [mapping.joint_names]
        order = next((one for one in orders if set(own) & set(one)), ())
        if own == order or not own or not any(orders):
            continue
        if not order:
            if key != "q_nominal":
                notes.append(f"{key}: taken in order, as q_nominal has none of {', '.join(own)}")
            continue
        if len(getattr(mapping, key).columns) == len(own):  # listed one by one
            notes.append(f"{key}: joints are in another order than q_nominal's, as the mapping names them")
            continue
        index = joint_indices(Joints(order), Joints(own), whose=key, of="q_nominal has")
        columns.found[key] = _Found([own_columns.places[i] for i in index], own_columns.sign[index])
        notes.append(f"{key}: has its joints in another order; they were taken by name")
    return notes


def _by_joint(missing: Flags, names: Sequence[str]) -> str:
    """Return the number of missing rows by joint, as " (J2 4)"; empty if the same for all joints."""
    counts = missing.sum(axis=0).tolist()
    if len(counts) != len(names) or len(set(counts)) == 1:
        return ""
    return f" ({', '.join(f'{name} {count}' for name, count in zip(names, counts, strict=True) if count)})"


def _whole_rows(rows: dict[str, Floats], names: Sequence[str], notes: list[str]) -> Flags:
    """Return flags of rows with all required quantities; add notes on the other rows."""
    whole = np.ones(len(rows["q_nominal"]), dtype=bool)
    for key, values in rows.items():
        if key == "q_encoder":
            continue
        there = np.asarray(np.isfinite(values).all(axis=1))
        if not there.all():
            lacking = _by_joint(~np.isfinite(values[whole]), names)
            notes.append(f"{int((whole & ~there).sum())} of {len(there)} rows without {key}{lacking} were left out")
        whole &= there
    return whole


def _of_robot(q: Floats, model: RobotModel, chosen: Sequence[int]) -> Floats:
    """Return the positions of all joints of a robot (M, n) by those of the chosen ones; others stay near zero."""
    every = np.tile(np.clip(0.0, model.lower, model.upper), (len(q), 1))
    every[:, chosen] = q
    return every


def _common_path(
    model: RobotModel, tracked: TrackedPose, q_in_si: InSi, names: Sequence[str], columns: int
) -> CommonMotion:
    """Return the motion that commands and a tracked marker share before transforms are known: way and turns."""
    from catenary.dynamics.kinematics import Configuration
    from catenary.recording.import_formats.tracked_pose import path_of, positions_and_rotations

    chosen = [model.joint_names.index(name) for name in names]

    def of_commands(values: Floats) -> Floats:
        frame = Configuration(model, _of_robot(q_in_si(values), model, chosen)).pose(tracked.frame)
        return path_of(frame.position, frame.rotation if columns > 3 else None)

    return CommonMotion(
        of_commands,
        lambda values: path_of(*positions_and_rotations(tracked, values)),
        ("m", "rad")[: 1 + (columns > 3)],
    )


def _tracked(
    clock: OneClock, tracked: TrackedPose, model: RobotModel, scale: Floats, names: Sequence[str], notes: list[str]
) -> Floats:
    """Return the joint positions of tracked poses, at the stamps of q_nominal."""
    from catenary.recording.import_formats.registration import TrackedPoses
    from catenary.recording.import_formats.tracked_pose import (
        joints_from_poses,
        lateness,
        positions_and_rotations,
        registered,
    )

    poses, q = clock.samples("pose"), clock.samples("q_nominal")
    if poses is None or q is None:
        raise InputError("a pose, and q_nominal beside it, must each be of one topic or table")
    nominal = Series(q.stamp, q.values * scale, q.report)
    chosen = [model.joint_names.index(name) for name in names]
    measured, stamp = positions_and_rotations(tracked, poses.values), poses.stamp

    def poses_at(late: float) -> TrackedPoses:
        near, before, after = (
            interpolate(nominal, stamp + round(late * SECOND) + by, clock.gap("q_nominal"))
            for by in (0, -_BESIDE_NS, _BESIDE_NS)
        )
        start = _of_robot(near, model, chosen)
        speed = np.zeros_like(start)
        if clock.is_timed:  # rows without time have no speed
            speed[:, chosen] = np.nan_to_num((after - before) * (SECOND / (2 * _BESIDE_NS)))
        return TrackedPoses(*measured, start, speed)

    base, marker, tracker_notes = registered(model, tracked, poses.values, poses_at, chosen)
    late = lateness(model, tracked, poses_at, base, marker, chosen) if clock.is_found("pose") else 0.0
    notes += [*tracker_notes, *[f"poses were moved by {late:+.4f} s more, by the robot's kinematics"] * bool(late)]
    poses, seen = replace(poses, stamp=poses.stamp + round(late * SECOND)), poses_at(late)
    positions, tracker_notes = joints_from_poses(model, tracked, seen, base, marker, chosen)
    notes += tracker_notes
    return interpolate(Series(poses.stamp, positions[:, chosen], poses.report), clock.stamp, clock.gap("pose"))


def _in_si(key: str, quantity: Quantity, scale: Floats, values: Floats) -> Floats:
    """Return columns (N, n) in SI, converted from motors to joints if a coupling is stated."""
    rows = values * scale
    if quantity.coupling is None:
        return rows
    matrix = quantity.coupling_matrix
    if matrix is None:
        return np.column_stack(joint_forces(np.array(quantity.coupling), tuple(rows.T)))
    if len(matrix) != rows.shape[1]:
        n = rows.shape[1]
        raise InputError(
            f"{key}: coupling: expected ({n}, {n}), a row for each joint, got ({len(matrix)}, {len(matrix)})"
        )
    return np.asarray(rows @ (np.linalg.inv(matrix) if key == "tau" else matrix.T))


def _summary(mapping: RecordingMapping, joints: dict[str, _Found]) -> str:
    """Return a mapping as one line, with patterns replaced by the matched columns."""
    parts = []
    for key in JOINT_QUANTITIES:
        quantity: Quantity | None = getattr(mapping, key)
        if quantity is not None:
            source = quantity.columns if quantity.pose is None else (f"pose {quantity.pose.columns[0]}",)
            if any("*" in column for column in source) and key in joints:
                source = tuple(place.column for place in joints[key].places)
            units = f" [{', '.join(quantity.units)}]" if quantity.units else ""
            parts.append(f"{key} = {cut(', '.join(source))}{units}")
    return "; ".join(parts)


def _settled(mapping: RecordingMapping, joints: dict[str, _Found], *, in_file: bool) -> dict[str, tuple[str, ...]]:
    """Return the corrections stated in the mapping, which have priority over a model's."""
    steps = [] if mapping.assumed_units and not in_file else ["units"]
    settled = [step for step in (*steps, "time_unit") if step not in mapping.unsettled]
    for key, columns in joints.items():
        quantity = getattr(mapping, key)
        settled += [f"units:{key}"] * bool(quantity.units) + [f"scale:{key}"] * bool(quantity.scale)
        settled += [f"sign:{key}"] * bool(quantity.sign or (columns.sign < 0.0).any())
        settled += [f"couple:{key}"] * (quantity.coupling is not None)
    return dict.fromkeys(settled, ())


def unwrap_columns(
    streams: Mapping[str, Stream], places: Sequence[Place], scale: Floats, units: Sequence[str], names: Sequence[str]
) -> tuple[dict[str, Stream], dict[str, int]]:
    """Unwrap the angles at `places`, in rad after `scale` (n,); return the streams and the jumps of each joint."""
    changed, jumped = dict(streams), dict[str, int]()
    for place, factor, unit, name in zip(places, scale, units, names, strict=True):
        if unit != "rad":
            continue
        stream = changed[place.stream]
        values = np.asarray(stream.columns[place.column], dtype=np.float64)
        turned, jumps = unwrapped(values, TURN / abs(float(factor)))
        if jumps:
            changed[place.stream] = stream.with_column(place.column, turned)
            jumped[name] = jumps
    return changed, jumped
