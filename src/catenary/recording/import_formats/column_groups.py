"""Groups of columns that may be one quantity of all joints, or a marker's pose, inferred from names, types and ranges.

Without names they are inferred from their motion: velocities are derivatives of positions.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Flags, Floats, without_missing
from catenary.errors import InputError
from catenary.plant import Jointed
from catenary.recording.import_formats.columns import WORDS, Stream, arrays_of, ends, natural
from catenary.recording.import_formats.table_time import is_nameless, time_columns, time_of, times_among
from catenary.topics import SECOND

Kind = Literal["position", "velocity", "acceleration", "effort", "current"]
Role = Literal["measured outside", "commanded", "actual", "own", "estimated", "measured", "reported", "unknown"]


_KINDS: dict[Kind, frozenset[str]] = {kind: frozenset(words.split()) for kind, words in WORDS["kinds"].items()}
_ROLES: dict[Role, frozenset[str]] = {role: frozenset(words.split()) for role, words in WORDS["roles"].items()}
_SETS: dict[str, frozenset[str]] = {name: frozenset(words.split()) for name, words in WORDS["words"].items()}
_CRTK = re.compile(r"measured_(?=[jc][psvf]\b)")  # its verbs of what a robot reports: measured_js
_OF_QUANTITIES = frozenset[str]().union(*_KINDS.values(), *_ROLES.values(), _SETS["reported"])
_OF_NO_JOINT = _OF_QUANTITIES | _SETS["units"]
_UNIT = re.compile(  # behind a name: q1 [deg], dq_rad_s, "tau3 (N m)", elbow_deg[2]
    r"(?<=[\[( _])\s*((?P<unit>°|deg|degrees?|rad|radians?|mm|cm|m|meters)"
    r"(?P<speed>(?:/|_per_|_|\*)s(?:ec(?:ond)?)?(?:\^-1|(?P<again>\^?-?[23]|[²³])|(?!\d)))?"
    r"|(?P<effort>(?P<part>[mck]?)N[ *.·]?(?P<lever>[mc]?)m|(?-i:(?P<alone>[mk]?)N)))\s*(?=[\])]?(?:\[?\d+\]?)?\Z)",
    re.IGNORECASE,
)
_UNIT_WORDS = {"degree": "deg", "degrees": "deg", "°": "deg", "radian": "rad", "radians": "rad", "meters": "m"}
_PARTS = {"": 1.0, "m": 1e-3, "c": 1e-2, "k": 1e3}  # of a newton, of a metre
_MAX_JOINTS = 64
_FOLLOWING_CORRELATION = 0.8  # correlation of a measured joint with its command: a hysteretic wrist's is 0.82
_WHOLE_SHARE = 0.95  # share of rows that a quantity is taken from, at least: the others are lost with it
_MAX_ROWS = 100_000  # that are looked at
_MIN_ROWS = 30
_WINDOW_ROWS = (3, 10, 30, 100, 300)  # rows over which positions change, and velocities add up to that
_DERIVATIVE_CORRELATION = 0.95  # over one of these windows; noise and delay cost the short ones theirs
_SAME_SIZE_FACTOR = 1.25  # factor within which they are the same in size


class MovingColumns(NamedTuple):
    """Columns of the joints, in the order of the table."""

    q: tuple[str, ...]
    qd: tuple[str, ...]
    again: tuple[str, ...] = ()  # positions that have the same velocities: a command, or a measurement
    tau: tuple[str, ...] = ()  # what is left, where it is as many
    left: tuple[str, ...] = ()  # what is left, where it is not

    def said(self) -> str:
        """Return the reason of the inference, as text."""
        text = f"{ends(self.qd)} are the derivatives of {ends(self.q)}, and were taken for qd"
        text += f"; {ends(self.again)} have the same" if self.again else ""
        text += f"; {ends(self.tau)} are what is left, and were taken for tau" if self.tau else ""
        return text + (f"; {ends(self.left)} are left, and were not taken" if self.left else "")


@dataclass(frozen=True)
class Candidate:
    """Columns of one stream that may be one quantity."""

    stream: Stream
    columns: tuple[str, ...]
    kind: Kind
    role: Role
    joints: tuple[str, ...]  # names, or "" where the recording has none
    is_of_several: bool = False  # tables, so that names say of which

    @property
    def name(self) -> str:
        """What the columns have in common, for a reader."""
        first = self.columns[0]
        base = first[: first.rfind("[")] if first.endswith("]") and not _UNIT.search(first) else first
        where = f"{self.stream.name}." if self.stream.type != "table" else f"{self.stream.name}:" * self.is_of_several
        if len(arrays_of(self.stream).get(base, ())) > len(self.columns):
            base = first
        more = f" ... {self.columns[-1]}" if base == first and len(self.columns) > 1 else ""
        return f"{where}{base}{more}"

    @property
    def references(self) -> list[str]:
        """The columns as a mapping names them."""
        where = f"{self.stream.name}." if self.stream.type != "table" else f"{self.stream.name}:" * self.is_of_several
        return [f"{where}{column}" for column in self.columns]

    @property
    def is_potentiometer(self) -> bool:
        """Whether its name says that potentiometers measured it."""
        return bool({*_words(self.stream.name), *_words(self.columns[0])} & _SETS["potentiometers"])

    @property
    def says_position(self) -> bool:
        """Whether names say that these are positions of joints, and not whose sensor measured them."""
        words = _SETS["says_position"] | _SETS["joints"]
        is_position = self.kind == "position" and self.role != "measured outside"
        return is_position and (all(self.joints) or not words.isdisjoint(_words(self.columns[0])))

    @property
    def ranges(self) -> list[tuple[float, float]]:
        """Least and largest finite number of each column; NaN for none."""
        finite = (values[np.isfinite(values)] for values in map(self.stream.numbers, self.columns))
        return [(float(x.min()), float(x.max())) if len(x) else (np.nan, np.nan) for x in finite]

    @property
    def moves(self) -> bool:
        """Whether any column is more than one number."""
        return any(high > low for low, high in self.ranges)

    @property
    def is_whole(self) -> bool:
        """Whether nearly every row has a number in each column."""
        return all(np.isfinite(self.stream.numbers(column)).mean() > _WHOLE_SHARE for column in self.columns)

    @property
    def rate(self) -> float:
        """Rows a second [Hz]; NaN if there is no time."""
        arrival = self.stream.arrival
        if arrival is None or len(arrival) < 2 or arrival[-1] <= arrival[0]:
            return float("nan")
        return (self.stream.rows - 1) * SECOND / float(arrival[-1] - arrival[0])

    def part(self, columns: Sequence[str]) -> "Candidate":
        """Return the group with some of its columns."""
        joints = dict(zip(self.columns, self.joints, strict=True))
        return replace(self, columns=tuple(columns), joints=tuple(joints[c] for c in columns))

    def of_joints(self, joints: Sequence[str]) -> "Candidate":
        """Return the group with the columns of these joints, in this order."""
        return self.part([self.columns[self.joints.index(joint)] for joint in joints])

    def is_followed_by(self, other: "Candidate") -> bool:
        """Whether each column goes up and down with the other's of the same place, in rows of one table."""
        if self.stream.name != other.stream.name or len(self.columns) != len(other.columns):
            return False
        for mine, its in zip(self.columns, other.columns, strict=True):
            pair = np.array([self.stream.numbers(mine), other.stream.numbers(its)])
            pair = pair[:, np.isfinite(pair).all(axis=0)]
            with np.errstate(invalid="ignore", divide="ignore"):
                if pair.shape[1] < 3 or not np.asarray(np.corrcoef(pair))[0, 1] > _FOLLOWING_CORRELATION:
                    return False
        return True

    @property
    def _titles(self) -> list[str]:
        return list(map(self.stream.titled, self.columns))

    def stated_units(self) -> tuple[str, ...] | None:
        """Return the units that the columns' names end in, of velocities per second; None where one has none."""
        units = [one["unit"].lower() for one in map(_UNIT.search, self._titles) if one and one["unit"]]
        return tuple(_UNIT_WORDS.get(unit, unit) for unit in units) if len(units) == len(self.columns) else None

    def stated_scale(self) -> tuple[float, ...] | None:
        """Return the Nm or N of one unit that the columns' names end in, as of mNm; None where one has none."""
        matches = [one for one in map(_UNIT.search, self._titles) if one and one["effort"]]
        parts = [((one["part"] or one["alone"] or "").lower(), (one["lever"] or "").lower()) for one in matches]
        return tuple(_PARTS[a] * _PARTS[b] for a, b in parts) if len(parts) == len(self.columns) else None


