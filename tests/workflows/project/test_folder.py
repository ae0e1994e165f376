import errno
import json
import os
import signal
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from catenary.errors import ConfigError, FileFormatError, InputError, InUseError
from catenary.files import json_text
from catenary.workflows.project.folder import LOCK, STEPS, FolderLock, Project, ProjectSettings, project_settings, write


class Work:
    """A step's work: writes a file, and counts."""

    def __init__(self, path: Path) -> None:
        self.path, self.times = path, 0

    def __call__(self) -> None:
        self.times += 1
        self.path.write_text("done")


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return Project(tmp_path, ProjectSettings())


@pytest.fixture
def work(project: Project, tmp_path: Path) -> Work:
    """The work of a step that was done with [1, (2.0, None)]."""
    work = Work(tmp_path / "file")
    assert project.run("step", MADE_FROM, [work.path], work)
    return work


MADE_FROM = [1, (2.0, None)]


def reopened(project: Project) -> Project:
    return Project(project.folder, project.settings)


def fail() -> None:
    raise OSError("unplugged")


def test_a_step_is_done_once_also_when_the_project_is_opened_again(project: Project, work: Work) -> None:
    for opened in (project, reopened(project)):
        assert not opened.run("step", MADE_FROM, [work.path], work)
    assert work.times == 1


def test_a_step_is_repeated_when_its_inputs_changed_or_a_file_is_gone(project: Project, work: Work) -> None:
    assert project.run("step", [2], [work.path], work)
    work.path.unlink()
    assert project.run("step", [2], [work.path], work)


def test_a_step_that_fails_is_not_done_but_those_before_it_are(project: Project, work: Work) -> None:
    with pytest.raises(OSError, match="unplugged"):
        project.run("second", [1], [work.path], fail)
    assert not reopened(project).run("step", MADE_FROM, [work.path], work)
    assert reopened(project).run("second", [1], [work.path], work)


def test_a_step_that_failed_with_other_inputs_is_not_the_one_before(project: Project, work: Work) -> None:
    with pytest.raises(OSError, match="unplugged"):
        project.run("step", [2], [work.path], fail)  # may have written half of its files over the others
    assert reopened(project).run("step", MADE_FROM, [work.path], work)


def test_settings_are_kept(tmp_path: Path) -> None:
    assert project_settings(tmp_path) is None
    settings = ProjectSettings(seed=3, side="right", base_tilt_deg=(5.0, -2.0), sparsities=(0.5, 0.25))
    Project(tmp_path, settings)
    assert project_settings(tmp_path) == settings


def test_a_project_begun_before_zigzags_ended_with_random_motion_goes_on_without(tmp_path: Path) -> None:
    Project(tmp_path, ProjectSettings(seed=3))
    path = tmp_path / "settings.json"
    kept = json.loads(path.read_bytes())
    del kept["random_seconds"]
    path.write_text(json_text(kept))
    assert project_settings(tmp_path) == ProjectSettings(seed=3, random_seconds=0.0)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"[" * 100_000,
        b"3",
        b"[1]",
        b'{"home": 3}',
        b'{"home": {}}',
        b"\xff\xfe",
        b'{"home": {"made_from": 3, "files": []}}',
        b'{"home": {"made_from": "a", "files": ["file"], "outputs": {"file": {"size": 4, "sha256": null}}}}',
    ],
)
def test_damaged_steps_are_refused(project: Project, content: bytes) -> None:
    (project.folder / STEPS).write_bytes(content)
    with pytest.raises(ConfigError, match=r"^/.*steps\.json: damaged.*; delete it, and .* does every step again$"):
        reopened(project)


SOUND = json_text(asdict(ProjectSettings())).encode()
UNEVEN = b'{"base_tilt_deg": 3, "sparsities": []}'


@pytest.mark.parametrize(
    "content",
    [
        b"{",
        b"[]",
        b"{}",
        UNEVEN,
        SOUND.replace(b"raven2", b"raven3"),
        b'{"color": "red"}',
        b"\xff",
        SOUND.replace(b"raven2", b'raven2", "robot": "x'),
        SOUND.replace(b'"raven2"', b"3"),
        SOUND.replace(b"0.0", b"1e999"),
        SOUND.replace(b"0.0", b"NaN"),
        SOUND.replace(b"20", b"9" * 5000),
    ],
)
def test_damaged_settings_are_refused(project: Project, content: bytes) -> None:
    (project.folder / "settings.json").write_bytes(content)
    with pytest.raises(ConfigError, match=r"settings\.json: damaged: .*; delete it, and give the settings again"):
        project_settings(project.folder)


