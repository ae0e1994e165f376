"""Files that were damaged, as bytes or as texts: read to their end, or refused by a CatenaryError."""

import contextlib
import io
import json
import os
import random
import shutil
import tempfile
import time
import tomllib
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from tests.campaign.mutants import mutant, same_length, spoilt_table, spoilt_xml
from tests.campaign.part import Fell, Part

MUTANTS = 1600  # of each format
LONGEST = 5.0  # that reading a file may take [s] of processor time
DATA = Path(__file__).parents[3] / "src" / "catenary"
ROBOTS = ("raven2", "dvrk_mtm", "tiago")
Damage = Callable[[random.Random, bytes], bytes]


def sample(name: str) -> Path:
    """Return where a whole file is made, once in a child process, whose folder goes with it."""
    return Path(tempfile.mkdtemp(prefix="campaign-sample-")) / name


def byte_case(
    name: str, whole: Callable[[], bytes], read: Callable[[Path], object], damage: Damage = mutant
) -> Callable[[int, Path], None]:
    """Return a case: a whole file, damaged, under this name, read."""

    def case(seed: int, folder: Path) -> None:
        path = folder / name
        path.write_bytes(damage(random.Random(seed), whole()))
        read(path)

    return case


# recordings


@cache
def _journal() -> Path:
    from oracles.raven_recording import record

    return record(sample("journal"), 0.6)


@cache
def _bag(name: str) -> Path:
    from oracles.raven_recording import write_bag

    return write_bag(_journal(), sample(name))


def _read_recording(path: Path) -> None:
    """Read all messages that are whole."""
    from catenary.recording.bag_reader import open_recording

    for _ in open_recording(path).messages():
        pass


def sqlite_case(seed: int, folder: Path) -> None:
    """SQLite or the metadata of a ROS 2 bag."""
    rng, bag = random.Random(seed), folder / "a"
    shutil.copytree(_bag("a.sqlite"), bag)
    damaged = rng.choice(sorted(bag.iterdir()))
    damaged.write_bytes(mutant(rng, damaged.read_bytes()))
    _read_recording(bag)


@cache
def _csv() -> Path:
    from oracles.raven_recording import write_csv

    return write_csv(_journal(), sample("raven.csv"))


@cache
def _parquet() -> bytes:
    from catenary.recording.import_formats.known_layouts import read_raven
    from catenary.recording.logs import write_parquet

    path = sample("log.parquet")
    write_parquet(read_raven([_csv()]).log, path)
    return path.read_bytes()


def _damaged_parquet(rng: random.Random, whole: bytes) -> bytes:
    """Damage the pages, so that the directory behind them is read, or some bits of the directory."""
    begin = len(whole) - 8 - int.from_bytes(whole[-8:-4], "little")
    if rng.random() < 0.5:
        return whole[:4] + same_length(rng, whole[4:begin]) + whole[begin:]
    directory = bytearray(whole[begin:-8])
    directory[rng.randrange(len(directory))] ^= 1 << rng.randrange(8)
    return whole[:begin] + directory + whole[-8:]


def _damaged_csv(rng: random.Random, whole: bytes) -> bytes:
    cells = whole.split(b",")
    odd = (b"", b"nan", b"inf", b"-1e308", b"1e400", b"9" * 5000, b'"', b"\n", b"x", b"0x10", b"1e-320")
    cells[rng.randrange(len(cells))] = rng.choice(odd)
    return b",".join(cells) if rng.random() < 0.5 else mutant(rng, whole)


def _read_log(path: Path) -> None:
    from catenary.recording.logs import read_log

    read_log(path)


@cache
def _hdf5() -> bytes:
    import h5py
    import numpy as np

    path = sample("lab.h5")
    with h5py.File(path, "w") as file:
        file["obs/q"], file["time"] = np.random.default_rng(1).normal(size=(200, 3)), np.arange(200) * 0.01
        file["obs/q"].attrs["units"] = "deg"
    return path.read_bytes()


def _read_tables(path: Path) -> None:
    from catenary.recording.import_formats.recording_files import Sources

    Sources([path])


def deep_case(seed: int, folder: Path) -> None:
    """Nest what nests, thousands of levels deep, below a path that may be no UTF-8: it is refused at once."""
    import h5py

    from catenary.robots.catalog import load_robot

    rng = random.Random(seed)
    folder, depth = folder / os.fsdecode(rng.choice((b"lab", b"l\xe9b"))), rng.randrange(65, 20_000)
    folder.mkdir()
    if rng.random() < 0.2:
        with h5py.File(folder / "deep.h5", "w") as file:
            group: Any = file
            for _ in range(min(depth, 3000)):
                group = group.create_group("g")
        _read_tables(folder / "deep.h5")
    else:
        dot = rng.choice((".", " . ", '."a".', ".'b c'."))
        key = dot.join(["a"] * depth)
        (folder / "deep.toml").write_text(
            rng.choice((f"{key} = 1\n", f"[{key}]\n", f"[[{key}]]\n", f"a = {{{key} = 1}}\n"))
        )
        load_robot(folder / "deep.toml")
    raise Fell("was read")


