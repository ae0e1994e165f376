"""A recording of any make into a MotionLog, by a mapping."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.documents import cut
from catenary.errors import InputError
from catenary.files import sha256_of
from catenary.plant import Joints, MotionLog
from catenary.plant import places_of as places_of_joints
from catenary.recording.import_formats.columns import Place, Stream, places_of
from catenary.recording.import_formats.joints import (
    factors,
    joint_names_of,
    joint_units_of,
    joints_meant,
    recorded_joints,
)
from catenary.recording.import_formats.mapping import Quantity, RecordingMapping, TrackedPose
from catenary.recording.import_formats.one_clock import OneClock
from catenary.recording.import_formats.sources import Sources
from catenary.recording.import_formats.table_rows import TableRows
from catenary.recording.import_formats.tracked_pose import joints_from_poses, pose_places
from catenary.recording.import_formats.whole_turns import in_one_turn, unwrap_columns
from catenary.recording.series import Series, interpolate
from catenary.recording.topics import SECOND
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel

_SIGNED = "-"


@dataclass(frozen=True)
class _Found:
    """Where the columns of a quantity are, and the sign of each."""

    places: list[Place]
    sign: Floats


@dataclass
class _Wanted:
    """Columns that are to be read, by stream."""

    streams: Sequence[Stream]
    columns: dict[str, dict[str, None]] = field(default_factory=dict)

    def of(self, references: Sequence[str], what: str) -> _Found:
        """Find references, and keep them to be read."""
        places, signs = list[Place](), list[float]()
        for reference in references:
            try:
                found, sign = places_of(reference, self.streams), 1.0
            except InputError as error:
                if not reference.startswith(_SIGNED):
                    raise InputError(f"{what}: {error}") from error
                found, sign = places_of(reference[1:], self.streams), -1.0
            places += found
            signs += [sign] * len(found)
        self.keep(places)
        return _Found(places, np.array(signs))

    def keep(self, places: Sequence[Place]) -> None:
        for place in places:
            self.columns.setdefault(place.stream, {})[place.column] = None


def import_sources(
    sources: Sources, mapping: RecordingMapping, *, model: RobotModel | None = None
) -> MotionLog:
    """Read a recording by a mapping, on one clock.

    Rows are the samples of q_nominal; other streams are interpolated between their two neighbours in time, and `ok` is
    cleared where q_encoder has none within the gap. Rows that lack q_nominal, qd, tau or a signal are left out. A table
    alone keeps its rows.

    Args:
        sources: The files.
        mapping: Which column is what.
        model: The robot; the mapping's when None.
    """
    where = ", ".join(path.name for path in sources.paths)
    wanted = _Wanted(sources.streams)
    joints = {
        key: wanted.of(quantity.columns, key)
        for key in ("q_nominal", "q_encoder", "qd", "tau")
        if (quantity := getattr(mapping, key)) is not None and quantity.columns
    }
    valid = wanted.of(mapping.ok, "ok")
    signals = {key: wanted.of(signal.columns, f"signal {key}") for key, signal in mapping.signals.items()}
    tracked = mapping.q_encoder.pose if mapping.q_encoder is not None else None
    pose = pose_places(tracked, sources.streams) if tracked is not None else []
    wanted.keep(pose)

    n = len(joints["q_nominal"].places)
    for key, columns in joints.items():
        if len(columns.places) != n:
            raise InputError(
                f"{where}: {key} has {len(columns.places)} columns, q_nominal {n}; expected as many"
            )
    if model is None and mapping.robot is not None:
        model = load_robot(mapping.robot)
    notes = _ordered_by_name(joints, mapping, sources.streams, model)
    base = joints["q_nominal"].places[0]
    names, said = joint_names_of(mapping, model, joints["q_nominal"].places, sources.streams)
    notes += said
    units, assumed, said = joint_units_of(mapping, model, base, sources.streams, names)
    notes += said
    streams = sources.read({stream: list(columns) for stream, columns in wanted.columns.items()})
    for stream in streams.values():
        notes += [f"{stream.name}: {note}" for note in stream.notes]
    scaled, jumped = {}, set[str]()
    for key, columns in joints.items():
        stated, factor = factors(key, getattr(mapping, key), units, n)
        if key == "q_encoder" and stated is None:
            notes.append(f"q_encoder: its units were not stated; taken in {', '.join(units)}")
        scaled[key] = factor * columns.sign
        if key in ("q_nominal", "q_encoder"):
            streams, turns = unwrap_columns(streams, columns.places, scaled[key], units, names)
            notes += [f"{key} of {name}: jumps by a turn {k} time(s); unwrapped" for name, k in turns.items()]
            jumped |= set(turns)
    columns_of = {stream: tuple(columns) for stream, columns in wanted.columns.items()}
    alone = len(streams) == 1 and streams[base.stream].arrival is None
    clock: TableRows | OneClock
    if alone:
        clock = TableRows(streams[base.stream], mapping)
    else:
        clock = OneClock(streams, columns_of, base.stream, mapping)

    rows = {key: clock.rows(columns.places) * scaled[key] for key, columns in joints.items()}
    further = {
        key: clock.rows(columns.places) * mapping.signals[key].scale * columns.sign
        for key, columns in signals.items()
    }
    whole = _whole_rows({**rows, **further}, notes)
    if not whole.any():
        raise InputError(f"{where}: no row has all of {', '.join([*rows, *further])}; {'; '.join(notes)}")
    ok = np.ones(len(whole), dtype=bool)
    if tracked is not None and model is not None:
        encoder = _tracked(
            clock, tracked, model, pose, joints["q_nominal"], scaled["q_nominal"], names, notes
        )
        rows["q_encoder"] = interpolate(encoder, clock.stamp, _gap(clock, pose))[0]
    rows["q_nominal"], measured, said = in_one_turn(
        rows["q_nominal"], rows.get("q_encoder"), units, names, model, jumped
    )
    notes += said
    if measured is not None:
        rows["q_encoder"] = measured
        ok &= np.isfinite(rows["q_encoder"]).all(axis=1)
    if valid.places:
        ok &= (clock.rows(valid.places) > 0.5).all(axis=1)
    if "q_encoder" in rows and not ok.any():
        raise InputError(f"{where}: q_encoder is measured on no row of q_nominal; {'; '.join(clock.notes)}")
    notes += [f"{int((~ok[whole]).sum())} of {int(whole.sum())} rows have no q_encoder"] * bool(
        (~ok[whole]).any()
    )
    signal_columns, signal_units = _signals(further, mapping, whole)
    time = clock.time
    log = MotionLog(
        name=sources.paths[0].stem,
        joint_names=names,
        joint_units=units,
        q_nominal=rows["q_nominal"][whole],
        q_encoder=rows["q_encoder"][whole] if "q_encoder" in rows else None,
        ok=ok[whole],
        time=None if time is None else time[whole] - time[whole][0],
        began=0.0 if time is None else int(clock.stamp[whole][0]) / SECOND,
        qd=rows["qd"][whole] if "qd" in rows else None,
        tau=rows["tau"][whole] if "tau" in rows else None,
        signals=signal_columns,
        signal_units=signal_units,
        robot=None if model is None else model.name,
        sha256=_sha256(sources.paths),
        units_assumed=assumed,
        settled=_settled(mapping, joints),
        notes=(
            f"imported from {where}: {_told(mapping, joints)}",
            *dict.fromkeys([*sources.notes, *clock.notes, *notes]),
        ),
    )
    if model is None:
        return log
    its = Joints(tuple(name for name in model.joint_names if name in names))
    return log.in_order_of(its, of=f'robot "{model.name}" has')


def _ordered_by_name(
    joints: dict[str, _Found],
    mapping: RecordingMapping,
    streams: Sequence[Stream],
    model: RobotModel | None,
) -> list[str]:
    """Put whole arrays, parts of them and patterns into the order of q_nominal's joints by name; say so."""

    def names_of(key: str) -> tuple[str, ...]:
        places = joints[key].places
        own = found = recorded_joints(places, streams) or tuple(place.star for place in places)
        if model is not None:
            found = joints_meant([o or p.column for o, p in zip(own, places, strict=True)], model)
        found = found if all(found) else own
        return found if all(found) and len(set(found)) == len(found) else ()

    order, notes = names_of("q_nominal"), []
    for key, columns in joints.items():
        own = names_of(key)
        if own == order or not own or not order:
            continue
        if len(getattr(mapping, key).columns) == len(own):  # listed one by one
            notes.append(f"{key}: joints are in another order than q_nominal's, as the mapping names them")
            continue
        if not set(own) & set(order):
            notes.append(f"{key}: taken in order, as q_nominal has none of {', '.join(own)}")
            continue
        index = places_of_joints(Joints(order), Joints(own), whose=key, of="q_nominal has")
        joints[key] = _Found([columns.places[i] for i in index], columns.sign[index])
        notes.append(f"{key}: has its joints in another order; they were taken by name")
    return notes


