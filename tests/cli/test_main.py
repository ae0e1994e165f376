import ast
import os
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from typer.testing import CliRunner

from catenary import __version__
from catenary.cli import main as main_module
from catenary.cli.main import GROUPS, Commands, app
from catenary.terminal_text import ClosedOutput, VisibleStream
from command_line import catenary, in_its_own_process

COMMANDS = [name for names in GROUPS.values() for name in names]
HEAVY = ("numpy", "numba", "scipy", "sklearn", "matplotlib", "pydantic", "mujoco", "pyarrow", "rich.table")


def test_help_names_every_command_in_its_group_and_cuts_nothing() -> None:
    text = catenary("--help").out
    sections = dict(re.findall(r"^(\w+):\n((?:  .*\n?)+)", text, flags=re.MULTILINE))
    listed = {title: re.findall(r"^  ([\w-]+)  ", sections[title], flags=re.MULTILINE) for title in GROUPS}
    assert listed == {title: list(names) for title, names in GROUPS.items()}
    assert "..." not in text.split("Calibrate:")[1]


def test_the_page_of_commands_has_each_in_its_group() -> None:
    page = (Path(__file__).parents[2] / "docs" / "commands.md").read_text()
    sections = dict(re.findall(r"^## (\w+)\n(.*?)(?=^## )", page, flags=re.MULTILINE | re.DOTALL))
    listed = {title: set(re.findall(r"`catenary ([\w-]+)", sections[title])) for title in GROUPS}
    assert {title: set(names) - listed[title] for title, names in GROUPS.items()} == {title: set() for title in GROUPS}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_in_80_columns_and_json(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    outcome = catenary(command, "--help")
    assert outcome.code == 0
    assert "--json" in outcome.out
    assert "Usage: catenary" in outcome.out
    assert max(len(line) for line in outcome.out.split("\n")) <= 80
    assert "-h, --help" in outcome.out
    assert re.findall(r"<\w+", outcome.out) == []  # one style: FILE, N, NAME
    assert len(re.findall(r"^  Example: ", outcome.out, re.MULTILINE)) == outcome.out.count("Example:")
    assert catenary(command, "-h") == outcome


def options_of(command: str) -> set[str]:
    asked = Commands()[command].params
    return {"--help", *(name for option in asked for name in (*option.opts, *option.secondary_opts))}


def named_options(text: str) -> set[str]:
    """Options that a text names, but for those of a command that it names with them."""
    return set(re.findall(r"(?<![\w-])--[a-z][a-z-]*[a-z]", re.sub(r"catenary [a-z-]+ [^`;,.]*", "", text)))


@pytest.mark.alike
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_has_every_option_that_its_help_and_its_own_messages_name(command: str) -> None:
    asked = Commands()[command]
    said = [asked.help or "", *(getattr(option, "help", None) or "" for option in asked.params)]
    module = import_module(f"catenary.cli.{next(m[command] for m in GROUPS.values() if command in m)}")
    for node in ast.parse(Path(str(module.__file__)).read_text()).body:
        if isinstance(node, ast.FunctionDef) and node.name == command.replace("-", "_"):
            said += [str(n.value) for s in node.body for n in ast.walk(s) if isinstance(n, ast.Constant)]
    assert {text: new for text in said if (new := named_options(text) - options_of(command))} == {}


def test_every_option_that_a_message_names_is_one_of_some_command() -> None:
    of_others = {"--ros-args", "--remap", "--disable-external-lib-logs", "--csv"}  # ROS's, and ros2 topic echo's
    known = set().union(*map(options_of, COMMANDS)) | of_others | {"--version", "--show-completion"}
    wrong = {}
    sources = [path for path in sorted((Path(__file__).parents[2] / "src").rglob("*.py")) if "--" in path.read_text()]
    for path in sources:
        texts = [n.value for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Constant)]
        found = set().union(*(named_options(text) for text in texts if isinstance(text, str))) - known
        wrong |= {path.name: found} if found else {}
    assert wrong == {}


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
    assert "[default: by the model's kind]" in text
    assert "[default: q, and tau if recorded]" in text
    assert "[default: its tip]" in catenary("fk", "--help").out


