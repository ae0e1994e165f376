"""Logs in layouts that others publish, read into a MotionLog."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.archives import content_in_words, read_arrays
from catenary.documents import shortened
from catenary.errors import FileFormatError, InputError
from catenary.files import sha256_of
from catenary.plant import Joints, MotionLog, nameless, places_of

# joints of the RAVEN-II and of the da Vinci PSM: two turning ones, the insertion, the tool's
CABLE_ARM_UNITS = ("rad", "rad", "m", "rad", "rad", "rad")
MOST_JOINTS = 1000  # of a recording, and of their names and units
MOST_TIME_NOTES = 5  # a note each; a shuffled log would have thousands


def read_command_log(
    path: Path, *, units: Sequence[str] | None = None, joint_names: Sequence[str] | None = None
) -> MotionLog:
    """Read a `.npz` of commanded and measured joint positions.

    Arrays: `q_des` (N, n), `q_act` (N, n) in rad and m, `ok` (N,) bool, and, if there, `t` (N,) in s,
    `tau` (N, n), `dq` (N, n), `units`, `joint_names` (n,) strings. A time stamp that goes back begins another
    recording. The layout is that of Hwang et al. (RA-L 2020).

    Args:
        path: The file.
        units: "rad" or "m" for each of `joint_names`, the same as the file's if it states them; where neither says,
            three and six joints are taken to be in the order of the RAVEN-II and the da Vinci PSM (rad, rad, m, rad,
            rad, rad), and the log says so.
        joint_names: Names of the joints where the file has none, otherwise J1, J2, ...
    """
    content = read_arrays(path)
    for key in ("q_des", "q_act", "ok"):
        if key not in content:
            raise FileFormatError(
                f'{path}: array "{key}" is missing; a command log has q_des (N, n), q_act (N, n) and ok (N,); '
                f"{content_in_words(content)}"
            )
    q_nominal = numbers_of(path, content, "q_des", 2)
    rows, n = q_nominal.shape
    own = texts_of(path, content, "joint_names")
    names = own or (tuple(joint_names) if joint_names else nameless(n))
    if len(names) != n:
        raise InputError(f"{path}: q_des has {n} joints, but {len(names)} joint names: {', '.join(names)}")
    stated = texts_of(path, content, "units")
    if units is not None and joint_names and own:
        had = Joints(tuple(joint_names), tuple(units))
        units = [
            units[j]
            for j in places_of(Joints(own), had, whose="the robot that was named", of=f"{path} is of")
        ]
    given = tuple(units) if units is not None else stated
    if len(given) == n and stated and given != stated:
        raise InputError(f"{path}: states the units {','.join(stated)}, but {','.join(given)} were given")
    assumed = not given
    given = given or _assumed_units(path, n)
    notes = [f"units not stated: took {','.join(given)} (order of RAVEN-II and da Vinci PSM)"] * assumed
    if len(given) != n:
        raise InputError(
            f"{path}: q_des has {n} joints, but {len(given)} units were given: {','.join(given)}"
        )
    ok = content["ok"]
    if ok.shape != (rows,) or ok.dtype.kind not in "biu":
        raise InputError(
            f"{path}: ok: expected ({rows},) of true and false, got {ok.dtype} of shape {ok.shape}"
        )
    strange = np.flatnonzero(~np.isin(ok, (0, 1)))
    if len(strange):
        raise InputError(
            f"{path}: ok: expected true and false, or 1 and 0, got {ok[strange[0]]} at row {strange[0]}"
        )
    optional = {"t": 1, "dq": 2, "tau": 2}
    time, qd, tau = (
        numbers_of(path, content, key, dimensions) if key in content else None
        for key, dimensions in optional.items()
    )
    back = np.flatnonzero(np.diff(time if time is not None else ()) < 0.0) + 1
    notes += [
        f"time goes back at row {row}: another recording begins there" for row in back[:MOST_TIME_NOTES]
    ]
    if len(back) > MOST_TIME_NOTES:
        notes.append(f"time goes back {len(back)} times in all; are the rows shuffled?")
    return MotionLog(
        name=path.stem,
        joint_names=names,
        joint_units=given,
        q_nominal=q_nominal,
        q_encoder=numbers_of(path, content, "q_act", 2, gaps=True),
        ok=ok.astype(bool),
        time=time,
        qd=qd,
        tau=tau,
        sha256=sha256_of(path),
        units_assumed=assumed,
        settled={"units": ()} if stated else {},
        notes=tuple(notes),
    )


def numbers_of(
    path: Path,
    content: dict[str, NDArray[Any]],
    key: str,
    dimensions: int,
    *,
    gaps: bool = False,
) -> NDArray[np.float64]:
    """Return one array of a file as numbers.

    Args:
        path: The file, for messages, which name the array as the file does.
        content: Its arrays.
        key: Which one.
        dimensions: That it must have.
        gaps: Let NaN and infinity pass.
    """
    values = content[key]
    if values.dtype.kind not in "fiu":
        raise InputError(f"{path}: {key}: expected numbers, got {values.dtype}")
    if values.ndim != dimensions:
        expected = ("()", "(N,)", "(N, n)")[dimensions]
        raise InputError(f"{path}: {key}: expected shape {expected}, got {values.shape}")
    if dimensions == 2 and values.shape[1] > MOST_JOINTS:
        raise InputError(f"{path}: {key}: has {values.shape[1]} columns, expected {MOST_JOINTS} at most")
    with np.errstate(over="ignore"):  # a long double may not fit
        values = values.astype(np.float64)
    bad = np.argwhere(~np.isfinite(values))
    if len(bad) and dimensions and not gaps:
        raise InputError(
            f"{path}: {key} is {values[tuple(bad[0])]} at row {bad[0][0]}; expected finite numbers "
            f"({len(bad)} are not)"
        )
    return values


def is_number(text: str) -> bool:
    """Return true for a cell of a text table that is a number; NaN and infinity are."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def texts_of(path: Path, content: dict[str, NDArray[Any]], key: str) -> tuple[str, ...]:
    """Return an array of texts; none where the file lacks it."""
    values = np.atleast_1d(content.get(key, np.array([], dtype=str)))
    if values.dtype.kind not in "SU" or values.ndim != 1 or len(values) > MOST_JOINTS:
        raise InputError(
            f"{path}: {key}: expected (n,) texts, got {values.dtype} of shape {shortened(values.shape)}"
        )
    try:
        return tuple(v.decode() if isinstance(v, bytes) else str(v) for v in values.tolist())
    except (UnicodeDecodeError, SystemError) as error:  # SystemError: NumPy's, of what is no character
        raise InputError(f"{path}: {key}: expected texts in UTF-8: {error}") from error


def _assumed_units(path: Path, n: int) -> tuple[str, ...]:
    if n not in (3, 6):
        raise InputError(
            f"{path}: the units of its {n} joints are not stated; give them in joint order, "
            "for example --units rad,rad,m"
        )
    return CABLE_ARM_UNITS[:n]