def _whole_rows(rows: dict[str, Floats], notes: list[str]) -> NDArray[np.bool_]:
    """Return the rows that have all that a log must have on each; say what others lack."""
    whole = np.ones(len(rows["q_nominal"]), dtype=bool)
    for key, values in rows.items():
        if key == "q_encoder":
            continue
        there = np.asarray(np.isfinite(values).all(axis=1))
        if not there.all():
            notes.append(f"{int((whole & ~there).sum())} of {len(there)} rows without {key} were left out")
        whole &= there
    return whole


def _tracked(
    clock: TableRows | OneClock,
    tracked: TrackedPose,
    model: RobotModel,
    pose: Sequence[Place],
    nominal: _Found,
    scale: Floats,
    names: Sequence[str],
    notes: list[str],
) -> Series:
    """Return the joints that poses stand for, at the poses' own stamps."""
    poses, q = clock.samples(pose), clock.samples(nominal.places)
    if poses is None or q is None:
        raise InputError("a pose, and q_nominal beside it, must each be of one topic or table")
    near = interpolate(Series(q.stamp, q.values * scale, q.report), poses.stamp, _gap(clock, nominal.places))[
        0
    ]
    chosen = [model.joint_names.index(name) for name in names]
    start = np.tile(np.clip(0.0, model.lower, model.upper), (len(near), 1))
    start[:, chosen] = near
    found = joints_from_poses(model, tracked, poses.values, start, chosen)
    lost = int(np.isnan(found).any(axis=1).sum() - np.isnan(start).any(axis=1).sum())
    if lost > 0:
        notes.append(
            f"{lost} of {len(found)} poses were left out: not finite, singular, or beyond {tracked.within_mm:g} mm"
            + (f" and {tracked.within_deg:g} deg" if tracked.match == "pose" else "")
            + " from all that the robot reaches"
        )
    return Series(poses.stamp, found[:, chosen], poses.report)