# archives


@cache
def linear_model() -> bytes:
    """A calibration model's file."""
    import numpy as np

    import catenary

    q = np.cumsum(np.random.default_rng(1).normal(scale=0.01, size=(400, 3)), axis=0)
    path = sample("model.npz")
    catenary.fit(q, q + 0.01 * np.sin(q), units=("rad", "rad", "m"), model="linear").save(path)
    return path.read_bytes()


def _repacked(rng: random.Random, whole: bytes) -> bytes:
    """Return an archive with one member damaged, or gone, and all checksums right; or damaged as bytes."""
    if rng.random() < 0.4:
        return mutant(rng, whole)
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(whole)) as archive, zipfile.ZipFile(out, "w") as damaged:
        names = archive.namelist()
        hit = rng.choice(names)
        for name in names:
            if name != hit:
                damaged.writestr(name, archive.read(name))
            elif rng.random() < 0.9:
                damaged.writestr(name, mutant(rng, archive.read(name)))
    return out.getvalue()


def _load_model(path: Path) -> None:
    from catenary.calibration.model_file import load_model

    load_model(path)


@cache
def _arrays() -> dict[str, Any]:
    """Return the arrays of a sound model."""
    import numpy as np

    with np.load(io.BytesIO(linear_model())) as content:
        return dict(content)


def model_json_case(seed: int, folder: Path) -> None:
    """Spoil the JSON inside a model."""
    import numpy as np

    from catenary.workflows.check import check_file

    rng, arrays = random.Random(seed), dict(_arrays())
    key = rng.choice(("structure", "structure", "card"))
    arrays[key] = np.array(spoilt_table(rng, json.loads(str(arrays[key])), toml=False).decode("utf-8", "replace"))
    np.savez(path := folder / "model.npz", **arrays)
    check_file(str(path))


# texts


def _use(path: Path) -> None:
    """Ask an accepted robot for what every robot gives: finite torques and poses."""
    import numpy as np

    from catenary.dynamics.kinematics import forward_kinematics
    from catenary.errors import MissingInertiaError
    from catenary.gravity.torque import gravity_torque
    from catenary.robots.catalog import load_robot

    model = load_robot(path)
    if not np.allclose(np.linalg.norm(model.tree.axis, axis=1), 1.0):
        raise Fell("an axis is not of length one")
    q = np.clip(np.zeros(model.n), model.lower, model.upper)
    if np.isfinite(q).all() and not np.isfinite(forward_kinematics(model, q).position).all():
        raise Fell("a pose is not finite")
    with contextlib.suppress(MissingInertiaError):
        if not np.isfinite(gravity_torque(model, q, (0.0, 0.0, -9.81))).all():
            raise Fell("a torque is not finite")


def robot_toml_case(seed: int, folder: Path) -> None:
    """Spoil a robot of the catalogue; one that is still a robot is used."""
    rng, path = random.Random(seed), folder / "robot.toml"
    text = (DATA / "robots" / "data" / f"{rng.choice(ROBOTS)}.toml").read_text()
    path.write_bytes(spoilt_table(rng, tomllib.loads(text), toml=True))
    _use(path)


@cache
def _urdf() -> bytes:
    from catenary.robots.catalog import load_robot
    from catenary.robots.urdf_export import urdf_text

    return urdf_text(load_robot("tiago")).encode()


ARM = b"""<mujoco model="arm"><compiler angle="radian"/><default><joint damping="1"/></default><worldbody>
  <body name="upper" pos="0 0 1"><joint name="shoulder" axis="0 1 0" range="-1 1"/><geom size="0.1" mass="1"/>
    <body name="lower" pos="1 0 0"><joint name="elbow" type="slide" axis="0 1 0"/><geom size="0.1" mass="1"/>
      <body name="hand" pos="1 0 0"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="wrist"/>
        <site name="tip"/></body></body></body></worldbody>
  <equality><joint joint1="elbow" joint2="wrist" polycoef="0 1 0 0 0"/></equality></mujoco>"""
