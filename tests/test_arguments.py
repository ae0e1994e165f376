"""Wrong arguments of everything that `import catenary` offers are told by name."""

import functools
import inspect
import pickle
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import ArrayLike

import catenary
from catenary.arguments import expected_text, explained, fits
from catenary.calibration.calibration import MotionArrays
from catenary.errors import CatenaryError, InputError
from catenary.plant import Plant
from catenary.robots.model import RobotModel
from recordings import recording

RNG = np.random.default_rng(0)
ARM = catenary.load_robot("two_link")  # compiled in a moment
Q, ZERO, DOWN = np.array([0.6, 1.5]), np.zeros(2), [0.0, 0.0, -9.81]
LOG = recording(RNG, rows=60, error=lambda q: 0.01 + 0.02 * q)
MODEL = catenary.fit(LOG, model="linear", folds=0)
POSE = {"model": ARM, "q": Q}
ROWS = {"q_nominal": LOG.q_nominal, "q_encoder": LOG.q_encoder}
GAINS = {"kp": [100.0, 100.0], "kd": [1.0, 1.0]}
MOTION = catenary.go_to(Q, Q + 0.1, max_velocity=[1.0, 1.0], max_acceleration=[1.0, 1.0])
PLANT = catenary.MujocoPlant(ARM, start=Q)
ROW = {"model": ARM, "q": Q[None], "tau": ZERO[None], "gravity": DOWN}
EXTERNAL = catenary.external_torque(**ROW, qd=ZERO[None], qdd=ZERO[None], deviation=[0.1, 0.1])
TOOL = catenary.fit_wrist_tool(2.0 * (pull := RNG.normal(size=(9, 3))), np.cross([0.0, 0.0, 0.1], 2.0 * pull), pull)
STATE = catenary.JointState(0.0, Q, ZERO, ZERO, Q, np.array(DOWN), 0.0)
# what a call that succeeds is given; one argument after the other is then another thing
CALLS: dict[str, dict[str, Any]] = {
    "gravity_torque": {**POSE, "gravity": DOWN},
    "mass_matrix": POSE,
    "inverse_dynamics": {**POSE, "qd": ZERO, "qdd": ZERO, "gravity": DOWN},
    "coriolis_matrix": {**POSE, "qd": ZERO},
    "torque_derivatives": {**POSE, "qd": ZERO, "qdd": ZERO, "gravity": DOWN},
    "frame_motion": {**POSE, "qd": ZERO, "qdd": ZERO},
    "jacobian": POSE,
    "forward_kinematics": POSE,
    "inverse_kinematics": {"model": ARM, "pose": catenary.forward_kinematics(ARM, Q), "q_start": Q},
    "torque_regressor": {**POSE, "qd": ZERO, "qdd": ZERO, "gravity": DOWN},
    "gravity_regressor": {**POSE, "gravity": DOWN},
    "center_of_mass": POSE,
    "center_of_mass_jacobian": POSE,
    "potential_energy": {**POSE, "gravity": DOWN},
    "gravity_kernel": {"model": ARM},
    "compact_regressor": {"model": ARM},
    "export_function": {"model": ARM, "quantity": "gravity", "to": "sympy"},
    "GravityEstimator": {"model": ARM, **GAINS},
    "JointPD": GAINS,
    "GravityPD": {"model": ARM, **GAINS, "gravity": DOWN},
    "InertiaPD": {"model": ARM, "kp": [100.0, 100.0], "kv": [1.0, 1.0]},
    "TorqueLimits": {"torque": [5.0, 5.0, 50.0]},
    "fit": {**ROWS, "units": ["rad", "rad", "m"], "model": "offset", "folds": 0},
    "evaluate": {"model": MODEL, **ROWS},
    "check_data": {**ROWS, "units": ["rad", "rad", "m"]},
    "load_model": {"path": "none.npz"},
    "load_robot": {"source": "raven2"},
    "load_xacro": {"path": "none.urdf.xacro"},
    "load_closed_robot": {"source": "none.xml"},
    "read_log": {"path": "none.parquet"},
    "zigzag": {"direction": "J1", "sparsities": [1 / 2]},
    "go_to": {"q_start": Q, "q_goal": Q + 0.1, "max_velocity": 1.0, "max_acceleration": 1.0},
    "random_sinusoids": {"rng": RNG, "duration": 5.0},
    "FixedBase": {"roll": 0.1, "pitch": 0.1},
    "CablePlant": {"side": "left", "seed": 1},
    "MujocoPlant": {"model": ARM, "start": Q},
    "Corrector": {"model": MODEL},
    "import_recording": {"sources": "none.csv"},
    "identify": {"logs": [LOG], "model": ARM},
    "MotionLog": {
        "name": "a", "joint_names": ("a",), "joint_units": ("rad",), "q_nominal": np.zeros((5, 1)), "ok": np.ones(5, bool),
    },
    "ElasticPD": {"model": ARM, "stiffness": [1e3, 1e3], **GAINS},
    "EstimatedGravityPD": {"estimator": catenary.GravityEstimator(ARM, **GAINS), **GAINS},
    "refresh": {"model": MODEL, **ROWS},
    "forward_dynamics": {**POSE, "qd": ZERO, "tau": ZERO, "gravity": DOWN},
    "BaseMotion": {},
    "MomentumObserver": {"model": ARM},
    "HandGuiding": {"model": ARM, **GAINS, "deviation": 0.1, "max_payload": 1.0},
    "CollisionGuard": {"observer": catenary.MomentumObserver(ARM, deviation=0.1)},
    "ToolCompensation": {"model": ARM, "tool": TOOL},
    "external_torque": {**ROW, "qd": ZERO[None], "qdd": ZERO[None], "deviation": [0.1, 0.1]},
    "external_wrench": {"model": ARM, "q": Q[None], "external": EXTERNAL},
    "locate_load": {**ROW, "noise": [0.1, 0.1]},
    "cut_arm": {"model": ARM, "base": next(iter(ARM.frames)), "tip": ARM.tip},
    "Servo": {"kind": "current", "gain": 1.5},
    "servo_command": {"servos": [catenary.Servo("pwm", 1.5)] * 3, "torque": ZERO, "q": Q, "qd": ZERO},
    "lock_joints": {"model": ARM, "locked": {ARM.joint_names[0]: 0.1}},
    "propose_mapping": {"sources": "none.csv"},
    "record_simulated": {"plant": PLANT, "trajectory": MOTION, "name": "a", "rng": RNG},
    "fit_wrist_tool": {name: RNG.normal(size=(30, 3)) for name in ("force", "torque", "gravity")},
    "run_loop": {"plant": PLANT, "controller": catenary.JointPD(**GAINS), "trajectory": MOTION, "duration": 0.01},
}  # fmt: skip
# records whose fields are theirs, or what needs ROS, a recording's identification, or a folder to write to
NOT_CALLED = {
    "Calibration", "CatenaryError", "CrtkClient", "DataError", "JointState", "Reference", "RobotModel", "estimate_payload",
    "plot", "write_parquet", "__version__",
}  # fmt: skip
OBJECTS = [
    MODEL, LOG, ARM, catenary.Corrector(MODEL), catenary.GravityPD(ARM, **GAINS, gravity=DOWN), catenary.JointPD(**GAINS),
    catenary.GravityEstimator(ARM, **GAINS), catenary.MomentumObserver(ARM), MOTION,
]  # fmt: skip
RIGHT = {
    "q": Q, "qd": ZERO, "tau": ZERO, "gravity": DOWN, **ROWS, "motion": LOG.q_nominal, "time": 0.1, "t": 0.1, "state": STATE,
    "reference": MOTION(0.0), "first": 0, "last": 10, "dt": 0.001,
}  # fmt: skip
WRONG = [
    None, "abc", b"x", 1j, True, 0, -1, 1.5, np.nan, np.inf, [], (), [1.0], ["a"], [np.nan] * 3, [[1.0, 2.0], [3.0]], {"a": 1},
    {1}, np.zeros((2, 2, 2)), np.array(["a"]), object(), print, "a\0b", Path("a\0b.npz"), np.array(["a", "b"]),
    np.array([None, 1.0], dtype=object), np.array([1, 2], dtype="M8[s]"), np.full(2, 1e16), np.full(3, 1e300),
]  # fmt: skip


