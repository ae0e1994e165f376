"""Disks that are full, or fail, while something is written: a CatenaryError names the file and the reason, what was
there before stays whole, nothing half written is taken for something, and with room again the same call goes on.
"""

import contextlib
import errno
import functools
import hashlib
import os
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


@contextlib.contextmanager
def failing(call: str, number: int, after: int) -> Iterator[None]:
    """`os.write` or `os.fsync` fails with an error from its `after`-th call on."""
    real, left = getattr(os, call), after

    def fail(*arguments: object) -> object:
        nonlocal left
        left -= 1
        if left < 0:
            raise OSError(number, os.strerror(number))
        return real(*arguments)

    setattr(os, call, fail)
    try:
        yield
    finally:
        setattr(os, call, real)


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


def recorder(seed: int, folder: Path) -> None:
    """Fill the disk while a journal is written, by its limit or by errors of write and fsync."""
    from catenary.errors import RecordingError
    from catenary.recording.journal import JournalTopic, JournalWriter
    from catenary.recording.journal_reader import JournalReader

    rng = random.Random(seed)
    messages = [rng.randbytes(rng.randrange(400)) for _ in range(500)]
    fault = (
        files_of_at_most(rng.randrange(8000, 60_000))
        if seed % 3 == 0
        else failing(("write", "fsync")[seed % 3 - 1], rng.choice([errno.ENOSPC, errno.EIO]), rng.randrange(2, 12))
    )
    said = ""
    with fault:
        try:
            journal = JournalWriter(folder / "r", [JournalTopic("/a", "std_msgs/String")], flush_interval=60.0)
            for i, message in enumerate(messages):
                journal.append("/a", i, message)
                if rng.random() < 0.05:
                    journal.flush()
            journal.close()
        except RecordingError as error:
            said = str(error)
    if not said:
        return
    if not any(reason in said for reason in REASONS) or str(folder) not in said:
        raise Fell(f"neither file nor reason in: {said}")
    safe = int(said.split("Safe are the first ")[1].split(" ")[0])
    try:
        found = [data for _, _, data in JournalReader(folder / "r").messages()]
    except Exception:
        if safe:
            raise
        return
    if found[:safe] != messages[:safe] or len(found) < safe:
        raise Fell(f"{safe} were said to be safe, {len(found)} are there")


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
    """Fill the disk in any step from a recording to a page: extraction, bags, table, fit, evaluation, report."""
    import shutil
    import warnings

    from catenary.calibration.fit_options import FitOptions, FitRun
    from catenary.recording.import_formats.raven_recordings import write_raven_csv
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
        calibrate.fit_models(opened(), logs()[0], models, FitRun(robot="raven2", folds=0), lambda _: lambda _: None)

    def conclude() -> None:
        calibrate.conclude(opened(), models, *logs(), None)

    table = folder / "p" / "train.csv"
    steps: list[tuple[str, Callable[[], object]]] = [
        ("extract train", lambda: extract_recording(opened(), "train")),
        ("extract test", lambda: extract_recording(opened(), "test")),
        ("bags", lambda: write_bags(opened(), "train", ("ros1", "mcap")[seed % 2])),
        ("table", lambda: write_raven_csv(folder / "p" / "extracted" / "train", table)),
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
    if not all(path.is_file() for path in (table, folder / "p" / "report.html", *logs()[0], *logs()[1])):
        raise Fell("not all is there in the end")


PARTS = (
    Part("disks.recorder", 300, recorder),
    Part("disks.pipeline", 20, pipeline, warnings_fail=False, processor_time=60.0, memory=2 * 10**9),
)