def test_version_is_printed() -> None:
    assert catenary("--version").out == f"catenary {__version__}\n"


def modules_of(*commands: tuple[str, ...]) -> set[str]:
    """What commands, run one after the other in one process, have imported by their end."""
    code = f"""
import contextlib, os, sys
from catenary.cli.main import main
for arguments in {commands!r}:
    sys.argv = ["catenary", *arguments]
    with open(os.devnull, "w") as nowhere, contextlib.suppress(SystemExit):
        with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
            main()
print(*sys.modules)
"""
    return set(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split())


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
        [sys.executable, "-m", "catenary", *arguments],
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        **settings,  # type: ignore[call-overload]
    )


def test_a_full_disk_is_a_message() -> None:
    with open("/dev/full", "wb") as full:
        outcome = run("robots", stdout=full)
    assert (outcome.returncode, outcome.stderr) == (2, b"catenary: standard output: No space left on device\n")


def test_a_reader_that_goes_away_is_no_traceback() -> None:
    line = f"set -o pipefail; {sys.executable} -m catenary robots --json | head -c 1"
    outcome = subprocess.run(["bash", "-c", line], capture_output=True, check=True)
    assert outcome.stderr == b""
    read, write = os.pipe()
    os.close(read)
    stream = VisibleStream(os.fdopen(write, "w"))
    stream.write("a")
    with pytest.raises(ClosedOutput):
        stream.flush()


def test_a_connection_that_ends_is_not_taken_for_a_reader_that_goes_away(monkeypatch: pytest.MonkeyPatch) -> None:
    def lost() -> None:
        raise BrokenPipeError

    monkeypatch.setattr("catenary.robots.catalog.robot_names", lost)
    outcome = catenary("robots")
    assert (outcome.code, outcome.err) == (2, "catenary: a connection was closed from the other side\n")


LOCALES = (
    {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    {"LC_ALL": "POSIX", "PYTHONIOENCODING": "ascii"},
)


@pytest.mark.parametrize(
    ("command", "locale"),
    list(zip(["--help", "check run.csv", "import run.csv", "regressor two_link"], 2 * LOCALES, strict=True)),
)
def test_a_locale_of_ascii_keeps_no_command_from_its_work(monkeypatch, tmp_path, command, locale) -> None:
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"{k / 30:.3f},{k % 90},{k % 90 + 0.1}\n" for k in range(300))
    Path("run.csv").write_text(f"time [s],J1 [°],J1 encoder [°]\n{rows}", encoding="utf-8")
    for name, value in locale.items():
        monkeypatch.setenv(name, value)
    said, usual = in_its_own_process(*command.split()), catenary(*command.split())
    assert said.code == usual.code
    assert "codec" not in said.err
    assert len(said.out) >= len(usual.out)  # characters that it lacks are written out


def test_a_fault_of_decoding_is_no_name_that_cannot_be_written(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(**_: object) -> None:
        b"\xff".decode()

    monkeypatch.setattr(main_module, "app", fails)
    with pytest.raises(UnicodeDecodeError):
        catenary("robots")


def completed(*words: str) -> list[str]:
    """What completes the last of the words, as bash asks for it."""
    asked = {"COMP_WORDS": " ".join(["catenary", *words]), "COMP_CWORD": str(len(words))}
    environment = asked | {"_CATENARY_COMPLETE": "complete_bash"}
    return CliRunner().invoke(app, [], prog_name="catenary", env=environment).output.split()


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("mon",), ["monitor"]),
        (("fit", "--held"), ["--held-out"]),
        (("fk", "raven2_f"), ["raven2_full", "raven2_full_right"]),
        (("goto", "--robot", "two"), ["two_link"]),
        (("check", "no_robot_is_called_so"), []),  # bash then completes files
    ],
)
def test_commands_options_and_robots_complete(words: tuple[str, ...], found: list[str]) -> None:
    assert completed(*words) == found
