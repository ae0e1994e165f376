"""The command line from option dataclasses: how an option is declared, read and refused.

A command is a function. Its parameters are options of its own, and groups: frozen dataclasses of options that several
commands take. Both are declared alike, so that type, help and rules of an option stand in one place:

    @group
    class ArmOptions:
        seed: int | None = option("N", "Draw another robot.", least=0)
        base_tilt_deg: tuple[float, float] | None = option("R,P", "Roll, then pitch, of the base.")
        dialect: str = option(None, "With --ros: raven or crtk.", "raven", goes_with="ros")

The type says how a text is read: `bool` is a flag, `Sequence` may be repeated, a tuple of numbers or of names is a list
with commas, of as many as it has places or, with `...`, of one or more. A metavar such as raven|crtk lists the choices,
and one that begins with ROBOT lets a shell complete the names of the catalogue.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from inspect import Parameter, Signature, signature
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, TypeVar, dataclass_transform, get_args, get_origin

import typer

from catenary.cli.out_files import PAGE, FileKind, out_path, refuse_outputs
from catenary.cli.terminal import printing, without_notes
from catenary.crtk.network import BY_ROS2, said_ros_arguments, say_ros_arguments
from catenary.errors import InputError

Names = tuple[str, ...]
Numbers = tuple[float, ...]
Triple = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]
Read = Callable[[str], Any]
Group = TypeVar("Group")
Command = TypeVar("Command", bound=Callable[..., None])
REQUIRED: Any = ...  # the default of what must be given
_CHOICES = re.compile(r"[a-z0-9-]+(\|[a-z0-9-]+)+")
_METAVARS = {int: "N", float: "NUMBER", str: "NAME"}


@dataclass(frozen=True)
class Option:
    """An option or an argument: what help says of it, how its text is read, what it goes with."""

    metavar: str | None
    help: str
    default: Any = None
    flag: str | None = None  # such as --consistent/--free, where the parameter's name does not say it
    least: float | None = None
    most: float | None = None
    read: Read | None = None  # of a text that its type does not say how to read
    writes: FileKind | None = None  # the kind of the file that it names
    goes_with: str | Names = ()  # parameters, one of which must be given with it
    not_with: str | Names = ()  # parameters, none of which may be given with it
    is_argument: bool = False
    joins_ros: bool = False  # the command then takes --transport, --ros-distro, and what stands behind --ros-args
    name: str = ""  # of the parameter that it is declared for
    kind: Any = None  # the parameter's type

    def declared(self, name: str, kind: Any) -> "Option":
        """Return the option of a parameter."""
        default = () if self.default is None and get_origin(kind) is Sequence else self.default
        return replace(self, name=name, kind=kind, default=default)

    @property
    def typed(self) -> str:
        """Its name, as it is typed."""
        return str(self.metavar) if self.is_argument else self.flag or f"--{self.name.replace('_', '-')}"

    @property
    def choices(self) -> Names:
        """Its only values, as typed; none if there are many."""
        return tuple(self.metavar.split("|")) if self.metavar and _CHOICES.fullmatch(self.metavar) else ()

    @property
    def names_robot(self) -> bool:
        """Whether it may name a robot, of the catalogue or of a file."""
        return (self.metavar or "").lstrip("[").startswith("ROBOT")

    @property
    def is_repeatable(self) -> bool:
        """Whether it may be given several times."""
        return get_origin(self.kind) is Sequence

    def parameter(self) -> Parameter:
        """Return the parameter that typer makes its option from."""
        kind, default = self.kind, self.default
        rest = [one for one in get_args(kind) if one is not NoneType]  # of what need not be given
        if NoneType in get_args(kind) and len(rest) == 1:
            (kind,) = rest
        if self.is_repeatable:
            (kind,), default = rest, REQUIRED if default is REQUIRED else None
        elif isinstance(default, tuple):
            default = ",".join(f"{one:g}" if isinstance(one, float) else one for one in default)
        metavar = self.metavar or _METAVARS.get(kind)
        read = self.read or (_reader(kind) if self.writes is None else out_path)
        if read is not None:
            kind = str
        settings: dict[str, Any] = {
            "metavar": metavar, "help": self.help, "parser": read,
            "min": self.least, "max": self.most, "autocompletion": robots_beginning if self.names_robot else None,
        }  # fmt: skip
        made = typer.Argument(**settings) if self.is_argument else typer.Option(self.typed, **settings)
        whole = list[kind] if self.is_repeatable else kind  # type: ignore[valid-type]
        return Parameter(
            self.name,
            Parameter.KEYWORD_ONLY,
            default=Parameter.empty if default is REQUIRED else default,
            annotation=Annotated[whole if default is REQUIRED else whole | None, made],
        )


def option(metavar: str | None, help: str, default: Any = None, **settings: Any) -> Any:
    """Declare an option; `settings` as of Option."""
    return Option(metavar, help, default, **settings)


def argument(metavar: str, help: str, default: Any = REQUIRED, **settings: Any) -> Any:
    """Declare what is typed without a name; `settings` as of Option."""
    return Option(metavar, help, default, is_argument=True, **settings)


@dataclass_transform(frozen_default=True)
def group(cls: type[Group]) -> type[Group]:
    """Make a frozen dataclass of options that several commands take."""
    for name, kind in cls.__annotations__.items():
        declared = cls.__dict__.get(name)
        if isinstance(declared, Option):
            made = declared.declared(name, kind)
            setattr(cls, name, field(default=made.default, metadata={"option": made}))
    return dataclass(frozen=True)(cls)


def as_typed(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command as typer takes it: with the options of its groups in place of the groups.

    Help lists a command's own options, then those of its groups, then --json and --latex, of what is on ROS --transport
    and --ros-distro, then --no-notes. Before the command runs, options that would have no effect are refused.
    """
    own = signature(command).parameters.values()
    groups: dict[str, Any] = {p.name: p.annotation for p in own if is_dataclass(p.annotation)}
    asked: list[Option] = [p.default.declared(p.name, p.annotation) for p in own if p.name not in groups]
    asked += [field.metadata["option"] for kind in groups.values() for field in fields(kind)]
    as_json = option(None, getattr(command, "json_help", "Print JSON."), False, flag="--json")
    asked.append(as_json.declared("as_json", bool))
    if getattr(command, "prints_tables", False):
        asked.append(_LATEX.declared("as_latex", bool))
    if any(one.joins_ros for one in asked):
        asked += [_TRANSPORT.declared("transport", str), _ROS_DISTRO.declared("ros_distro", str)]

    def run(*, no_notes: bool, **given: Any) -> None:
        values: dict[str, Any] = {
            one.name: tuple(given[one.name] or ()) if one.is_repeatable else given[one.name] for one in asked
        }
        _refuse_wrong(asked, values)
        _refuse_files(asked, values)
        if "ros_distro" in values:
            chosen = {"distro": values["ros_distro"], "transport": values["transport"]}
            say_ros_arguments(replace(said_ros_arguments(), **chosen))
        for name, kind in groups.items():
            values[name] = kind(**{field.name: values.pop(field.name) for field in fields(kind)})
        with without_notes(no_notes), printing(next((f for f in ("json", "latex") if values.get(f"as_{f}")), "text")):
            command(**{p.name: values[p.name] for p in own})

    parameters = [one.parameter() for one in (*asked, _NO_NOTES.declared("no_notes", bool))]
    run.__doc__ = re.sub(r"\n+(?= *Example:)", "\n\n", command.__doc__ or "")  # each on lines of its own
    run.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in parameters}
    return run


