"""macOS or Windows, as far as Linux can play them: what they lack is absent, and open files keep Windows' rules.

For a process of its own, before catenary is imported: `python -m other_system win32 FOLDER` runs COMMANDS there, and
writes outcomes.json. Other packages are imported first: they have wheels of their own for each system.
"""

import builtins
import contextlib
import errno
import io
import json
import os
import pkgutil
import shutil
import signal
import socket
import stat
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest.mock import patch

OTHERS = (
    "asyncio", "concurrent.futures", "multiprocessing.pool", "multiprocessing.shared_memory", "multiprocessing.popen_spawn_posix", "multiprocessing.resource_tracker", "joblib", "numba",
    "scipy.optimize", "scipy.stats", "scipy.signal", "scipy.spatial", "sklearn.gaussian_process", "sklearn.neural_network",
    "sklearn.linear_model", "pyarrow.parquet", "pyarrow.csv", "rosbags.highlevel", "pydantic", "typer", "rich.console",
    "matplotlib.pyplot", "jinja2", "serial", "serial.tools.list_ports", "clarabel", "mujoco", "tempfile", "webbrowser", "http.client",
)  # fmt: skip
MACOS_LACKS = {
    "os": "posix_fallocate sched_getaffinity sched_setaffinity sched_setscheduler sched_getscheduler sched_getparam",
    "select": "epoll",
    "time": "CLOCK_BOOTTIME",
}
WINDOWS_LACKS = {
    "modules": "fcntl termios tty pty resource pwd grp curses readline syslog",
    "os": f"{MACOS_LACKS['os']} O_NOFOLLOW O_CLOEXEC O_DIRECTORY O_NONBLOCK fork forkpty geteuid getuid getegid "
    "getgid uname pread pwrite fchmod mkfifo nice sysconf ttyname statvfs getloadavg getpgid killpg setsid openpty "
    "register_at_fork WNOHANG",
    "signal": "SIGHUP SIGTSTP SIGKILL SIGUSR1 SIGPIPE SIGALRM SIGCONT setitimer pthread_kill",
    "socket": "AF_UNIX MSG_DONTWAIT",
    "select": "epoll poll",
    "time": "CLOCK_BOOTTIME CLOCK_MONOTONIC CLOCK_REALTIME clock_gettime clock_gettime_ns tzset",
}
O_BINARY = 1 << 30
_OWN = f"{os.sep}src{os.sep}catenary{os.sep}"


def become(system: str) -> None:
    """Take away what the system lacks, and let catenary be imported as there."""
    for name in OTHERS:
        with contextlib.suppress(ImportError):
            import_module(name)
    from fcntl import LOCK_EX, LOCK_NB, flock  # before it is gone

    lacking = {"darwin": MACOS_LACKS, "win32": WINDOWS_LACKS}[system]
    if system == "win32":
        for name in lacking["modules"].split():
            sys.modules[name] = None  # type: ignore[assignment]
        sys.modules["msvcrt"] = _msvcrt(lambda file: flock(file, LOCK_EX | LOCK_NB))
        _keep_windows_rules()
    for module in (os, signal, socket, __import__("select"), time):
        for name in lacking.get(module.__name__, "").split():
            if hasattr(module, name):
                delattr(module, name)
    if system == "win32":  # multiprocessing has pipes of its own there
        socket.socketpair = partial(socket.socketpair, 1)  # type: ignore[assignment]
    with patch.object(sys, "platform", system):
        import catenary.operating_system  # noqa: F401


def _msvcrt(lock: Callable[[int], None]) -> Any:
    """Windows' own module, its locks of bytes [docs.python.org/3/library/msvcrt]."""

    def locking(file: int, mode: int, count: int) -> None:
        assert (mode, count, os.lseek(file, 0, os.SEEK_CUR) > 1 << 20) == (2, 1, True), "the text could not be read"
        try:
            lock(file)
        except BlockingIOError as error:
            raise PermissionError(errno.EACCES, "Permission denied") from error

    module = ModuleType("msvcrt")
    module.__dict__.update(locking=locking, LK_NBLCK=2)
    return module


def _keep_windows_rules() -> None:
    """No open file is moved, replaced or deleted; no folder is opened; only what is open for writing is synchronised."""
    plain = SimpleNamespace(open=os.open, fsync=os.fsync, text=io.open)
    os.O_BINARY = O_BINARY  # type: ignore[attr-defined]
    shutil._use_fd_functions = False  # type: ignore[attr-defined]
    tempfile.TemporaryFile = tempfile.NamedTemporaryFile  # type: ignore[assignment]

    def opened(path: Any, flags: int, mode: int = 0o777, **options: Any) -> int:
        caller = sys._getframe(1).f_code.co_filename
        if os.path.isdir(path):
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        assert flags & O_BINARY or _OWN not in caller or path == os.devnull, f"{caller}: {path} would be opened as text"
        return plain.open(path, flags & ~O_BINARY, mode, **options)

    def synced(file: Any) -> None:
        number = file if isinstance(file, int) else file.fileno()
        flags = int(Path(f"/proc/self/fdinfo/{number}").read_text().split("flags:")[1].split()[0], 8)
        if flags & 3 == os.O_RDONLY:
            raise OSError(errno.EBADF, "Bad file descriptor")
        plain.fsync(number)

    def refuse_open(*paths: Any) -> None:
        for path in paths:
            with contextlib.suppress(FileNotFoundError):
                wanted = os.stat(path)
                for number in os.listdir("/proc/self/fd"):
                    with contextlib.suppress(OSError):
                        if stat.S_ISREG(wanted.st_mode) and os.path.samestat(wanted, os.fstat(int(number))):
                            raise AssertionError(f"{path}: is open, and would be moved, replaced or deleted")

    def closed_only(name: str, of_each: int) -> None:
        function = getattr(os, name)

        def checked(*paths: Any, **options: Any) -> None:
            refuse_open(*paths[:of_each])
            function(*paths, **options)

        setattr(os, name, checked)

    def text(file: Any, mode: str = "r", *rest: Any, **options: Any) -> Any:
        if "b" not in mode and "r" not in mode and len(rest) < 4:
            options.setdefault("newline", "\r\n")
            options["newline"] = options["newline"] if options["newline"] is not None else "\r\n"
        return plain.text(file, mode, *rest, **options)

    os.open, os.fsync = opened, synced  # type: ignore[assignment]
    for name, of_each in (("replace", 2), ("rename", 2), ("unlink", 1), ("remove", 1)):
        closed_only(name, of_each)
    builtins.open = io.open = text


