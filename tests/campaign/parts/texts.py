"""Text files that were spoilt: robots, mountings, projects, what models and identifications say of themselves."""

import io
import json
import random
import tomllib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from tests.campaign.byte_part import files_part, linear_model, sample
from tests.campaign.part import Fell, Part
from tests.campaign.text_mutants import json_of, spoilt_bytes, spoilt_table, spoilt_xml, toml_of

MUTANTS = 2_000
DATA = Path(__file__).parents[3] / "src" / "catenary"
ROBOTS = ("raven2", "dvrk_mtm", "tiago")
ARM = """<mujoco model="arm"><compiler angle="radian"/><default><joint damping="1"/></default><worldbody>
  <body name="upper" pos="0 0 1"><joint name="shoulder" axis="0 1 0" range="-1 1"/><geom size="0.1" mass="1"/>
    <body name="lower" pos="1 0 0"><joint name="elbow" type="slide" axis="0 1 0"/><geom size="0.1" mass="1"/>
      <body name="hand" pos="1 0 0"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="wrist"/>
        <site name="tip"/></body></body></body></worldbody>
  <equality><joint joint1="elbow" joint2="wrist" polycoef="0 1 0 0 0"/></equality></mujoco>"""


def _use(model: Any) -> None:
    """Ask an accepted robot for what every robot gives: finite torques, poses, and itself again from its record."""
    import numpy as np

    from catenary.dynamics.kinematics import forward_kinematics
    from catenary.errors import MissingInertiaError
    from catenary.gravity.torque import gravity_torque
    from catenary.robots.model_record import robot_from_record, robot_record

    q = np.clip(np.zeros(model.n), model.lower, model.upper)
    if np.isfinite(q).all() and not np.isfinite(forward_kinematics(model, q).position).all():
        raise Fell("a pose is not finite")
    try:
        if not np.isfinite(gravity_torque(model, q, (0.0, 0.0, -9.81))).all():
            raise Fell("a torque is not finite")
    except MissingInertiaError:
        pass
    robot_from_record(json.loads(json.dumps(robot_record(model))))


def _table_case(name: str, sound: Callable[[], Any], read: Callable[[Path], object]) -> Callable[[int, Path], None]:
    """Return a case: a sound table, spoilt, in a file of this name, read."""

    def case(seed: int, folder: Path) -> None:
        rng = random.Random(seed)
        path = folder / name
        path.write_bytes(spoilt_table(rng, sound(), toml_of if name.endswith(".toml") else json_of))
        read(path)

    return case


def robot_toml_case(seed: int, folder: Path) -> None:
    """Spoil a robot of the catalogue; one that is still a robot is used."""
    from catenary.robots.catalog import load_robot

    rng = random.Random(seed)
    text = (DATA / "robots" / "data" / f"{rng.choice(ROBOTS)}.toml").read_bytes()
    path = folder / "robot.toml"
    if rng.random() < 0.2:
        path.write_bytes(spoilt_bytes(rng, text))
    else:
        path.write_bytes(spoilt_table(rng, tomllib.loads(text.decode()), toml_of))
    _use(load_robot(path))


@cache
def _urdf(name: str) -> str:
    from catenary.robots.catalog import load_robot
    from catenary.robots.urdf_export import urdf_text

    return urdf_text(load_robot(name))


def urdf_case(seed: int, folder: Path) -> None:
    """Spoil a URDF; one that is still a robot is used."""
    from catenary.robots.catalog import load_robot

    rng = random.Random(seed)
    path = folder / rng.choice(("robot.urdf", "robot.xml"))
    path.write_bytes(spoilt_xml(rng, _urdf(rng.choice(("panda", "tiago")))))
    _use(load_robot(path))


def mjcf_case(seed: int, folder: Path) -> None:
    """Spoil an MJCF file; one that is still a robot is used."""
    from catenary.robots.catalog import load_robot

    rng = random.Random(seed)
    path = folder / rng.choice(("robot.xml", "robot.mjcf"))
    path.write_bytes(spoilt_xml(rng, ARM))
    _use(load_robot(path))


MOUNTING = {
    "sensor": {"name": "imu", "range_m_s2": 20.0, "range_rad_s": 9.0},
    "accelerometer": {"bias_m_s2": [0.1, 0.0, 0.0], "scale": [1.0, 1.01, 1.0]},
    "gyroscope": {"bias_rad_s": [0.0, 0.01, 0.0]},
    "mounting": {"rotation": [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]], "position_m": [0.1, 0.0, 0.2]},
    "tumble": {"readings": 6, "residual_m_s2": 0.01, "rotation_residual_deg": 0.2, "remarks": ["a"]},
}