def json_help(help: str) -> Callable[[Command], Command]:
    """Say in a command's help what its --json prints, where that is not one result at the end."""

    def with_help(command: Command) -> Command:
        command.json_help = help  # type: ignore[attr-defined]
        return command

    return with_help


def prints_tables(command: Command) -> Command:
    """Give a command --latex."""
    command.prints_tables = True  # type: ignore[attr-defined]
    return command


def _refuse_wrong(asked: Sequence[Option], values: Mapping[str, Any]) -> None:
    known = {one.name: one.typed for one in asked}
    given = [one for one in asked if values[one.name] != one.default]
    names = {one.name for one in given}
    for one in given:
        choices, value = one.choices, values[one.name]
        if choices and str(value) not in choices:
            *others, last = choices
            raise InputError(f"{one.typed} {value}: expected {', '.join(others)} or {last}")
        needed = [name for name in _names(one.goes_with) if name in known]
        if needed and not names.intersection(needed):
            raise InputError(f"{one.typed}: goes with {' or '.join(known[name] for name in needed)}")
        for name in _names(one.not_with):
            if name in names:
                raise InputError(f"{one.typed}: does not go with {known[name]}")


def _refuse_files(asked: Sequence[Option], values: Mapping[str, Any]) -> None:
    written, read = {}, list[Path]()
    for one in asked:
        value = values[one.name]
        if one.writes is not None and value is not None:
            written[one.typed] = value, one.writes
        elif one.writes is None:
            named = value if isinstance(value, tuple) else (value,)
            read += [Path(path) for path in named if isinstance(path, Path) or (path and one.names_robot)]
    refuse_outputs(written, read)