def candidates_of(streams: Sequence[Stream], today: float, model: Jointed | None = None) -> list[Candidate]:
    """Return the groups of columns that may be a quantity of the joints, first those named as joints of the robot.

    `today` [s since 1970] bounds their time.
    """
    each = (_of_table(one, today, model) if one.type == "table" else _of_topic(one) for one in streams)
    candidates = [arm for several in each for one in several for arm in _by_arm(one)]
    if sum(stream.type == "table" for stream in streams) < 2:
        return candidates
    return [replace(one, kind=_kind_in_file(one), role=_role_in_file(one), is_of_several=True) for one in candidates]


def _by_arm(one: Candidate) -> list[Candidate]:
    """Part joints whose names begin as those of several arms do that have the same ones: PSM1_yaw, PSM2_yaw."""
    parted = [re.split(r"[_/.]", joint, maxsplit=1) for joint in one.joints]
    arms: dict[str, list[str]] = {}
    for column, (arm, *_) in zip(one.columns, parted, strict=True):
        arms.setdefault(arm, []).append(column)
    own = {arm: [part[1:] for part in parted if part[0] == arm] for arm in arms}
    alike = all(len(joints) > 1 and sorted(joints) == sorted(next(iter(own.values()))) for joints in own.values())
    return [one.part(columns) for columns in arms.values()] if len(arms) > 1 and alike else [one]


