"""What each command refuses, with which words; and that it leaves nothing behind.

A line is typed in an empty folder. {run}, {model}, {motion} and {begun} stand for the fixtures of these names.
"""

import shlex
from pathlib import Path

import pytest

from command_line import refusal

FIT = "fit {run} --model linear --out o.npz"
IDENTIFY = "identify {motion} --robot raven2 --out o.npz"
POSE = "raven2 --q 0,1.57,0.32"
UP = "raven2_full --position-mm 0,0,1"
HELD = "hold two_link --q-deg 30,40 --seconds 0.3"
WEIGHED = "gravity ur10e --q 0,0,0,0,0,0"

A_ROBOT_THAT_CANNOT_BE = {
    "--seed=-1": "Invalid value for '--seed'",
    "--side=middle": "expected left or right",
    "--payload=-0.5": "payload: expected",
    "--payload=nan": "payload: expected",
    "--base-tilt-deg=5": "roll and pitch",
    "--base-tilt-deg=5,nan": "roll and pitch",
}
A_ZIGZAG_THAT_CANNOT_BE = {
    "--direction=J4": "direction: expected J1, J2",
    "--form=newest --direction=J1-J2-J3": "expected generator, files or paper",
    "--state-rate=0": "state rate: expected",
} | {f"--sparsity={value}": "sparsity: expected" for value in ("0", ",", "nan", "1e-9", "1e999999999")}

