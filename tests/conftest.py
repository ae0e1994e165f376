import gc
import os
import pickle
import re
import resource
from collections import Counter
from collections.abc import Generator, Iterator
from fcntl import LOCK_EX, flock
from hashlib import sha256
from pathlib import Path
from shutil import copytree
from typing import TYPE_CHECKING, Any
from zlib import crc32

import hypothesis
import numba
import numpy as np
import pytest

from made_once import made_once

if TYPE_CHECKING:  # nothing of catenary may be imported before pytest_configure has run
    from catenary.workflows.project.calibrate import CalibrationResult
    from oracles.random_trees import RandomRobot
    from ros import Master

ROOT = Path(__file__).parents[1]
MEMORY = 8 * 2**30  # [B] of a process: a test that takes ever more fails, and does not end those beside it
# robots served to several programs; side by side they are late
IN_REAL_TIME = (
    "test_ros_robot", "test_side_by_side", "test_tools", "test_signals_ros1", "test_hours",
    "test_interrupted_recordings",
)  # fmt: skip
# what takes longest comes first: last, it would keep one worker busy and leave the others idle
FIRST = (
    "real time", "tests/view/test_in_browser.py", "tests/identification/explanations/test_explanations.py",
    "tests/real_data/test_identification.py", "tests/test_labs.py", "tests/test_notebooks.py", "tests/verdict/test_check.py",
    "tests/identification/test_identification.py", "tests/test_docs.py", "tests/test_other_systems.py",
    "tests/calibration/test_extrapolation.py", "tests/sensing/test_shaken_base.py", "tests/cli/test_calibrate.py",
    "tests/cli/test_identify.py", "tests/workflows/robot/test_topic_recorder.py", "tests/website/test_site.py",
)  # fmt: skip
# their tests take long each and share nothing: any worker takes one
APART = ("test_explanations", "test_labs", "test_notebooks")
EXAMPLES = int(os.environ.get("EXAMPLES", "25"))  # of each law, and of a hundred cases alike; 100 tries all
LONGEST_OUTPUT = 200_000  # characters of a test that are kept of each stream


def pytest_configure() -> None:
    """Keep compiled code per state of the sources that it is made of.

    Two states are then compiled side by side, and neither makes the other's code old.
    """
    sources = sha256()
    for path in _of_compiled_code():
        sources.update(path.read_bytes())
    numba.config.CACHE_DIR = str(ROOT / ".cache" / "numba" / sources.hexdigest()[:16])
    os.environ["NUMBA_CACHE_DIR"] = numba.config.CACHE_DIR  # of programs that tests start
    # an example is not wrong because it takes long: many compile something, and the machine may be busy
    hypothesis.settings.register_profile(
        "patient",
        hypothesis.settings(),
        deadline=None,
        suppress_health_check=[hypothesis.HealthCheck.too_slow],
        max_examples=EXAMPLES,
    )
    hypothesis.settings.load_profile("patient")
    # robots' own kernels: none of the user's are read or left behind
    os.environ["XDG_CACHE_HOME"] = str(ROOT / ".cache")
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, resource.getrlimit(resource.RLIMIT_DATA)[1]))
    if "PYTEST_XDIST_WORKER" in os.environ:
        _compile_one_at_a_time(Path(numba.config.CACHE_DIR))


def _of_compiled_code() -> list[Path]:
    """Return the files of what numba compiles, and those whose constants it writes into the code."""
    texts = {path: path.read_text() for path in (ROOT / "src").rglob("*.py")}
    makes = re.compile(r"kernels\.compiled import|^def compiled\(", re.MULTILINE)
    found, waiting = set(), {path for path, text in texts.items() if makes.search(text)}
    while waiting:
        found.add(path := waiting.pop())
        for module, names in re.findall(r"from (catenary[\w.]*) import ([^(\n]+|\([^)]*\))", texts[path]):
            if any(name.isupper() for name in re.findall(r"\w+", names)):
                place = ROOT / "src" / module.replace(".", "/")
                waiting |= {place.with_suffix(".py"), place / "__init__.py"} & texts.keys() - found
    return sorted(found)


