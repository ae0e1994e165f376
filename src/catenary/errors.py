"""Every error that catenary raises on purpose.

A message says what is wrong, where, what was got, what was expected and, where there are any, the choices.
"""

import re
import shlex
from collections.abc import Sequence
from importlib import import_module, metadata
from typing import Any


class CatenaryError(Exception):
    """Root of all errors that a user can act on.

    Examples:
        >>> try:
        ...     catenary.load_robot("raven3")
        ... except catenary.CatenaryError as error:
        ...     print(type(error).__name__)
        FileFormatError
    """


class InputError(CatenaryError, ValueError):
    """An argument has the wrong shape, unit, range, or holds NaN or infinity."""


class DataError(InputError):
    """A recording is refused before a fit: its numbers contradict what is said of them.

    Attributes:
        names: Of the findings that refuse it, as `accept` takes them.

    Examples:
        >>> q = np.random.default_rng(0).uniform(-1.0, 1.0, (500, 1)).cumsum(axis=0) / 10.0
        >>> try:
        ...     catenary.fit(q, np.rad2deg(q), units=["rad"])
        ... except catenary.DataError as error:
        ...     print(error.names)
        ('copied', 'units')
    """

    def __init__(self, message: str, names: Sequence[str]) -> None:
        self.names = tuple(names)
        super().__init__(message)


class FileFormatError(CatenaryError, ValueError):
    """A file is missing, damaged, of another kind, or lacks something that it must hold."""


class ConfigError(FileFormatError):
    """A TOML file has an unknown key, a wrong type, or a number without its unit."""


class UnsupportedModelError(CatenaryError, ValueError):
    """A robot description holds something that a tree of one-coordinate joints cannot represent."""


class ClosedLoopError(UnsupportedModelError):
    """A robot's loops are no tree's: its joints follow the motors otherwise than linearly."""


class MissingInertiaError(CatenaryError, ValueError):
    """A torque or mass was asked of a model that lacks the inertia for it, of the links named in `links`."""

    def __init__(self, model_name: str, links: Sequence[str], *, only_tensor: bool = False) -> None:
        self.links = tuple(links)
        names = ", ".join(f'"{link}"' for link in links)
        of_tensor = (
            f"link(s) {names} have a mass but no inertia that a body can have; gravity torques are right without, a "
            "mass matrix or a torque of motion is not. Give their inertia about the centre of mass"
        )
        of_all = (
            f"no inertia for link(s) {names}; a gravity torque or a mass matrix would silently leave them out. Give "
            "them mass, centre of mass and inertia, or name them as massless (--massless LINK,... or all) if they have "
            "none"
        )
        super().__init__(f'robot "{model_name}": {of_tensor if only_tensor else of_all}')


class MissingPackageError(CatenaryError, ImportError):
    """An optional package is needed for this and is not installed; the message says how to install it."""


class ImplausibleWarning(UserWarning):
    """Numbers are taken as they are and are hardly what was meant: gravity that points up, insertion of 400 m."""


def to_import(path: object) -> str:
    """Return the message about a recording of unknown layout."""
    return f"`{shlex.join(['catenary', 'import', str(path)])}` proposes how to read others"


def to_install(extra: str) -> str:
    """Return the command that installs the packages of an extra, wherever this package itself came from."""
    try:
        every = metadata.requires("catenary") or []
    except metadata.PackageNotFoundError:  # its files alone
        every = []
    needs = [one.partition(";")[0].strip() for one in every if re.search(rf"extra == .{extra}.$", one)]
    return f"pip install {shlex.join(needs)}" if needs else f"pip install -e '.[{extra}]' in a clone of the repository"


def imported(module: str, why: str, extra: str) -> Any:
    """Import a module of an optional package; MissingPackageError says how to install it.

    Args:
        module: Dotted name.
        why: What needs it, which opens the message.
        extra: Extra of catenary that installs it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingPackageError(f"{why}: {to_install(extra)}") from error


class UnsupportedSystemError(CatenaryError):
    """This operating system lacks what is needed; the message says which has it."""


class UnreachablePoseError(CatenaryError, ValueError):
    """No configuration within the joint limits reaches the pose that was asked for."""


class UnsupportedCommandError(CatenaryError):
    """A robot has no such verb."""


class NotReadyError(CatenaryError):
    """A robot that is not homed or not enabled was asked to move."""


class RobotHeldError(NotReadyError):
    """Another program moves the robot; the message says which, and that one is left alone."""


class LimitError(CatenaryError, ValueError):
    """A motion leaves the joint limits, or runs into a stop, and was refused before anything moved."""


class RecordingError(CatenaryError):
    """A recording had to stop; the message says why, and what is safe in the file."""


class InUseError(CatenaryError):
    """Another process is writing in the project; the message says which, and since when."""


class TransportError(CatenaryError, ConnectionError):
    """Messages cannot pass: no master, a name or a topic taken otherwise, a transport that is closed."""


class SensorError(CatenaryError):
    """A sensor that a robot depends on cannot be trusted, and the robot was stopped or nothing could be measured."""


class NotFiniteError(CatenaryError):
    """Torques or measured positions were NaN or infinite for too many ticks in a row, and the robot was stopped."""


class ExcitationError(CatenaryError, ValueError):
    """Recordings do not move the robot in a way that would show its parameters.

    Attributes:
        rank, n_base: How many independent combinations of parameters the recordings show, and the robot has.
    """

    def __init__(self, message: str, *, rank: int, n_base: int) -> None:
        self.rank = rank
        self.n_base = n_base
        super().__init__(message)