COMMANDS = (
    ("fk", "raven2", "--q-deg", "0,0,0", "--frame", "tool"), ("ik", "raven2", "--position-mm", "19,-7,-67", "--rpy-deg", "0,0,0"),
    ("gravity", "raven2", "--q", "0,0,0", "--gravity", "0,0,-9.81"), ("gravity", "raven2", "--q", "0,0,0", "--base-tilt-deg", "10,5", "--payload", "0.1"),
    ("robots",), ("check", "nothing.npz"), ("export", "raven2", "--c", "arm.h"), ("serve", "--ros", "none", "--duration", "0"),
    ("fit", "none.parquet", "--out", "m.npz"), ("identify", "a.npz", "--robot", "raven2", "--out", "b.npz"), ("extract", "project"),
    ("goto", "--q-deg", "1,2,3", "--joints", "a"), ("regressor", "raven2"), ("deploy", "m.npz", "project", "--seconds", "1"),
)  # fmt: skip
WORDS = (
    "nan", "inf", "1e999", "9" * 5000, "1e308", "-1", "0", "", " ", ",", ",,,", "1,2", "1,2,3,nan", "x" * 20_000, "\x1b[2J",
    "\u202e", "é", "../..", "/dev/null", "/", "--json", "--help", "-", "--", "--q", "1" + ",1" * 5000, "1_0", "\ud800", "\n",
    "%s", "{}", "raven2", "--seed", "18446744073709551616",
)  # fmt: skip


def options_case(seed: int, folder: Path) -> None:
    """Spoil the words of a command that ends at once; it says why, and shows no control character."""
    from command_line import catenary

    rng = random.Random(seed)
    words = list(rng.choice(COMMANDS))
    for _ in range(rng.choice((1, 1, 2, 3))):
        at = rng.randrange(len(words))
        words[at : at + rng.randrange(2)] = [rng.choice(WORDS)] if rng.random() < 0.7 else []
        words = words or ["robots"]
    if "serve" in words:
        words += ["--duration", "0"]  # else it serves until it is ended, as it should
    (folder / "words.json").write_text(json.dumps(words))
    before = Path.cwd()
    os.chdir(folder)
    try:
        outcome = catenary(*words)
    finally:
        os.chdir(before)
    if outcome.code not in (0, 1, 2):
        raise Fell(f"exit code {outcome.code}")
    if any((ord(c) < 32 and c not in "\n\t") or c in "\x7f\u202e" for c in outcome.out + outcome.err):
        raise Fell("a control character reached the terminal")


def _timed(case: Callable[[int, Path], None]) -> Callable[[int, Path], None]:
    """Count the processor time of a case without that of making the samples and compiling, the first time."""
    is_warm = False

    def timed(seed: int, folder: Path) -> None:
        nonlocal is_warm
        for warming in () if is_warm else range(4):
            (folder / "warming").mkdir()
            with contextlib.suppress(Exception):
                case(-1 - warming, folder / "warming")
            shutil.rmtree(folder / "warming")
        is_warm = True
        begin = time.process_time()
        try:
            case(seed, folder)
        finally:
            taken = time.process_time() - begin
            if taken > LONGEST:
                raise Fell(f"took {taken:.1f} s of processor time, more than {LONGEST:g} s")

    return timed


CASES: dict[str, Callable[[int, Path], None]] = {
    "journal": byte_case("0000.mcap", lambda: next(_journal().glob("*.mcap")).read_bytes(), _read_recording),
    "ros1_bag": byte_case("a.bag", lambda: _bag("a.bag").read_bytes(), _read_recording),
    "mcap": byte_case("a.mcap", lambda: next(_bag("a").glob("*.mcap")).read_bytes(), _read_recording),
    "ros2_bag": sqlite_case,
    "parquet_log": byte_case("log.parquet", _parquet, _read_log, _damaged_parquet),
    "csv": byte_case("raven.csv", lambda: _csv().read_bytes(), _read_log, _damaged_csv),
    "model_npz": byte_case("model.npz", linear_model, _load_model, _repacked),
    "hdf5": byte_case("lab.h5", _hdf5, _read_tables),
    "deep": deep_case,
    "model-json": model_json_case,
    "robot-toml": robot_toml_case,
    "urdf": byte_case("robot.urdf", _urdf, _use, lambda rng, text: spoilt_xml(rng, text.decode())),
    "mjcf": byte_case("robot.xml", lambda: ARM, _use, lambda rng, text: spoilt_xml(rng, text.decode())),
}
PARTS = (
    *(
        Part(f"files.{name}", MUTANTS, _timed(case), may_refuse=True, processor_time=120.0)
        for name, case in CASES.items()
    ),
    Part("files.options", MUTANTS, options_case, may_refuse=True, processor_time=120.0),
)
