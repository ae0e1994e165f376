"""Disks that are full while something is written: a CatenaryError names the file and the reason, what was
there before stays whole, nothing half written is taken for something, and with room again the same call goes on.
"""

import contextlib
import functools
import hashlib
import random
import resource
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.campaign.part import Fell, Part

REASONS = ("File too large", "No space left on device", "Input/output error")


@contextlib.contextmanager
def files_of_at_most(size: int) -> Iterator[None]:
    """No file of this process grows beyond; Python ignores the signal, so that writing is an error."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def hashes(folder: Path) -> dict[str, str]:
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != ".lock")
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def try_as_promised(call: Callable[[], object], where: str) -> None:
    """Call; where that fails, it says what and where."""
    from catenary.errors import CatenaryError

    try:
        call()
    except CatenaryError as error:
        if not any(reason in str(error) for reason in REASONS):
            raise Fell(f"{where}: no reason in: {error}") from error
        if "/" not in str(error):
            raise Fell(f"{where}: no file in: {error}") from error


@functools.cache
def recorded() -> Path:
    """A project with a recording, and what all of its outputs are."""
    from catenary.workflows.project.folder import Project, ProjectSettings
    from oracles.raven_recording import record

    folder = Path(tempfile.mkdtemp(prefix="campaign-disks-"))
    project = Project(folder / "p", ProjectSettings())
    for name in ("train", "test"):
        place = project.folder / "recordings" / name
        project.run(f"record {name}", {"name": name}, [place], functools.partial(_record, record, place))
    return project.folder


def _record(record: Callable[[Path, float], Path], place: Path) -> None:
    record(place, 6.0)


def pipeline(seed: int, folder: Path) -> None:
    """Fill the disk in any step from a recording to a page: extraction, bags, fit, evaluation, report."""
    import shutil
    import warnings

    from catenary.calibration.fit_options import FitOptions, FitRun
    from catenary.recording.logs import Reading
    from catenary.workflows.project import calibrate
    from catenary.workflows.project.folder import Project, ProjectSettings
    from catenary.workflows.project.recordings import extract_recording, motion_log_path, write_bags

    warnings.simplefilter("ignore", UserWarning)  # of matplotlib, about fonts
    rng = random.Random(seed)
    shutil.copytree(recorded(), folder / "p")
    models = {
        name: FitOptions(kind="linear", inputs=("q:shoulder", "q:elbow", "q:insertion"))
        for name in ("linear", calibrate.RECOMMENDED)
    }

    def opened() -> Project:
        return Project(folder / "p", ProjectSettings())

    def logs() -> tuple[list[Path], list[Path]]:
        return [motion_log_path(opened(), "train")], [motion_log_path(opened(), "test")]

    def fit() -> None:
        calibrate.fit_models(
            opened(), logs()[0], models, FitRun(robot="raven2", folds=0), lambda _: lambda _: None, Reading()
        )

    def conclude() -> None:
        calibrate.conclude(opened(), models, *logs(), None, Reading(), FitRun())

    steps: list[tuple[str, Callable[[], object]]] = [
        ("extract train", lambda: extract_recording(opened(), "train")),
        ("extract test", lambda: extract_recording(opened(), "test")),
        ("bags", lambda: write_bags(opened(), "train", ("ros1", "mcap")[seed % 2])),
        ("fit", fit),
        ("conclude", conclude),
    ]
    hit = seed % len(steps)
    for number, (name, step) in enumerate(steps):
        if number == hit:
            before = hashes(folder / "p")
            with files_of_at_most(int(2.0 ** rng.uniform(5.0, 20.0))):
                try_as_promised(step, name)
            after = hashes(folder / "p")
            others = {path for path in before if path != "steps.json"}
            if lost := sorted(path for path in others if after.get(path) != before[path]):
                raise Fell(f"{name}: {', '.join(lost)} are not what they were")
        step()
    if not all(path.is_file() for path in (folder / "p" / "report.html", *logs()[0], *logs()[1])):
        raise Fell("not all is there in the end")


PARTS = (Part("disks.pipeline", 20, pipeline, warnings_fail=False, processor_time=60.0, memory=2 * 10**9),)