def test_what_is_there_already_is_no_project(tmp_path: Path) -> None:
    thesis = tmp_path / "thesis.tex"
    thesis.write_text("")
    for folder, words in ((tmp_path, "is neither empty nor a project"), (thesis, "is a file, expected a folder")):
        with pytest.raises(FileFormatError, match=words):
            Project(folder, ProjectSettings())
    assert list(tmp_path.iterdir()) == [thesis]


def state_of(folder: Path) -> dict[str, tuple[int, int, int]]:
    """Return inode, time and size of everything in a folder, and of the folder."""
    paths = [folder, *folder.rglob("*")]
    return {str(p): (s.st_ino, s.st_mtime_ns, s.st_size) for p in paths for s in [p.stat()]}


def test_nothing_is_written_where_nothing_changed(project: Project, work: Work) -> None:
    before = state_of(project.folder)
    opened = reopened(project)
    assert not opened.run("step", MADE_FROM, [work.path], work)
    write(project.folder / STEPS, json.loads((project.folder / STEPS).read_text()))
    assert state_of(project.folder) == before


@pytest.mark.parametrize("content", [b"", b"don", b"dona"], ids=["emptied", "torn", "changed"])
def test_a_step_whose_file_does_not_hold_what_it_wrote_is_done_again(
    project: Project, work: Work, content: bytes
) -> None:
    work.path.write_bytes(content)
    os.utime(work.path, ns=(0, 0))  # the disk's clock is coarser than a test is long
    assert reopened(project).run("step", MADE_FROM, [work.path], work)


def test_a_step_whose_files_were_copied_elsewhere_is_done(project: Project, work: Work) -> None:
    os.utime(work.path, ns=(0, 0))
    assert not reopened(project).run("step", MADE_FROM, [work.path], work)


def test_a_folder_holds_what_it_held_when_its_files_are_the_same(project: Project, tmp_path: Path) -> None:
    folder, times = tmp_path / "folder", []

    def record() -> None:
        times.append(1)
        (folder / "deep").mkdir(parents=True, exist_ok=True)
        for name in ("a", "deep/b"):
            (folder / name).write_text(name)

    def run() -> bool:
        return reopened(project).run("folder", 1, [folder], record)

    assert run()
    assert not run()
    (folder / "deep" / "b").unlink()
    assert run()
    (folder / "c").write_text("not of this step")
    assert run()


@pytest.mark.parametrize("leave", [False, True], ids=["file", "empty folder"])
def test_a_step_with_nothing_there_at_its_end_is_not_done(project: Project, leave: bool) -> None:
    place = project.folder / "recording"

    def deleted_underneath() -> None:
        if leave:
            place.mkdir()

    with pytest.raises(FileFormatError, match=r"recording: not there, although step has just written it"):
        project.run("step", 1, [place], deleted_underneath)
    assert "step" not in json.loads(
        (project.folder / STEPS).read_text() if (project.folder / STEPS).is_file() else "{}"
    )


def test_a_second_writer_is_refused_and_does_not_run(project: Project, work: Work) -> None:
    second = reopened(project)

    def meanwhile() -> None:
        with pytest.raises(InUseError, match=r"has been writing in it since"):
            second.run("other", 1, [work.path], fail)
        with pytest.raises(InUseError):
            Project(project.folder, replace(project.settings, seed=5))
        assert not reopened(project).run("step", MADE_FROM, [work.path], fail)  # reading needs no lock
        (project.folder / "long").write_text("")

    assert project.run("long", 1, [project.folder / "long"], meanwhile)
    assert second.run("other", 1, [work.path], work)


def test_the_lock_is_kept_between_the_steps_of_one_command(project: Project, work: Work) -> None:
    with project:
        assert not project.run("step", MADE_FROM, [work.path], work)
        assert reopened(project).run("first", 1, [work.path], work)  # nothing was written yet
        project.run("second", 1, [work.path], work)
        with pytest.raises(InUseError):
            reopened(project).run("third", 1, [work.path], work)
    assert reopened(project).run("third", 1, [work.path], work)


def test_a_step_that_another_process_did_meanwhile_is_not_done_again_nor_forgotten(
    project: Project, work: Work
) -> None:
    second = reopened(project)
    assert project.run("new", 1, [work.path], work)
    assert not second.run("new", 1, [work.path], fail)
    assert second.run("newer", 1, [work.path], work)
    assert not reopened(project).run("new", 1, [work.path], fail)


def test_settings_that_another_command_changed_meanwhile_stop_this_one(project: Project, work: Work) -> None:
    Project(project.folder, replace(project.settings, seed=5))
    with pytest.raises(InUseError, match="changed its settings meanwhile"):
        project.run("other", 1, [work.path], fail)


def test_what_a_killed_process_left_half_written_goes_away(project: Project, work: Work) -> None:
    (project.folder / ".0123456789abcdef.partial").write_text("half")
    project.run("other", 1, [work.path], work)
    assert not list(project.folder.glob(".*.partial"))