# each command's main job, on files that tests/test_other_systems.py made
COMMANDS = {
    "robots": "robots",
    "gravity": "gravity arm.toml --q 0.1,0.1 --base-tilt-deg 0,20",
    "fk": "fk ur5e.urdf --q 0,-1,1,0,1,0",
    "ik": "ik raven2 --position-mm 19,-7.4,-67",
    "plot": "plot arm.toml --out arm.png",
    "regressor": "regressor arm.toml --compact",
    "export": "export arm.toml --c arm.h",
    "hold": "hold two_link --q 0.1,0.2 --seconds 0.5",
    "excitation": "excitation raven2 --velocity 1,1,0.1 --trials 2 --no-collision-check --out motion.csv",
    "identify": "identify run0.npz --robot two_link --out parameters.npz --test run1.npz --no-prior --friction none",
    "payload": "payload loaded.npz --model parameters.npz --at hand 0 0 0",
    "import": "import lab.csv --mapping lab.toml --out lab.parquet",
    "check": "check monday.npz",
    "fit": "fit monday.npz --model linear --out model.npz --report model.html",
    "evaluate": "evaluate model.npz tuesday.npz --report tuesday.html",
    "check model": "check model.npz",
    "plot model": "plot model.npz tuesday.npz --out model.pdf",
    "refresh": "refresh model.npz tuesday.npz --out today.npz",
    "drift": "drift model.npz monday.npz tuesday.npz --report drift.html",
    "export model": "export --model model.npz --c model.h",
    "demo": "demo --seed 1 --out demo",
    "demo again": "demo --seed 1 --out demo",
    "recover": "recover run.bag",
    "view": "view two_link --seconds 0.2 --no-open --port 18095",
}
# what is refused, in one sentence
REFUSED = {
    "serve": "serve --ros 2 --duration 1",
    "monitor on ROS": "monitor --ros 1",
    "project": "home refused --ros 1",
    "gravity-node": "gravity-node --ros none --port /dev/ttyACM0",
    "tool-node": "tool-node --ros 2 --tool tool.toml --weigh 6 --robot ur10e",
}


def not_imported() -> dict[str, str]:
    """Import every file of the package; return why some cannot be, by their names."""
    import catenary

    failed = {}
    for module in pkgutil.walk_packages(catenary.__path__, "catenary."):
        if module.name not in ("catenary.__main__", "catenary.raven2.data"):
            try:
                import_module(module.name)
            except Exception as error:
                failed[module.name] = f"{type(error).__name__}: {error}"
    return failed


def run(folder: Path) -> dict[str, Any]:
    """Run each command in a folder; return code, output and errors by its name."""
    import dataclasses

    from matplotlib.figure import Figure

    from catenary.workflows.project import calibrate
    from catenary.workflows.project import folder as projects
    from command_line import exit_code
    from simulated_project import QUICK_MODELS, SHORT

    class Terminal(io.TextIOWrapper):  # of Western Europe, as Windows has it
        def __init__(self) -> None:
            super().__init__(io.BytesIO(), encoding="cp1252", newline="\r\n", write_through=True)

        def told(self) -> str:
            return self.buffer.getvalue().decode("cp1252")  # type: ignore[attr-defined,no-any-return]

    def short(out: Path, settings: Any) -> Any:
        simulated = settings.connection == "simulation"
        return project(out, dataclasses.replace(SHORT, seed=settings.seed) if simulated else settings)

    project, draw = projects.Project, Figure.savefig
    outcomes: dict[str, Any] = {}
    os.chdir(folder)
    with (
        patch.object(calibrate, "models_for", lambda *_: QUICK_MODELS),
        patch.object(calibrate, "_DEPLOY_S", 2.0),
        patch.object(projects, "Project", short),
        patch.object(Figure, "savefig", autospec=True) as savefig,  # a picture takes a second
    ):
        for name, line in (COMMANDS | REFUSED).items():
            out, err = Terminal(), Terminal()
            savefig.side_effect = draw if name == "plot" else lambda _, file, **__: file.write(b"a picture")
            try:
                code = exit_code(line.split(), out, err)
            except BaseException:
                code = 99
                traceback.print_exc(file=err)
            outcomes[name] = [code, out.told(), err.told()]
    return outcomes


if __name__ == "__main__":
    become(sys.argv[1])
    found = {"not imported": not_imported(), **run(Path(sys.argv[2]))}
    Path("outcomes.json").write_text(json.dumps(found), encoding="utf-8")