def raw_errors(call: Callable[..., Any], right: Mapping[str, Any]) -> list[tuple]:
    """Give one argument after the other wrongly; return what was answered by an error of Python's or NumPy's."""
    raw = []
    arguments = [one.name for one in inspect.signature(call).parameters.values() if one.kind is not one.VAR_KEYWORD]
    if "arrays" in inspect.signature(call).parameters:  # each is an argument of its own
        arguments += MotionArrays.__annotations__
    for argument in arguments:
        for wrong in WRONG:
            try:
                call(**{**right, argument: wrong})
            except CatenaryError:
                pass
            except Exception as error:
                if not re.search("missing .* required", str(error)):
                    raw.append((argument, wrong, error))
    return raw


def test_every_public_name_is_called_wrongly_or_left_out_on_purpose() -> None:
    assert {*CALLS, *NOT_CALLED} == set(catenary.__all__)


@pytest.mark.parametrize("name", CALLS)
def test_a_wrong_argument_is_no_error_of_python_or_numpy(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert raw_errors(getattr(catenary, name), CALLS[name]) == []


@pytest.mark.parametrize("one", OBJECTS, ids=lambda one: type(one).__name__)
def test_a_wrong_argument_of_a_method_is_no_error_of_python_or_numpy(
    one: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # "abc" is a place to save to
    for name, method in inspect.getmembers(one, inspect.ismethod):
        if name[0] != "_" or name == "__call__":
            right = {**RIGHT, "q": np.zeros(3)} if isinstance(one, catenary.Corrector) else RIGHT
            known = {each: right[each] for each in inspect.signature(method).parameters if each in right}
            assert raw_errors(method, known) == [], name


def test_the_message_says_which_argument_what_it_was_and_what_was_expected() -> None:
    for call, words in [
        (lambda: catenary.gravity_torque("raven2", Q, DOWN), r'model: expected RobotModel, got str \'raven2\'; .*load_robot'),
        (lambda: catenary.fit(**(CALLS["fit"] | {"folds": "1"})), "folds: expected a whole number, got str '1'"),
        (lambda: catenary.load_robot(3), "source: expected str or Path, got int 3"),
        (lambda: MODEL.matched(None), "log: expected MotionLog, got NoneType None"),
        (lambda: MODEL.evaluate(**ROWS, accept=3), "accept: expected Sequence, got int 3"),
    ]:  # fmt: skip
        with pytest.raises(InputError, match=words):
            call()


@pytest.mark.parametrize("name", CALLS)
def test_a_mistake_of_ours_is_no_argument_that_was_right(name: str) -> None:
    public = getattr(catenary, name)
    arguments: dict[str, Any] = dict(CALLS[name])
    if name == "record_simulated":
        arguments["plant"] = catenary.CablePlant(side="left", seed=1)
    if isinstance(public, type):
        if "__init__" not in vars(public):
            return  # what makes a named tuple is Python's
        public, arguments = public.__init__, {**arguments, "self": object()}

    @functools.wraps(inspect.unwrap(public))
    def fails(*_: Any, **__: Any) -> None:
        raise AttributeError("ours")

    with pytest.raises(AttributeError, match="ours"):
        explained(fails)(**arguments)


def test_a_mistake_of_ours_in_a_kernel_is_none_of_its_inputs(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = catenary.gravity_kernel(ARM)

    def fails(*_: Any) -> None:
        raise AttributeError("ours")

    monkeypatch.setitem(vars(kernel), "_single", fails)
    with pytest.raises(AttributeError, match="ours"):
        kernel(Q, np.array(DOWN))
    with pytest.raises(InputError, match="q: expected"):
        kernel("abc", DOWN)


def test_a_robot_whose_property_fails_is_a_robot_still() -> None:
    class Breaks(catenary.MujocoPlant):
        @property
        def period(self) -> float:
            raise AttributeError("ours")

    assert fits(Breaks(ARM, start=Q), Plant)
    assert not fits(ARM, Plant)


def test_an_error_that_no_argument_explains_stays_as_it_is() -> None:
    @explained
    def fails(number: float, *, names: Sequence[str] = ()) -> float:
        return number / 0

    with pytest.raises(ZeroDivisionError):
        fails(1.0)
    with pytest.raises(TypeError, match="missing 1 required"):
        fails()
    with pytest.raises(InputError, match=r"names: expected Sequence, got str 'ab'"):
        fails(1.0, names="ab")


@pytest.mark.parametrize(
    ("hint", "right", "wrong", "words"),
    [
        (float, (1, 1.5, np.float64(2.0)), (True, "1", None), "a number"),
        (int, (1, np.int64(1)), (True, 1.0), "a whole number"),
        (int | None, (1, None), ("1",), "a whole number or None"),
        (ArrayLike, (1.0, [1, 2], np.ones(3)), (None, 1j, [[1], [1, 2]], {}), "numbers"),
        (ArrayLike | RobotModel, ([1.0], ARM), ("raven2", None), "numbers or RobotModel"),
        (Literal["a", "b"], ("a",), ("c", 1), "one of 'a', 'b'"),
        (Sequence[str], (["a"], ("a", "b"), []), ("ab", [1], None), "Sequence"),
        (tuple[str, int], (("a", 1),), (("a",), ("a", "b"), ["a", 1]), "tuple"),
        (Mapping[str, int], ({"a": 1},), ({"a": "b"}, [("a", 1)]), "Mapping"),
        (Callable[[float], None], (print,), (1,), "Callable"),
        (Iterable[Mapping[str, int]], ([], ({"a": 1},), iter([3])), ("ab", {"a": 1}, [1.0], None), "Iterable"),
        (str | Path, ("a", Path("a")), (1, None), "str or Path"),
    ],
)
def test_an_annotation_is_asked_of_a_value(hint: Any, right: tuple, wrong: tuple, words: str) -> None:
    assert [fits(value, hint) for value in right] == [True] * len(right)
    assert [fits(value, hint) for value in wrong] == [False] * len(wrong)
    assert expected_text(hint) == words


@pytest.mark.parametrize("name", [name for name in catenary.__all__ if name not in ("__version__", "CatenaryError")])
def test_help_shows_types_by_their_names(name: str) -> None:
    public = getattr(catenary, name)
    methods = inspect.getmembers(public, inspect.isfunction) if isinstance(public, type) else []
    for each in (public, *(method for called, method in methods if called[0] != "_")):
        assert not re.search(r"_typing|dtype\[|numpy\.|ForwardRef|\bat 0x", str(inspect.signature(each)))


def test_a_class_made_of_a_public_one_has_its_own_signature() -> None:
    class Mine(catenary.JointPD):
        def __init__(self, stiffness: float) -> None:
            super().__init__([stiffness], [1.0])

    assert list(inspect.signature(Mine).parameters) == ["stiffness"]
    assert pickle.loads(pickle.dumps(catenary.gravity_torque)) is catenary.gravity_torque
