import subprocess
import sys

import pytest

from catenary import __version__
from catenary.cli.commands import Commands
from command_line import catenary

COMMANDS = [
    "calibrate", "home", "excite", "record", "extract", "import", "fit", "evaluate", "refresh", "drift", "deploy", "goto", "random", "follow", "teleop",
    "monitor", "gravity", "track", "hold", "export", "recover", "serve", "button", "identify", "excitation", "payload", "check",
    "fk", "ik", "plot", "regressor", "sense", "encoders", "gravity-node", "robots", "view", "demo",
]  # fmt: skip
HEAVY = ("numpy", "numba", "scipy", "sklearn", "matplotlib", "pydantic", "mujoco", "pyarrow", "rich.table")


def modules_after(code: str) -> set[str]:
    listing = "import sys; print('\\n' + '\\n'.join(sys.modules))"
    command = [sys.executable, "-c", f"{code}\n{listing}"]
    return set(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split("\n"))


def test_help_names_every_command() -> None:
    text = catenary("--help").out
    listed = [line.split()[0] for line in text.split("Commands:")[1].split("\n") if line[2:3].strip()]
    assert sorted(listed) == sorted(COMMANDS)
    assert "..." not in text.split("Commands:")[1]  # nothing is cut


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_in_80_columns_and_json(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    outcome = catenary(command, "--help")
    assert outcome.code == 0
    assert "--json" in outcome.out
    assert "Usage: catenary" in outcome.out
    assert max(len(line) for line in outcome.out.split("\n")) <= 80
    assert "-h, --help" in outcome.out
    assert catenary(command, "-h") == outcome


@pytest.mark.parametrize("command", COMMANDS)
def test_a_default_is_read_as_what_is_typed(command: str) -> None:
    asked = Commands()[command]
    context = asked.make_context(command, [], resilient_parsing=True)
    for option in asked.params:
        default = option.get_default(context)
        if default is not None:
            option.process_value(context, default)


def test_help_shows_defaults_that_are_settled_later() -> None:
    text = " ".join(catenary("fit", "--help").out.split())
    assert "[default: best]" in text
    assert "[default: q, and tau if recorded]" in text
    assert "[default: its tip]" in catenary("fk", "--help").out


def test_version_is_printed() -> None:
    assert catenary("--version").out == f"catenary {__version__}\n"


def modules_of(*commands: tuple[str, ...]) -> set[str]:
    """What commands, run one after the other in one process, have imported by their end."""
    return modules_after(f"""
import contextlib, os, sys
from catenary.cli.main import main
for arguments in {commands!r}:
    sys.argv = ["catenary", *arguments]
    with open(os.devnull, "w") as nowhere, contextlib.suppress(SystemExit):
        with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
            main()
""")


def test_help_imports_nothing_heavy() -> None:
    assert not modules_of((), ("--help",), *((name, "--help") for name in COMMANDS)) & set(HEAVY)


def test_help_of_a_command_imports_no_other_command() -> None:
    others = {f"catenary.cli.{name}" for name in ("calibrate", "gravity", "monitor", "teleop", "identify")}
    assert not modules_of(("goto", "--help")) & others


def test_ctrl_c_is_told_with_what_was_noted_on_its_way(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted() -> None:
        error = KeyboardInterrupt()
        error.add_note("the robot was homing; it was disabled")
        raise error

    monkeypatch.setattr("catenary.robots.catalog.robot_names", interrupted)
    outcome = catenary("robots")
    assert outcome.code == 130
    assert outcome.err == "catenary: interrupted; the robot was homing; it was disabled\n"


def run(*arguments: str, **settings: object) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [sys.executable, "-m", "catenary.cli.main", *arguments],
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        **settings,  # type: ignore[call-overload]
    )


def test_a_full_disk_is_a_message() -> None:
    with open("/dev/full", "wb") as full:
        outcome = run("robots", stdout=full)
    assert (outcome.returncode, outcome.stderr) == (2, b"catenary: standard output: No space left on device\n")


def test_a_reader_that_goes_away_is_no_traceback() -> None:
    line = f"{sys.executable} -m catenary.cli.main robots --json | head -c 1"
    outcome = subprocess.run(["bash", "-c", line], capture_output=True, check=True)
    assert outcome.stderr == b""