def values_of(options: Any, *names: str) -> dict[str, Any]:
    """Return some of a group's options by their names, for what takes them under these."""
    return {name: getattr(options, name) for name in names}


def require_one(**given: Any) -> None:
    """Refuse none, and more than one, of what must be given; by their parameters' names."""
    if sum(value not in (None, False) for value in given.values()) != 1:
        *others, last = (f"--{name.replace('_', '-')}" for name in given)
        raise InputError(f"give one of {', '.join(others)} and {last}")


def numbers(text: str, count: int | None = None) -> Numbers:
    """Read numbers separated by commas or spaces, as many as `count` says."""
    from catenary.bounded_parsers import plain_number

    values = []
    for word in text.replace(",", " ").split():
        try:
            values.append(plain_number(word))
        except ValueError:
            raise typer.BadParameter(f"expected numbers separated by commas, got {word!r} in {text!r}") from None
    if not values or len(values) != (count or len(values)):
        expected = f"{count} numbers" if count else "numbers"
        raise typer.BadParameter(f"expected {expected} separated by commas, got {text!r}")
    return tuple(values)


def words(text: str) -> Names:
    """Read words separated by commas."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def robots_beginning(incomplete: str) -> list[str]:
    """Return names in the catalogue that begin with what was typed: a shell completes them, and files by itself."""
    from catenary.robots.catalog import robot_names

    return [name for name in robot_names() if name.startswith(incomplete)]


def _names(names: str | Names) -> Names:
    return (names,) if isinstance(names, str) else names


def _reader(kind: Any) -> Read | None:
    """Return the parser of a list with commas; None for types that typer reads by itself."""
    places = get_args(kind) if get_origin(kind) is tuple else ()
    if len(set(places) - {Ellipsis}) != 1:
        return None
    if places[0] is str:
        return words
    count = None if Ellipsis in places else len(places)
    return lambda text: numbers(text, count)


_LATEX = option(None, "Print tables for LaTeX with booktabs, nothing else.", False, flag="--latex", not_with="as_json")
_ON_ROS = ("ros", "project")  # whose settings may say where its robot is
_TRANSPORT = option(
    "|".join(BY_ROS2), f"{'; '.join(map(str, BY_ROS2.values()))}. [default: the first available]", goes_with=_ON_ROS
)
_ROS_DISTRO = option(
    "NAME", "On ROS 2: distribution of the other programs. [default: ROS_DISTRO, or jazzy]", goes_with=_ON_ROS
)
_NO_NOTES = option(None, "Print no notes: results and errors only.", False)
REPORT = option("HTML", "Also write a self-contained page, e.g. arm.html.", writes=PAGE)