def _kind_in_file(one: Candidate) -> Kind:
    """Return the kind of columns of several tables: a file's name says it where theirs does not."""
    is_said = _UNIT.search(one.stream.titled(one.columns[0])) or {*_words(one.columns[0])} & _SETS["positions"]
    return one.kind if is_said or one.kind != "position" or one.stream.type != "table" else _kind(one.stream.name)


def _role_in_file(one: Candidate) -> Role:
    """Return whose a table's columns are where several tables are read: a file's name says whose sensor it is of."""
    of_file = _role(_words(one.stream.name)) if one.stream.type == "table" else "unknown"
    is_told = of_file == "measured outside" and one.role in ("actual", "estimated", "measured", "reported")
    return of_file if is_told or one.role == "unknown" else one.role


def ok_columns(stream: Stream) -> list[str]:
    """Return columns of a table that say by name and content where a measurement can be trusted; open cells say no."""
    named = {name: values for name, values in stream.columns.items() if set(_words(name)) & _SETS["ok"]}
    finite = {name: values[np.isfinite(values)] for name, values in named.items()}
    return [name for name, values in finite.items() if len(values) and np.isin(values, (0, 1)).all()]


def _of_topic(stream: Stream) -> list[Candidate]:
    candidates = []
    for base, columns in arrays_of(stream).items():
        columns = [column for column in columns if column in stream.columns]
        words = _words(base)
        inside = "." in base.rpartition("[")[2] and stream.type != "table" and base not in stream.joints
        if not 2 <= len(columns) <= _MAX_JOINTS or set(words) & _SETS["no_joints"] or inside:
            continue
        joints = tuple(column[len(base) + 1 : -1] if base in stream.joints else "" for column in columns)
        own = words if stream.type == "table" else [*_words(stream.name), *words]
        kind = _kind(stream.titled(columns[0])) if columns[0] in stream.units else _kind(base)
        candidates.append(Candidate(stream, tuple(columns), kind, _role(own), joints))
    return candidates


def _of_robot(stream: Stream, joints: Sequence[str]) -> list[Candidate]:
    """Group columns named as at least half of a robot's joints, each group by what else its names say."""
    groups: dict[tuple[Kind, str], dict[str, str]] = {}
    # where numbers alone tell joints apart, q_0 may be q1
    numbered = len(joints) > 1 and len({re.sub(r"\d+", "", joint) for joint in joints}) == 1
    for name in () if numbered else stream.columns:
        apart = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name)
        for joint in sorted(joints, key=len, reverse=True):
            pattern = r"[^a-z0-9]*".join(_words_and_numbers(joint)) or "$."
            without, is_named = re.subn(rf"(?<![a-z0-9]){pattern}(?![a-z0-9])", " ", apart, count=1, flags=re.I)
            if is_named and not set(_words(without)) & _SETS["no_joints"]:
                key = _kind(without), " ".join(_words_and_numbers(_UNIT.sub("", without)))
                groups.setdefault(key, {}).setdefault(joint, name)
            if is_named:
                break
    candidates = []
    for (kind, words), columns in groups.items():
        own = tuple(joint for joint in joints if joint in columns)
        role = _role(words.split()) if words or kind != "position" else "reported"
        candidates += [Candidate(stream, tuple(map(columns.__getitem__, own)), kind, role, own)] * (
            2 * len(own) >= len(joints)
        )
    return candidates