@pytest.hookimpl(optionalhook=True)  # without pytest-xdist, one process runs all
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give a file to one worker, and all programs that run in real time to one together: each wants a processor.

    pytest-xdist's own groups (3.8) are not seen by pytest 9.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return _of_one_worker(nodeid)

    config.option.loadscopereorder = False  # in the order of the collection
    return ByFile(config, log)


def _of_one_worker(nodeid: str) -> str:
    file = nodeid.split("::", 1)[0]
    if Path(file).stem in APART:
        return nodeid
    return "real time" if Path(file).stem in IN_REAL_TIME else file


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Look for no garbage among what is collected, then or later: all of it is kept."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(50_000, 20)  # seldom, and the processor works for the tests
        gc.enable()


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put what takes long first, then files of many tests; on workers, leave out most of cases alike."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        items[:] = list(_tried(items))
    of = {item: _of_one_worker(item.nodeid).partition("::")[0] for item in items}
    counts = Counter(of.values())
    items.sort(key=lambda item: (FIRST.index(of[item]) if of[item] in FIRST else len(FIRST), -counts[of[item]]))


def _tried(items: list[pytest.Item]) -> Iterator[pytest.Item]:
    """Yield what is tried of tests marked as alike, the first case and EXAMPLES of a hundred, and all others.

    Slow cases are all tried: who asks for them has the time.
    """
    begun = set()
    for item in items:
        test, marks = item.nodeid.partition("[")[0], {mark.name for mark in item.iter_markers()}
        is_one_of_many = "alike" in marks and "slow" not in marks and test in begun
        if not is_one_of_many or crc32(item.nodeid.encode()) % 100 < EXAMPLES:
            yield item
        begun.add(test)


def _compile_one_at_a_time(folder: Path) -> None:
    """Let one worker compile a function, and those that need it meanwhile wait and find it in numba's cache.

    They begin together, with tests that need the same few functions: each would spend as long on them as one does.
    """
    from catenary.kernels.compiled import Compiled

    call = Compiled.__call__
    folder.mkdir(parents=True, exist_ok=True)

    def first_call_alone(function: Compiled, *arguments: object) -> object:
        if "was_called" in vars(function):
            return call(function, *arguments)
        vars(function)["was_called"] = True
        name = f"{function.__module__}.{function.__name__}.lock"
        with (folder / name).open("w") as lock:
            flock(lock, LOCK_EX)
            return call(function, *arguments)

    Compiled.__call__ = first_call_alone  # type: ignore[method-assign]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(call: pytest.CallInfo[None]) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Shorten what a test printed without end, and fail one that left the garbage collector off."""
    report = yield
    report.sections = [(title, _shortened(text)) for title, text in report.sections]
    if report.failed and len(report.longreprtext) > LONGEST_OUTPUT:
        report.longrepr = _shortened(report.longreprtext)
    if call.when == "teardown" and not gc.isenabled():
        gc.enable()
        report.outcome, report.longrepr = "failed", f"{report.nodeid} left the garbage collector off"
    return report