def _gap(clock: TableRows | OneClock, places: Sequence[Place]) -> float:
    return clock.gap(places[0].stream)


def _signals(
    further: dict[str, Floats], mapping: RecordingMapping, whole: NDArray[np.bool_]
) -> tuple[dict[str, Floats], dict[str, str]]:
    columns, units = dict[str, Floats](), dict[str, str]()
    for key, values in further.items():
        names = [key] if values.shape[1] == 1 else [f"{key}[{i}]" for i in range(values.shape[1])]
        columns |= {name: values[whole, i] for i, name in enumerate(names)}
        units |= dict.fromkeys(names, mapping.signals[key].units)
    return columns, units


def _told(mapping: RecordingMapping, joints: dict[str, _Found]) -> str:
    """Return a mapping in a line, its patterns as the columns that they stand for."""
    parts = []
    for key in ("q_nominal", "q_encoder", "qd", "tau"):
        quantity: Quantity | None = getattr(mapping, key)
        if quantity is not None:
            source = quantity.columns if quantity.pose is None else (f"pose {quantity.pose.columns[0]}",)
            if any("*" in column for column in source) and key in joints:
                source = tuple(place.column for place in joints[key].places)
            units = f" [{', '.join(quantity.units)}]" if quantity.units else ""
            parts.append(f"{key} = {cut(', '.join(source))}{units}")
    return "; ".join(parts)


def _settled(mapping: RecordingMapping, joints: dict[str, _Found]) -> dict[str, tuple[str, ...]]:
    """Return what a mapping says itself, and no mend of a model's training data says anew."""
    settled = ["units", "time_unit"]
    for key, columns in joints.items():
        quantity = getattr(mapping, key)
        settled += [f"units:{key}"] * bool(quantity.units) + [f"scale:{key}"] * bool(quantity.scale)
        settled += [f"sign:{key}"] * bool(quantity.sign or (columns.sign < 0.0).any())
    return dict.fromkeys(settled, ())


def _sha256(paths: Sequence[Path]) -> str | None:
    return sha256_of(paths[0]) if len(paths) == 1 and paths[0].is_file() else None