def _of_table(stream: Stream, today: float, model: Jointed | None) -> list[Candidate]:
    """Group a table's columns by what their names have in common: words of a quantity, else letters, else a unit."""
    of_robot = [] if model is None else _of_robot(stream, model.joint_names)
    own_columns = {column for one in of_robot for column in one.columns}
    poses = [column for pose in poses_of([stream]) if not own_columns & {*pose.taken} for column in pose.taken]
    moved = None if poses or of_robot else moving_columns(stream, today)
    if moved is not None:
        kinds: tuple[tuple[Kind, tuple[str, ...]], ...] = (
            ("position", moved.q), ("position", moved.again), ("velocity", moved.qd), ("effort", moved.tau),
        )  # fmt: skip
        return [Candidate(stream, names, kind, "unknown", ("",) * len(names)) for kind, names in kinds if names]
    # arrays beside a list of their joints
    candidates = of_robot + [one for one in _of_topic(stream) if all(one.joints) and not own_columns & {*one.columns}]
    taken = [column for one in candidates for column in one.columns]
    times = {*times_among(stream, ()), *ok_columns(stream), *stream.dates, *poses, *taken}
    groups: dict[tuple[str, ...], list[str]] = {}
    for name in stream.columns:
        words = _words(name)
        if name in times or set(words) & _SETS["no_joints"]:
            continue
        title = stream.titled(name)
        own = [_kind(title), *(w for w in words if w in _OF_QUANTITIES)]
        letters = re.sub(r"[\[_. ]?\d+\]?", "#", _UNIT.sub("", name))  # q1 [deg], q2 [deg], q3 [mm] are of one robot
        stated = ("words", *own) if _UNIT.search(title) else ("alone", name)  # "elbow [deg]"
        stem = [letters] if _joint_number(name) else []
        key = ("words", *own, *stem) if own[1:] else ("#", letters, *own) if "#" in letters else stated
        first = next((i for i, word in enumerate(words) if word in _SETS["joints"]), len(words))
        if key[0] == "alone" and words[first:] and {*words[first:]} <= _SETS["joints"] | _SETS["units"]:
            key = ("words", *words[:first], "of joints")  # psm_outer_yaw, psm_outer_wrist_pitch
        groups.setdefault(key, []).append(name)
    for (how, *_, what), columns in groups.items():
        of_joints = {word for name in columns for word in _words(name)} & _SETS["joints"]
        if how == "alone" or (what == "of joints" and (len(columns) < 2 or of_joints <= _SETS["turns"])):
            continue
        for part in _by_shared_number(columns):
            is_numbered = _joint_number(part[0]) != ""
            ordered = sorted(part, key=natural) if is_numbered else part
            if not 1 <= len(ordered) <= _MAX_JOINTS:
                continue
            words = _words(ordered[0])
            named = _own_parts(ordered)
            is_named = not is_numbered and how == "words" and all(named) and len(set(named)) == len(named)
            joints = named if is_named else ("",) * len(ordered)
            candidates.append(Candidate(stream, tuple(ordered), _kind(stream.titled(ordered[0])), _role(words), joints))
    return candidates


def moving_columns(stream: Stream, today: float) -> MovingColumns | None:
    """Return the quantities of a nameless table's columns, by their motion; None if it does not determine them."""
    if not is_nameless(stream) or set(_words(next(iter(stream.columns)))) & _OF_QUANTITIES:
        return None
    times = {*time_columns(stream), *stream.dates}
    try:
        time = time_of(stream, (), None, None, today=today)
    except InputError:  # of a unit that is not known
        time = None
    columns = {name: values for name, values in stream.columns.items() if name not in times}
    return by_motion(columns, None if time is None else time.stamp / SECOND)


