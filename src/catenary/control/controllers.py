"""The controllers by name, one record each: what help, view and tests say of it, and which file makes it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

from catenary.errors import InputError

if TYPE_CHECKING:  # help reads these records, and starts without NumPy
    from catenary.control.gains import DrivenJoints
    from catenary.control.pd import Damping, SplitController


@dataclass(frozen=True)
class ControllerKind:
    """A controller by name.

    Args:
        name, words: Name as typed, and description in help and view.
        made_by: `module:function` of this room; the function takes (DrivenJoints, Damping, **settings).
        settings: Further arguments of that function.
        gravity: What it takes gravity to be; None if it compensates none.
        springs: It is for elastic joints alone.
        accelerations: Its gains are of accelerations, its own, and it follows velocities (damping relative).
    """

    name: str
    words: str
    made_by: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    gravity: Literal["level", "sensed"] | None = "sensed"
    springs: bool = False
    accelerations: bool = False

    def __str__(self) -> str:
        return f"{self.name}: {self.words}"

    def fits(self, arm: "DrivenJoints") -> bool:
        """Return True if the arm has what the controller needs."""
        return arm.stiffness is not None or not self.springs

    def make(self, arm: "DrivenJoints", *, damping: "Damping" = "relative") -> "SplitController":
        """Return the controller of an arm, compiled; damping "absolute" leaves the reference's velocity out.

        Raises:
            InputError: The arm has no springs, or the controller follows velocities.
        """
        if not self.fits(arm):
            raise InputError(f'controller "{self.name}": robot "{arm.model.name}" has no springs at its joints')
        if self.accelerations and damping != "relative":
            raise InputError(f'controller "{self.name}": follows velocities, expected damping relative')
        module, _, function = self.made_by.partition(":")
        make: Callable[..., SplitController] = getattr(import_module(f"catenary.control.{module}"), function)
        return make(arm, damping, **self.settings)


_GRAVITY, _INERTIA, _ELASTIC = "pd:gravity_pd", "pd:inertia_pd", "elastic_pd:elastic_pd"
_KINDS = (
    ControllerKind("pd", "PD alone", "pd:joint_pd", gravity=None),
    ControllerKind("sg", "PD + gravity of a level base (SG)", _GRAVITY, {"level": True}, "level"),
    ControllerKind("dg", "PD + sensed gravity (DG)", _GRAVITY, {"level": False}),
    ControllerKind("inertia", "PD through the mass matrix", _INERTIA, {"coriolis": False}, accelerations=True),
    ControllerKind("computed-torque", "with velocity terms too", _INERTIA, {"coriolis": True}, accelerations=True),
    *(
        ControllerKind(f"elastic-{how}", f"PD on motors, gravity {at}", _ELASTIC, {"compensation": how}, springs=True)
        for how, at in (("constant", "at the reference"), ("online", "there"), ("biased", "at the links"))
    ),
)
_HOLDS = (
    ControllerKind("sg", "gravity of a level base alone", "pd:gravity_hold", {"level": True}, "level"),
    ControllerKind("dg", "sensed gravity alone", "pd:gravity_hold", {"level": False}),
)
CONTROLLERS = {kind.name: kind for kind in _KINDS}
HOLDS = {kind.name: kind for kind in _HOLDS}  # gravity compensation alone


def make_controller(
    name: str,
    arm: "DrivenJoints",
    *,
    damping: "Damping" = "relative",
    among: Mapping[str, ControllerKind] = CONTROLLERS,
) -> "SplitController":
    """Return a controller for an arm, with the arm's own gains.

    Args:
        name: Kind of controller.
        arm: The arm that it drives.
        damping: What its derivative term acts on; see `ControllerKind.make`.
        among: `CONTROLLERS`, or `HOLDS`, which have no feedback of position.

    Raises:
        InputError: No such kind.
    """
    if name not in among:
        raise InputError(f'controller "{name}": expected one of {", ".join(among)}')
    return among[name].make(arm, damping=damping)