def _shortened(text: str) -> str:
    half, more = LONGEST_OUTPUT // 2, len(text) - LONGEST_OUTPUT
    return text if more <= 0 else f"{text[:half]}\n[{more} characters more]\n{text[-half:]}"


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers of a test, the same in every run."""
    return np.random.default_rng(0)


@pytest.fixture
def hurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulate less: arms go four times as fast to where a motion begins, and a project's model runs for 2 s."""
    from catenary.workflows.project import calibrate
    from catenary.workflows.robot import motion

    monkeypatch.setattr(calibrate, "_DEPLOY_S", 2.0)
    for gentle in ("GENTLE_VELOCITY", "GENTLE_ACCELERATION"):
        monkeypatch.setattr(motion, gentle, {unit: 4.0 * value for unit, value in getattr(motion, gentle).items()})


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Set up pages and their figures, and leave out to draw them, which takes seconds."""
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda _, file, **__: file.write(b"a picture"))


@pytest.fixture(scope="session", autouse=True)
def _simulated_robots_homed_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Home each simulated robot once; the same one is a copy of it: homing takes half a minute of simulated motion."""
    from catenary.simulation.firmware_plant import FirmwarePlant

    home = FirmwarePlant.home

    def home_once(plant: FirmwarePlant) -> None:
        def homed(_: Path) -> FirmwarePlant:
            home(plant)
            return plant

        try:
            key = sha256(pickle.dumps(plant)).hexdigest()
        except (pickle.PicklingError, AttributeError, TypeError):  # on a base of a test's own
            home(plant)
        else:
            vars(plant).update(vars(made_once(tmp_path_factory, f"homed_{key[:16]}", homed)))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(FirmwarePlant, "home", home_once)
        yield


@pytest.fixture(scope="session")
def random_robots() -> "list[RandomRobot]":
    """Sixty trees: each size from one to nine joints six times and more."""
    from oracles.random_trees import random_robot

    return [random_robot(seed) for seed in range(60)]


@pytest.fixture(scope="session")
def ros_master(tmp_path_factory: pytest.TempPathFactory) -> "Iterator[Master]":
    """ROS 1's master for the process of the tests, which can have one node; skips where there is no ROS 1."""
    from catenary.crtk.ros1 import master as ros1_master
    from patience import PATIENCE
    from ros import running_master

    with running_master(tmp_path_factory.mktemp("ros")) as master, pytest.MonkeyPatch.context() as patch:
        patch.setattr(ros1_master, "_ANSWER_WITHIN_S", PATIENCE)  # this machine may be busy, and the master late
        for name in ("ROS_MASTER_URI", "ROS_IP", "ROS_LOG_DIR", "ROS_HOME"):
            patch.setenv(name, master.environment[name])
        yield master


@pytest.fixture(scope="module")
def dds_domain() -> Iterator[int]:
    """DDS domain of the process of a file's tests and of those that it starts; skips where there is no DDS.

    Each file has its own: who is killed in one would be there for its lease in the next.
    """
    from dds import dds_domain

    with dds_domain() as domain:
        yield domain


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a project with a short zig-zag and a short test motion, recorded and extracted; not to be written."""
    from simulated_project import record_short

    return made_once(tmp_path_factory, "recorded", lambda folder: record_short(folder / "project").folder)


@pytest.fixture(scope="session")
def moving_arm_logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with half a minute of RAVEN-II twice (run0, run1.npz), and loaded.npz with 0.2 kg at PLACE; not to be written."""
    from catenary.robots.catalog import load_robot
    from moving_arm import PLACE, recorded, write_npz

    def write(folder: Path) -> Path:
        arm = load_robot("raven2")
        models = {"run0": arm, "run1": arm, "loaded": arm.with_payload("wrist", 0.2, PLACE)}
        for seed, (name, model) in enumerate(models.items()):
            write_npz(recorded(model, seed, noise=0.1), folder / f"{name}.npz")
        return folder

    return made_once(tmp_path_factory, "moving_arm", write)


@pytest.fixture(scope="session")
def finished(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> "CalibrationResult":
    """What the recorded project came to when it was calibrated; its folder is not to be written."""
    from simulated_project import calibrate_short

    return made_once(
        tmp_path_factory, "finished", lambda folder: calibrate_short(Path(copytree(recorded, folder / "project")))
    )


@pytest.fixture
def finished_folder(finished: "CalibrationResult", tmp_path: Path) -> Path:
    """Copy of one's own of the finished project."""
    return Path(copytree(finished.page.parent, tmp_path / "project"))


@pytest.fixture
def project_folder(recorded: Path, tmp_path: Path) -> Path:
    """Copy of one's own of the recorded project."""
    return Path(copytree(recorded, tmp_path / "project"))