def _joint_number(name: str) -> str:
    """Return the number of a joint at the end of its name, behind which only words of its quantity or unit stand."""
    last = list(re.finditer(r"\d+", name))[-1:]
    behind = _words(name[last[0].end() :]) if last else ["none"]
    return last[0].group() if all(word in _OF_NO_JOINT for word in behind) else ""


def _by_shared_number(columns: Sequence[str]) -> list[list[str]]:
    """Part columns by numbers that are no joint's own, which several share: of the arm in /PSM1/... and /PSM2/..."""
    parts = [list(columns)]
    numbers = {column: re.findall(r"\d+", column)[: -1 if _joint_number(column) else None] for column in columns}
    for place in range(max(map(len, numbers.values()))):
        split: list[list[str]] = []
        for part in parts:
            by_number: dict[str, list[str]] = {}
            for column in part:
                by_number.setdefault("".join(numbers[column][place : place + 1]), []).append(column)
            shared = len(by_number) > 1 and all(len(own) > 1 for own in by_number.values())
            split += by_number.values() if shared else [part]
        parts = split
    return parts


def _own_parts(columns: Sequence[str]) -> tuple[str, ...]:
    """Return the distinctive part of each name: without shared path, the quantity's words and units."""
    segments = [column.split("/") for column in columns]
    shared = set.intersection(*map(set, segments)) if len(columns) > 1 else set[str]()
    own = ["_".join(segment for segment in name if segment not in shared) for name in segments]
    words = (re.findall(r"[a-z]+\d*", name.lower()) for name in own)
    return tuple("_".join(word for word in name if word not in _OF_NO_JOINT) for name in words)


def _words(name: str) -> list[str]:
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower().replace("target_moment", "target_torque")  # of a UR
    return re.findall(r"[a-z]+", re.sub(r"[23]d(?![a-z])", "", _CRTK.sub("", apart)))  # 3D is no "desired"


def _kind(name: str) -> Kind:
    unit, words = _UNIT.search(name), set(_words(name))
    if unit and (unit["effort"] or unit["speed"]):
        return "effort" if unit["effort"] else "acceleration" if unit["again"] else "velocity"
    kind: Kind = next((kind for kind, names in _KINDS.items() if words & names), "position")
    return "position" if kind == "current" and words & _SETS["positions"] else kind


def _role(words: Sequence[str]) -> Role:
    if set(words) & _SETS["reported"] and not set(words) & _ROLES["measured outside"]:
        return "own"
    return next((role for role, names in _ROLES.items() if set(words) & names), "unknown")


def joints_meant(names: Sequence[str], model: Jointed) -> tuple[str, ...]:
    """Return the joint whose words, but those that all have ("joint"), stand in each name: the longest, or ""."""
    words = {joint: _words_and_numbers(joint) for joint in model.joint_names}
    shared = set.intersection(*map(set, words.values())) if len(words) > 1 else set[str]()
    keys = {joint: " ".join(w for w in each if w not in shared) for joint, each in words.items()}
    meant = []
    for name in names:
        spaced = f" {' '.join(_words_and_numbers(name))} "
        inside = [joint for joint, key in keys.items() if key and f" {key} " in spaced]
        longest = max(map(len, map(keys.__getitem__, inside)), default=0)
        best = [name] if name in keys else [joint for joint in inside if len(keys[joint]) == longest]
        meant.append(best[0] if len(best) == 1 else "")
    return tuple(meant)