def _read_mounting(path: Path) -> None:
    import numpy as np

    from catenary.sensing.mounting import load_mounting, save_mounting
    from catenary.sensing.vector import Kind

    mounting = load_mounting(path)
    if not np.isfinite(mounting.gravity(np.array([0.0, 0.0, 9.81]), Kind.FREE_FALL)).all():
        raise Fell("a gravity is not finite")
    save_mounting(path.with_name("again.toml"), mounting)
    load_mounting(path.with_name("again.toml"))


def _cable_file() -> Any:
    return tomllib.loads((DATA / "simulation" / "data" / "raven2.toml").read_text())


def _read_cable_file(path: Path) -> None:
    from catenary.simulation.cable_parameters import load_cable_arm

    load_cable_arm(path)


TIMES = {"median": 1.0, "p99": 2.0, "p999": 3.0, "max": 4.0}
STATES: dict[str, Any] = {
    "settings.json": {
        "robot": "raven2", "side": "left", "seed": None, "base_tilt_deg": [0.0, 1.0], "payload_kg": 0.0,
        "direction": "J2-J3", "sparsities": [0.5, 0.25], "test_minutes": 20.0, "state_rate_hz": 30.0,
        "connection": "simulation", "form": "generator", "namespace": "/PSM1", "train_minutes": 20.0, "columns": [],
    },
    "steps.json": {
        "home": {
            "made_from": "0" * 64, "files": ["robot/homed.npz"], "version": "1",
            "outputs": {"robot/homed.npz": {"size": 3, "mtime_ns": 5, "sha256": "0" * 64}},
        },
        "record train": {"made_from": "1" * 64, "files": ["recordings/train"]},
    },
    "home.json": {
        "simulated": True, "seconds": 20.0, "joint_names": ["J1", "J2"], "believed": [0.1, 0.2],
        "external_encoders": [0.1, None], "true": [0.1, 0.2],
    },
    "deployment.json": {
        "simulated": True, "ticks": 100, "rate_hz": 1000.0, "compute_us": TIMES, "jitter_us": TIMES, "correction_us": TIMES,
        "overruns": 0, "real_time_priority": False, "leaps": {}, "coverage_asked": None,
        "joints": [{"name": "J1", "unit": "deg", "raw_rmse": 0.1, "rmse": 0.1, "outside_valid_range": 0.0, "coverage": None}],
    },
    "train.synchronised.json": {
        "topics": [{"topic": "/ravenstate", "messages": 5, "rate": 30.0, "longest_gap": 0.1}],
        "rows": 5, "rows_without_encoder": 0, "problems": ["none"],
    },
    ".lock": {"host": "a", "boot": "b", "pid": 3, "command": "catenary home", "since": "now"},
}  # fmt: skip


def project_case(seed: int, folder: Path) -> None:
    """Spoil one of a project's files, and read it as the commands do."""
    from catenary.reports.project import _deployment_blocks
    from catenary.workflows.project.deploy import Deployment
    from catenary.workflows.project.folder import Project, ProjectSettings, project_settings
    from catenary.workflows.project.recordings import _noted
    from catenary.workflows.project.state import ExtractionFile, HomeFile, read_state

    rng = random.Random(seed)
    name = rng.choice(list(STATES))
    path = folder / name
    path.write_bytes(spoilt_table(rng, STATES[name], json_of))
    if name == "home.json":
        read_state(path, HomeFile, "again")
    elif name == "deployment.json":
        _deployment_blocks(read_state(path, Deployment, "again"), "simulation", "recommended")
    elif name == "train.synchronised.json":
        read_state(path, ExtractionFile, "again")
    else:
        settings = project_settings(folder) or ProjectSettings()
        if name == ".lock":
            (folder / "settings.json").write_text(json.dumps(STATES["settings.json"]))
        project = Project(folder, settings)
        project.done("home", ["x"], [folder / "robot" / "homed.npz"])
        _noted(project, "train")