def test_a_project_killed_before_it_had_settings_can_be_begun(tmp_path: Path) -> None:
    for name in (".lock", ".0123456789abcdef.partial"):
        (tmp_path / name).write_text("")
    assert Project(tmp_path, ProjectSettings()).folder == tmp_path


def test_a_project_without_settings_can_be_given_them_again(project: Project, work: Work) -> None:
    (project.folder / "settings.json").unlink()
    assert not reopened(project).run("step", MADE_FROM, [work.path], work)


def test_what_is_refused_before_anything_is_there_leaves_no_folder(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "project"

    def begin() -> None:
        with Project(folder, ProjectSettings()) as begun:
            (folder / "models").mkdir()
            begun.run("fit", 1, [folder / "m.npz"], refused)

    with pytest.raises(InputError):
        begin()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("what", ["file", "step", "project", "folder"])
def test_what_was_there_before_a_refusal_stays(what: str, tmp_path: Path) -> None:
    folder = tmp_path / "project"
    if what == "folder":
        folder.mkdir()
    if what == "project":
        Project(folder, ProjectSettings())

    def begin() -> None:
        with Project(folder, ProjectSettings()) as begun:
            if what == "step":
                begun.run("home", 1, [], lambda: None)
            if what == "file":
                (folder / "journal").write_bytes(b"recorded")
            begun.run("fit", 1, [folder / "m.npz"], refused)

    with pytest.raises(InputError):
        begin()
    stay = {"file": {"settings.json", "journal"}, "step": {"settings.json", "steps.json"}, "project": {"settings.json"}}
    assert {path.name for path in folder.iterdir()} - {".lock"} == stay.get(what, set())


def test_a_fault_of_ours_or_ctrl_c_takes_nothing_away(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), Project(tmp_path / "project", ProjectSettings()):
        raise KeyboardInterrupt
    assert (tmp_path / "project" / "settings.json").is_file()


def refused() -> None:
    raise InputError("not these recordings")


HOLDS = """
import sys, time
from pathlib import Path
sys.argv = ["catenary", "calibrate", "my project"]
from catenary.workflows.project.folder import FolderLock
FolderLock(Path(sys.orig_argv[-1])).take()
print("held", flush=True)
time.sleep(60)
"""


def taken(folder: Path) -> FolderLock:
    lock = FolderLock(folder)
    lock.take()
    return lock


def test_the_second_one_is_told_who_holds_it_and_gets_it_when_the_first_is_killed(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", HOLDS, tmp_path], stdout=subprocess.PIPE, text=True) as other:
        try:
            assert other.stdout is not None
            assert other.stdout.readline() == "held\n"
            words = rf"catenary calibrate 'my project' \(process {other.pid} on .+\) has been writing in it since 20"
            with pytest.raises(InUseError, match=words):
                taken(tmp_path)
        finally:
            other.send_signal(signal.SIGKILL)
    assert f"process {other.pid} on" in (tmp_path / LOCK).read_text()  # it had no time to take its name off
    mine = taken(tmp_path)
    assert f"process {os.getpid()} on" in (tmp_path / LOCK).read_text()
    mine.release()


def test_it_is_free_once_released_and_its_file_then_names_nobody(tmp_path: Path) -> None:
    taken(tmp_path).release()
    assert (tmp_path / LOCK).read_bytes() == b""
    taken(tmp_path).release()


@pytest.mark.parametrize("text", [b"", b"catenary excite p (process 1 on lab) has been writing in it", b"\xff" * 100])
def test_what_a_killed_process_left_is_taken_over(tmp_path: Path, text: bytes) -> None:
    (tmp_path / LOCK).write_bytes(text)
    taken(tmp_path).release()


def test_a_file_system_without_locks_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", unknown)
    with pytest.raises(FileFormatError, match=r"\.lock: cannot be locked: No locks available$"):
        taken(tmp_path)


def test_a_lock_whose_file_was_replaced_is_noticed_before_anything_is_noted(tmp_path: Path) -> None:
    first = taken(tmp_path)
    first.check()
    (tmp_path / LOCK).unlink()
    second = taken(tmp_path)
    with pytest.raises(InUseError, match="was deleted or replaced"):
        first.check()
    second.check()
    first.release()
    second.release()


def test_a_planted_link_is_not_followed(tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_text("mine")
    (tmp_path / LOCK).symlink_to(precious)
    with pytest.raises(FileFormatError, match="cannot be locked"):
        taken(tmp_path)
    assert precious.read_text() == "mine"


def test_a_full_disk_names_the_locks_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")  # by a descriptor the system names no file

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(FileFormatError, match=rf"^{tmp_path / LOCK}: cannot be locked: No space left on device$"):
        taken(tmp_path)
    monkeypatch.undo()
    taken(tmp_path).release()