def _words_and_numbers(name: str) -> list[str]:
    return re.findall(r"[a-z]+|\d+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower())


def by_motion(columns: Mapping[str, NDArray[np.generic]], seconds: Floats | None) -> MovingColumns | None:
    """Return positions, velocities and torques, by each velocity as far behind its position; None without any."""
    names, rows = list(columns), slice(0, _MAX_ROWS)
    if len(names) < 2:
        return None
    values = np.column_stack([np.asarray(without_missing(columns[name][rows]), np.float64) for name in names])
    time = np.arange(len(values), dtype=np.float64) if seconds is None else seconds[rows]
    whole = np.isfinite(values).all(axis=1) & np.isfinite(time)
    values, time = values[whole], time[whole]
    if len(values) < _MIN_ROWS or not (np.diff(time) > 0.0).all():
        return None
    is_derivative = _derivatives(values, time, any_size=seconds is None)
    m = len(names)
    pairs = {d: [i for i in range(m - d) if is_derivative[i, i + d]] for d in range(1, m)}
    d = max(pairs, key=lambda each: (len(pairs[each]), -each))
    q = [i for i in pairs[d] if i - d not in pairs[d]]  # what has an integral itself is a velocity
    if not q:
        return None
    if m % d == 0 and max(q) < d:  # joints that stood still are of the block, too
        q = list(range(d))
    qd = [i + d for i in q]
    accelerations = [i + 2 * d for i in q if i + 2 * d < m and any(is_derivative[j, j + d] for j in qd if j + d < m)]
    used = {*q, *qd, *accelerations}
    again = [i for i in range(m) if i not in used and any(is_derivative[i, j] for j in qd)]
    again = again if len(again) == len(q) else []
    left = [i for i in range(m) if i not in {*used, *again}]
    moving = [i for i in left if np.ptp(values[:, i]) > 0.0]
    tau = next((some for some in (left, moving) if len(some) == len(q)), [])
    others = [i for i in moving if i not in tau]
    return MovingColumns(*(tuple(names[i] for i in some) for some in (q, qd, again, tau, others)))


def _derivatives(values: Floats, time: Floats, *, any_size: bool) -> Flags:
    """Return flags (m, m): column j is the derivative of column i."""
    middle = 0.5 * (values[1:] + values[:-1]) * np.diff(time)[:, np.newaxis]
    sums = np.vstack([np.zeros(values.shape[1]), np.cumsum(middle - middle.mean(axis=0), axis=0)])
    best, size = np.zeros((2, values.shape[1], values.shape[1]))
    for window in _WINDOW_ROWS:
        if window > len(values) // 5:
            break
        moved, added = (array[window:] - array[:-window] for array in (values, sums))
        moved, added = moved - moved.mean(axis=0), added - added.mean(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            both, own, its = moved.T @ added, (moved**2).sum(axis=0), (added**2).sum(axis=0)
            like = np.nan_to_num(both / np.sqrt(np.outer(own, its)))
            larger = like > best
            best, size = np.where(larger, like, best), np.where(larger, np.sqrt(np.divide.outer(own, its)), size)
    is_derivative = best > _DERIVATIVE_CORRELATION
    np.fill_diagonal(is_derivative, False)
    if any_size and is_derivative.any():
        size = size / float(np.median(size[is_derivative]))
    return np.asarray(is_derivative & (size > 1.0 / _SAME_SIZE_FACTOR) & (size < _SAME_SIZE_FACTOR))


# of geometry_msgs/Pose and Transform, and of what trackers' exports are read as
POSE_PARTS = (("position", "orientation"), ("translation", "rotation"))
_POINTS = ("position", "translation", "point")
_TRACKERS = re.compile(r"marker|track|ndi|polaris|aurora|atracsys|optitrack|motive|vicon|mocap|rigid", re.IGNORECASE)
_ARM = re.compile(r"/(PSM|MTM|ECM|SUJ)\w*|/arm\d", re.IGNORECASE)  # of the dVRK and the RAVEN-II
_POSE_UNIT = re.compile(r"(?:[ _]|(?=[\[(]))[\[(]?(mm|cm|m|deg|rad)[\])]?\Z")  # behind the name of a table's column
_MAX_POSITION_M = 20.0  # beyond which a position is in mm, no tracker seeing so far in m
_MAX_ANGLE_RAD = 7.0  # beyond which an angle is in deg


class PoseColumns(NamedTuple):
    """A pose, or a position alone, as a mapping names it."""

    references: tuple[str, ...]
    taken: tuple[str, ...]  # columns of the stream
    orientation: str = "xyzw"
    doubt: str = ""  # about the orientation
    units: tuple[str, str] = ("m", "rad")  # of position and angles
    stream: str = ""
    is_own: bool = False  # of the arm whose joints stand beside it under the same name: measured_x, measured_q1

    @property
    def name(self) -> str:
        """The pose in a word."""
        return ends(self.references)


def poses_of(streams: Sequence[Stream]) -> list[PoseColumns]:
    """Return the poses that move, but the robot's own of its tool and commanded ones."""
    of_poses = []
    for stream in streams:
        place, _, verb = stream.name.removesuffix("/").rpartition("/")
        place = place.removesuffix("/local")
        own = any(other.name.startswith(f"{place}/") and re.search(r"_j[spvf]\Z", other.name) for other in streams)
        if verb.endswith("_cp") and (verb != "measured_cp" or own or _ARM.match(place)):
            continue
        poses = poses_by_parts(stream)
        poses += _by_names(stream, {name for pose in poses for name in pose.taken}) if stream.type == "table" else []
        moving = [one for one in poses if any(_moves(stream.numbers(column)) for column in one.taken)]
        of_poses += [one._replace(units=_units(stream, one), stream=stream.name) for one in moving]
    return of_poses


def _moves(values: NDArray[Any]) -> bool:
    finite = values[np.isfinite(values)]
    return len(finite) > 0 and finite.max() > finite.min()


def _units(stream: Stream, pose: PoseColumns) -> tuple[str, str]:
    """Return the units of a pose's position and angles, by the names of its columns or by their size."""

    def unit(columns: Sequence[str], threshold: float, small: str, large: str) -> str:
        named = _POSE_UNIT.search(stream.titled(columns[0])) if columns and stream.type == "table" else None
        sizes = np.abs([stream.numbers(column) for column in columns])
        return named[1] if named else large if (sizes > threshold).any() else small

    return unit(pose.taken[:3], _MAX_POSITION_M, "m", "mm"), unit(pose.taken[3:], _MAX_ANGLE_RAD, "rad", "deg")


def poses_by_parts(stream: Stream) -> list[PoseColumns]:
    """Return poses such as pose.position.x ... pose.orientation.w, and points alone."""
    front, poses = "" if stream.type == "table" else f"{stream.name}.", list[PoseColumns]()
    for name in [name for name in stream.columns if name.endswith(".x")]:
        point = name.removesuffix(".x")
        base, _, part = f".{point}".rpartition(".")
        if part not in _POINTS:
            continue
        turn = f"{base[1:]}.{dict(POSE_PARTS).get(part)}".lstrip(".")
        positions, turns = (tuple(f"{of}.{axis}" for axis in axes) for of, axes in ((point, "xyz"), (turn, "xyzw")))
        if turns[-1] in stream.columns:
            poses.append(PoseColumns((f"{front}{base[1:]}".rstrip("."),), positions + turns))
        elif set(positions) <= set(stream.columns):
            poses.append(PoseColumns((f"{front}{point}",), positions))
    return poses


def _by_names(stream: Stream, taken: Collection[str]) -> list[PoseColumns]:
    """Return poses of a table such as tx ty tz qx qy qz qw; positions alone where the name is a tracker's."""
    names, poses = tuple(name for name in stream.columns if name not in taken), list[PoseColumns]()

    def is_turn(columns: Sequence[str]) -> bool:
        lengths = np.linalg.norm([stream.numbers(name) for name in columns], axis=0)
        return len(columns) < 4 or bool(np.all(np.abs(lengths[(lengths > 0.0) & np.isfinite(lengths)] - 1.0) < 1e-2))

    if len(names) == 8 and is_nameless(stream) and is_turn(names[4:]):  # TUM's trajectories: time, position, quaternion
        return [PoseColumns(names[1:], names[1:])]
    # names that are there again: X#2 [mm] is #2 x
    bare = {re.sub(r"(.*)(#\d+)\Z", r"\2 \1", _POSE_UNIT.sub("", name.lower())): name for name in names}
    for (turns, orientation, doubt), position in product(WORDS["poses"]["turns"], WORDS["poses"]["positions"]):
        words = f"{position} {turns}".split()
        for stem in [name.removesuffix(words[0]) for name in bare if re.search(rf"(\A|[ ._/:]){words[0]}\Z", name)]:
            columns = tuple(bare[stem + word] for word in words if stem + word in bare)
            new = not any(set(columns) & set(one.taken) for one in poses)
            is_pose = turns or _TRACKERS.search(f"{stream.name} {stem}")
            if len(columns) == len(words) and new and is_pose and is_turn(columns[3:]):
                own = stem != "" and any(re.match(rf"{re.escape(stem)}(q|jp|joint_?)[1-9]", name) for name in bare)
                poses.append(PoseColumns(columns, columns, orientation, doubt, is_own=own))
    points = {base: columns for base, columns in arrays_of(stream).items() if len(columns) == 3}
    for base in [base for base in points if _TRACKERS.search(base) and re.search("position|translation|xyz", base)]:
        poses.append(PoseColumns(tuple(points[base]), tuple(points[base])))
    return poses