REFUSALS = {
    **{f"{c} new {o}": w for c in ("home", "calibrate") for o, w in A_ROBOT_THAT_CANNOT_BE.items()},
    **{f"excite new {o}": w for o, w in A_ZIGZAG_THAT_CANNOT_BE.items()},
    **{
        f"{command} --hours={hours}": "test motion: expected"
        for command in ("record {begun}", "calibrate new")
        for hours in ("nan", "inf", "0", "-1", "1000", "1e-4")
    },
    **{f"record {{begun}} --name={name}": "--name" for name in ("train", "''", "../away", "'a b'")},
    **{f"{command} none": "is not a project" for command in ("record", "extract", "deploy {model}")},
    "deploy none.npz {begun}": "none.npz",
    "deploy model.npz": "its project's folder",
    "deploy model.npz --ros 1 --seconds 0": "more than 0",
    "record {begun} --no-motion": "goes with --ros",
    "calibrate new --test b.npz": "--test",
    "calibrate {run}": "is a file, expected a folder",
    "home {run}": "is a file, expected a folder",
    "fit {model} --out o.npz": "it holds a calibration model, written by catenary fit",
    "fit {run} --units deg --out o.npz": "3 joints, but 1 units were given",
    "evaluate {model} {run} --robot nope": 'robot "nope"',
    "payload {run} --model {model}": "it holds a calibration model, written by catenary fit",
    "track two_link --q 0.4,0.9 --controller nope": 'controller "nope"',
    "calibrate new {run} --test {motion}": '"q_des" is missing',
    "record {begun} --no-motion --robot dvrk_psm": "was begun",
    "home --ros 1 --seed 1": "not with --ros",
    # options of fit; the last of an option counts
    f"{FIT} --model neural --preset worst": 'preset "worst"',
    f"{FIT} --inputs ''": "inputs: expected at least one",
    f"{FIT} --inputs J1=": "expected 'JOINT=signal",
    **{f"{FIT} --held-out={share}": "held-out share" for share in ("0", "1", "-0.5", "nan")},
    f"{FIT} --folds 1": "folds: expected 2 or more, or 0",
    f"{FIT} --max-error 1,1": "one per joint",
    f"{FIT} --max-error 1,1,-1": "positive",
    f"{FIT} --seed 4294967296": "--seed",
    f"{FIT} --robot raven2_full": "6 joint names",
    f"{FIT} --out {{run}}": "is a file that is read here",
    f"{FIT} --report o.npz": "something else is written there",
    "evaluate {model} {run} --report {run}": "is a file that is read here",
    f"{IDENTIFY} --terms half": "expected full or static",
    f"{IDENTIFY} --free --urdf a.urdf": "leave --free out",
    f"{IDENTIFY} --test none.npz": "none.npz: no such file",
    "payload {run} --model {run}": "written by catenary identify",
    "excitation panda --out x.npz --static 2": "2 poses cannot show",
    "excitation panda --out x.npz --margin-mm 0": "--margin-mm: expected above 0",
    "excitation panda --out x.npz --mesh none.stl@0,0,1": "none.stl: no such mesh",
    "excitation panda --out x.npz --may-touch q1": "'--may-touch': expected two names",
    "excitation panda --out x.npz --may-touch q1:roof": '"roof": no link with a shape and no obstacle',
    "excitation panda --out x.npz --no-collision-check --floor-m 0": "--floor-m: does not go with --no-collision-check",
    "excitation panda --out x.npz --floor-m 0.4": "q2 and floor in 100 %",
    "excitation panda --out x.npz --trajectory x.csv": "expected .json or .yaml",
    "excitation panda --out x.npz --harmonics 1": "three or more harmonics",
    "excitation dvrk_psm_motors --out x.npz": "no lower limit of q1: give --lower",
    "check raven": "no such file, and no robot of that name; robots: dual_arm_19, dvrk_ecm",
    "check raven2 --picture r.png": "--picture: is of a recording",
    "export --model nothing.npz --c a.h": "nothing.npz",
    f"gravity {POSE} --base-tilt-deg 0,20 --gravity 0,0,-9.81": "--gravity: does not go with --base-tilt-deg",
    f"gravity {POSE} --gravity inf,0,0": "gravity",
    "gravity raven2 --q 0,1": "expected 3 finite numbers",
    "gravity raven2": "give its 3 joints",
    "track two_link --seed 1": "has no seed, for cables are what is drawn; raven2, raven2_right, dvrk_psm",
    "track two_link --q 0.4,0.9 --axes x,z --controller best": "expected one of pd, sg, dg",
    "track raven2 --base-tilt-deg nan,0": "expected roll and pitch",
    "track raven2 --amplitude-mm 400": "Cartesian",
    f"{HELD} --rock w,8,0.1": "axis x, y or z",
    f"{HELD} --rock x,8": "an amplitude, a frequency",
    f"{HELD} --heave 2,-1": "frequency of 0 Hz or more",
    f"{HELD} --heave nan,1": "finite",
    f"{HELD} --sensor-bias 1,2": "--sensor-bias",
    "track two_link --controller inertia --kp 5": "gains of accelerations",
    f"{WEIGHED} --payload-at 0,0,0.1": "--payload-at",
    f"{WEIGHED} --payload 1 --payload-inertia 1,0,0,0.1,0,0.1": "no body has",
    "fk raven2": "give its 3 joints with --q (rad, m) or --q-deg (deg, mm): shoulder [rad]",
    "fk raven2 --q 1,1,0.4 --q-deg 1,1,1": "give its 3 joints with --q",
    "fk raven2 --q ''": "'--q': expected numbers",
    "fk raven2 --q nan,1,0.4": "--q: expected 3 finite numbers",
    "fk raven2 --q 1,2": "expected 3 finite numbers for shoulder [rad], elbow [rad]",
    "fk '' --q 1": "neither a file nor in the catalogue",
    "ik raven2": "give the goal with --position-mm",
    "ik raven2 --position-mm 1e6,0,0": 'joint "insertion"',
    "ik raven2 --position-mm nan,0,0": "--position-mm[0] is nan",
    "ik raven2 --position-mm 19,-7.4,-67 --rpy-deg 0,0,0": "did not reach the pose",
    f"ik {UP} --quaternion 0,0,0,0": "quaternion",
    "ik raven2 --position-mm 0,0,1 --in wrist": "moves with the joints; expected one of base",
    "goto --fast": "give one of",
    "goto --q-deg 900,90,400 --fast": "shoulder",
    "goto --position-mm 0,0,9000 --fast": "9 m from the base, expected at most",
    "goto --q 33,88,395 --fast": "--q-deg takes deg and mm",
    "random --seconds 0.1 --fast": "duration",
    "teleop": "ssh -t",
    "encoders --port /none --ros none": "/none: cannot be opened",
    "encoders --port /none --bits 12 --ros none": "expected 16, 24 or 32",
    "tool-node --tool none.toml --ros none": "none.toml",
    "tool-node --tool new.toml --weigh 6 --ros none": "--robot: expected the arm",
    "tool-node --tool new.toml --weigh 6 --robot two_link --sensor-frame nowhere --ros none": 'no frame "nowhere"',
    "export --model a.npz --c a.h --tool b.toml": "--tool are for a robot",
    "gravity-node --ros none": "one of --imu, --accel, --vector and --port",
    "gravity-node --port /b --points-down": "--points-down: does not go with --port",
    "gravity-node --imu /a --ros none --rate 0": "rate",
    "gravity-node --imu /a --ros none --fallback pray": "fallback",
    "sense --duration 1": "one of --port, --simulated and --replay",
    "sense --port /dev/none": "/dev/none: cannot be opened",
    "sense --simulated --rate 0": "rate_hz",
    **{
        f"{command} --port /dev/none {units}": f"{units.split()[0]}: does not go with --port"  # the board says its own
        for command in ("sense", "gravity-node")
        for units in ("--units g,deg/s", "--driver mpu6050")
    },
    "plot raven2": "--out",
    "plot raven2 --out a.npz": 'ending ".npz": expected .png or .svg or .pdf',
    "plot raven2 --hide x --out a.png": "hide: x: expected some of",
    "plot raven2 --gravity 0,0,-9 --base-tilt-deg 0,1 --out a.png": "does not go with",
    "sense --simulated --ros-distro nonsense": "No such option: --ros-distro",
    "home {begun} --ros-distro humble": "this project's robot is not on ROS 2",
    "view raven2 --as-is": "goes with --log or a project",
    "view ravn2": 'did you mean "raven2"?',
    "view raven2 --model none.npz": "none.npz",
    "view panda --robot-seed 1": "has no seed",
    "view dvrk_psm": "no inertia",
    "view raven2 --log none.parquet": "none.parquet",
    "serve --ros none --robot toaster": "raven2",
    "serve --ros none --base-tilt-deg 1": "roll and pitch",
    "serve --ros none --rate 700": "divided by a whole number",
    "serve --ros none --payload -1": "payload",
    "serve --ros none --grav-dir 0,0,9.8": "three whole numbers",
    "serve --ros none --grav-dir 0,0,99999": "grav_dir",
    "serve --ros none --qos best-effort": "--qos best-effort: goes with --ros 2",
    **{f"serve --ros none --depth={depth}": "--depth" for depth in (0, -1)},
    "button --ros none": "nobody listens to it",
    "nonsense": "No such command 'nonsense'",
    "telop": "Did you mean 'teleop'?",
    "robots --nonsense": "--nonsense",
    "fit": "Usage: catenary fit",
    f"check {300 * 'a'}": "File name too long",
}


class Fixtures(dict[str, Path]):
    """Fixtures by name, made when a line asks for one."""

    def __init__(self, request: pytest.FixtureRequest) -> None:
        super().__init__()
        self.request = request

    def __missing__(self, name: str) -> Path:
        path: Path = self.request.getfixturevalue(name)
        return path


@pytest.mark.alike
@pytest.mark.usefixtures("no_page")
@pytest.mark.parametrize(("line", "words"), REFUSALS.items(), ids=lambda text: text[:60])
def test_what_cannot_be_done_is_refused_and_leaves_nothing(
    line: str, words: str, request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    typed = shlex.split(line.format_map(Fixtures(request)))
    monkeypatch.chdir(tmp_path)
    assert words in refusal(*typed)
    assert list(tmp_path.iterdir()) == []