@cache
def _arrays(kind: str) -> dict[str, Any]:
    """Return the arrays of a sound model or identification."""
    import numpy as np

    if kind == "model":
        whole: Path | io.BytesIO = io.BytesIO(linear_model())
    else:
        from catenary.identification.identification import identify
        from catenary.identification.identification_file import identification_card, save_identification
        from catenary.identification.identify_options import IdentifyOptions
        from catenary.robots.catalog import load_robot
        from moving_arm import recorded

        arm = load_robot("raven2")
        found = identify([recorded(arm, 0)], arm, IdentifyOptions(), tests=[recorded(arm, 1)])
        whole = sample("sound.npz")
        save_identification(found, identification_card(found, [], ("a note",)), whole)
    with np.load(whole) as content:
        return dict(content)


def _inside_case(kind: str) -> Callable[[int, Path], None]:
    """Return a case: the JSON inside a model or an identification, spoilt."""

    def case(seed: int, folder: Path) -> None:
        import numpy as np

        from catenary.identification.identification_file import load_identification
        from catenary.workflows.check import check_file

        rng = random.Random(seed)
        arrays = dict(_arrays(kind))
        key = rng.choice(("structure", "structure", "card"))
        text = spoilt_table(rng, json.loads(str(arrays[key])), json_of).decode("utf-8", "replace")
        arrays[key] = np.array(text)
        buffer = io.BytesIO()
        np.savez(buffer, **arrays)
        path = folder / f"{kind}.npz"
        path.write_bytes(buffer.getvalue())
        check_file(str(path)) if kind == "model" else load_identification(path)

    return case


COMMANDS = (
    ("fk", "raven2", "--q", "0,0,0,0,0,0,0"), ("fk", "raven2", "--q-deg", "0,0,0", "--frame", "tool"),
    ("ik", "raven2", "--position-mm", "19,-7,-67", "--rpy-deg", "0,0,0"), ("gravity", "raven2", "--q", "0,0,0", "--gravity", "0,0,-9.81"),
    ("gravity", "raven2", "--tilt", "10,5", "--payload-kg", "0.1"), ("robots", "raven2"), ("check", "nothing.npz"), ("export", "urdf", "raven2"),
    ("serve", "--ros", "none", "--duration", "0"), ("fit", "none.parquet", "--out", "m.npz"), ("identify", "a.npz", "--robot", "raven2"),
    ("extract", "project"), ("record", "--name", "x"),
    ("goto", "--q-deg", "1,2,3", "--joints", "a"), ("regressor", "raven2"), ("deploy", "m.npz", "project", "--seconds", "1"),
)  # fmt: skip
WORDS = (
    "nan", "inf", "-inf", "1e999", "9" * 5000, "1e308", "-1", "0", "", " ", ",", ",,,", "1,2", "1,2,3,nan", "x" * 20_000,
    "\x1b[2J", "\u202e", "é", "../..", "/dev/null", "/", ".", "--json", "--help", "-", "--", "--q", "1" + ",1" * 5000, "0x10", "1_0",
    "\ud800", "\n", "%s", "{}", "raven2", "--seed", "18446744073709551616",
)  # fmt: skip


def options_case(seed: int, folder: Path) -> None:
    """Spoil the words of a command that ends at once; it says why, and shows no control character."""
    import os

    from command_line import catenary

    rng = random.Random(seed)
    words = list(rng.choice(COMMANDS))
    for _ in range(rng.choice((1, 1, 2, 3))):
        at = rng.randrange(len(words))
        kind = rng.randrange(3)
        if kind == 0:
            words[at] = rng.choice(WORDS)
        elif kind == 1:
            words.insert(at + 1, rng.choice(WORDS))
        else:
            words.pop(at)
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
    shown = outcome.out + outcome.err
    if any((ord(c) < 32 and c not in "\n\t") or c in "\x7f\u202e" for c in shown):
        raise Fell("a control character reached the terminal")


CASES: dict[str, Callable[[int, Path], None]] = {
    "robot-toml": robot_toml_case,
    "urdf": urdf_case,
    "mjcf": mjcf_case,
    "mounting": _table_case("mounting.toml", lambda: MOUNTING, _read_mounting),
    "cable-toml": _table_case("arm.toml", _cable_file, _read_cable_file),
    "project": project_case,
    "model-json": _inside_case("model"),
    "identification-json": _inside_case("identification"),
}
PARTS = (
    *(files_part(name, case, mutants=MUTANTS) for name, case in CASES.items()),
    Part("files.options", MUTANTS, options_case, may_refuse=True, processor_time=120.0),
)
