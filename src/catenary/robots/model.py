"""RobotModel: one robot as constant arrays, however it was described."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, Listed, as_array, frozen
from catenary.errors import InputError, MissingInertiaError
from catenary.robots.actuation import Actuation, default_actuation
from catenary.robots.link_inertia import LinkInertia, check_inertia, symmetric, unphysical
from catenary.robots.plausibility import HEAVY_RATIO, LONG_LINK_M
from catenary.spatial import Pose
from catenary.tables import OnScreen, Screen, Table
from catenary.units import shown_rows

Massless = Sequence[str] | Literal["all"]  # links declared to have no mass; all that a description gives none
_log = logging.getLogger(__name__)
BASE = "base"  # the frame that everything hangs on, where a file calls no other one so


class Tree(NamedTuple):
    """A tree of one-coordinate joints, each with the link it carries; parents come first.

    Frame i is fixed to link i. It is (rotation[i], origin[i]) in the parent's frame, then turned about or
    moved along axis[i] by the tree coordinate i. Fixed links are folded into the link that carries them.
    Inertias are about the centre of mass, along the axes of frame i.
    """

    parent: Annotated[NDArray[np.int64], Listed((None,), int)]  # (n,) -1 is the base
    prismatic: Annotated[NDArray[np.bool_], Listed((None,), bool)]  # (n,)
    rotation: Annotated[Floats, Listed((None, 3, 3))]  # R_parent_i at coordinate zero
    origin: Annotated[Floats, Listed((None, 3))]  # [m], in the parent's frame
    axis: Annotated[Floats, Listed((None, 3))]  # unit vector in frame i
    mass: Annotated[Floats, Listed()]  # (n,) [kg]
    com: Annotated[Floats, Listed((None, 3))]  # [m], in frame i
    inertia: Annotated[Floats, Listed((None, 3, 3))]  # [kg m2]


class Frame(NamedTuple):
    """A named frame fixed to a link: `link` is an index into the tree, -1 the base."""

    link: int
    pose: Pose  # of the frame in the link's frame


class Loop(NamedTuple):
    """A point of one frame that stays on a point of another, which closes a loop of the tree."""

    name: str
    frames: tuple[str, str]
    points: Annotated[Floats, Listed((2, 3))]  # in these frames [m]


class Loops(NamedTuple):
    """What closes the loops of a tree whose joints are all coordinates still."""

    loops: tuple[Loop, ...]
    motors: tuple[str, ...]  # coordinates that are driven, which the others follow; empty if not stated
    # (n,) a place next to which the loops close [rad or m]: they may close in several ways
    assembled: Annotated[Floats, Listed()]


class Unseen(NamedTuple):
    """A change of masses that no torque showed under the gravity in which a robot was identified."""

    name: str  # of the first moment or mass that it is counted in
    # (n_tree, 4) of each link's mass [kg] and first moment [kg m], per unit of it
    change: Annotated[Floats, Listed((None, 4))]
    low: float  # by how much bodies could have less of it [kg m or kg], zero or below
    high: float  # by how much more


@dataclass(frozen=True, eq=False, repr=False)  # two models are equal if they are one: arrays have no truth value
class RobotModel(OnScreen):
    """One robot: a tree, and how its n coordinates move the tree's joints.

    tree coordinate = coupling @ q + offset. Torques go the other way: tau = coupling.T @ tree torque.
    The base frame's z axis points up on a level base: gravity is (0, 0, -9.81) there.

    Examples:
        >>> arm = catenary.load_robot("raven2")
        >>> arm.n, arm.joint_units
        (3, ('rad', 'rad', 'm'))
    """

    name: str
    joint_names: tuple[str, ...]  # (n,) the robot's coordinates, in the order of q
    joint_units: tuple[str, ...]  # (n,) "rad" or "m"
    link_names: tuple[str, ...]  # (n_tree,)
    tree: Tree
    coupling: Annotated[Floats, Listed((None, None))]  # (n_tree, n)
    offset: Annotated[Floats, Listed()]  # (n_tree,) [rad or m]
    lower: Annotated[Floats, Listed(null=-np.inf)]  # (n,) [rad or m], -inf where there is no limit
    upper: Annotated[Floats, Listed(null=np.inf)]  # (n,)
    velocity_limit: Annotated[Floats, Listed(null=np.inf)]  # (n,) [rad/s or m/s], inf where not given
    effort_limit: Annotated[Floats, Listed(null=np.inf)]  # (n,) [Nm or N], inf where not given
    frames: Mapping[str, Frame]  # every named frame, links and fixed links included
    tip: str  # the frame that forward and inverse kinematics mean when none is named
    missing_inertia: tuple[str, ...] = ()  # moving links without mass, centre of mass and inertia
    # those with a mass, but with no inertia about its centre that a body has
    missing_tensor: tuple[str, ...] = ()
    massless: tuple[str, ...] = ()  # moving links declared to have none
    axes_of_com: Annotated[NDArray[np.bool_], Listed((None, 3), bool)] = field(
        default_factory=lambda: np.ones((0, 3), dtype=bool)
    )
    # (n_tree, 3) axes of frame i on which link i's centre of mass may lie; all of them when none is declared
    closed_form: str | None = None  # which closed-form inverse kinematics holds, if any
    actuation: Actuation | None = None  # friction, springs, motors, if stated
    unseen: tuple[Unseen, ...] = ()  # what recordings on one base could not show of its masses
    without_payload: "RobotModel | None" = None  # the same robot before a payload was added
    sources: tuple[str, ...] = ()  # where the numbers come from
    notes: tuple[str, ...] = ()  # what the description holds and the model leaves out
    doubts: tuple[str, ...] = ()  # what is doubtful about its numbers
    file_order: tuple[str, ...] = ()  # joint_names as its file lists them, where it does
    loops: Loops | None = None  # that are open still; `load_robot` returns none with such

    def __post_init__(self) -> None:
        for name in ("coupling", "offset", "lower", "upper", "velocity_limit", "effort_limit"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "tree", Tree(*(frozen(array) for array in self.tree)))
        axes = self.axes_of_com if len(self.axes_of_com) else np.ones((len(self.tree.parent), 3), dtype=bool)
        object.__setattr__(self, "axes_of_com", frozen(axes))
        unseen = tuple(entry._replace(change=frozen(entry.change)) for entry in self.unseen)
        object.__setattr__(self, "unseen", unseen)
        frames = {
            name: Frame(link, Pose(frozen(pose.rotation), frozen(pose.position)))
            for name, (link, pose) in self.frames.items()
        }
        object.__setattr__(self, "frames", frames)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "kernels"}

    @property
    def n(self) -> int:
        """Number of the robot's coordinates."""
        return len(self.joint_names)

    @cached_property
    def kernels(self) -> dict[str, Any]:
        """What `catenary.dynamics.robot_kernels` compiled for this robot, for as long as the model lives."""
        return {}

    @property
    def screen(self) -> Screen:
        """Each joint's limits, and the mass of all links."""
        columns = ("joint", "unit", ("lower", ":.4g"), ("upper", ":.4g"), ("per second", ":.4g"), ("Nm, N", ":.4g"))
        limits = shown_rows(self, self.lower, self.upper, self.velocity_limit)
        table = Table(columns, [(*row, effort) for row, effort in zip(limits, self.effort_limit, strict=True)])
        lacking = ", ".join(self.missing_inertia)
        mass = f"no mass for {lacking}" if lacking else f"{self.tree.mass.sum():.3g} kg"
        return Screen(f"{self.name}: {self.n} joints, tip {self.tip}, {mass}", [table], "; ".join(self.doubts))

    def require_masses(self) -> None:
        """Refuse a model that cannot give gravity torques, which need masses and their centres."""
        if self.loops is not None:
            raise InputError(f'robot "{self.name}": its loops are open: its torques are not those of its motors')
        if self.missing_inertia:
            raise MissingInertiaError(self.name, self.missing_inertia)

    def require_inertia(self) -> None:
        """Refuse a model that cannot give masses and torques of motion."""
        self.require_masses()
        if self.missing_tensor:
            raise MissingInertiaError(self.name, self.missing_tensor, only_tensor=True)

    @property
    def assumed_actuation(self) -> Actuation:
        """Its actuation; friction on every joint where its description states none."""
        return default_actuation(self.joint_names) if self.actuation is None else self.actuation

    @cached_property
    def base(self) -> str:
        """Name of the frame that everything hangs on: "base", or the file's where that calls another frame so."""
        return next((name for name in (BASE, *self.frames) if is_base(self.frames.get(name))), BASE)

    def frame(self, name: str | None = None) -> Frame:
        """Return a frame by name, the tip when no name is given."""
        key = self.tip if name is None else name
        if key not in self.frames:
            raise InputError(f'robot "{self.name}": no frame "{key}"; frames: {", ".join(sorted(self.frames))}')
        return self.frames[key]

    def with_massless(self, links: Massless) -> "RobotModel":
        """Return the robot with further links declared to have no inertia; fixed links may be named too.

        Args:
            links: Their names; "all" for every one that the description gives no mass.

        Raises:
            InputError: An unknown link, or one that has a mass; the message names it.
        """
        links = self.missing_inertia if links == "all" else links
        for link in links:
            if link not in self.frames:
                raise InputError(
                    f'robot "{self.name}": massless link "{link}" is not a link; links: {", ".join(self.link_names)}'
                )
            mass = self.tree.mass[self.link_names.index(link)] if link in self.link_names else 0.0
            if mass > 0.0:
                raise InputError(f'robot "{self.name}": link "{link}" is named massless but has {mass:g} kg')
        declared = {*self.massless, *(link for link in links if link in self.missing_inertia)}
        return replace(
            self,
            missing_inertia=tuple(link for link in self.missing_inertia if link not in declared),
            massless=tuple(link for link in self.link_names if link in declared),
        )

    def with_payload(
        self, frame: str, mass: float, position: ArrayLike, *, inertia: ArrayLike | None = None
    ) -> "RobotModel":
        """Return the robot carrying a body; `without_payload` of the result is this robot again.

        With a mass of zero it is this robot itself, to the last bit. A load of ten times the arm's own mass, or one
        that lies 10 m from its joint, is logged.

        Args:
            frame: What it is fixed to.
            mass: [kg], zero or more.
            position: (3,) [m] of its centre of mass in that frame.
            inertia: (3, 3) or (6,) xx, xy, xz, yy, yz, zz about its centre of mass, along that frame's axes [kg m2];
                a point mass when None.

        Raises:
            InputError: Unknown frame, one that does not move, negative mass, an inertia that no body has, or NaN.
            MissingInertiaError: Links without inertia: what the payload is added to is not known.
        """
        self.require_masses()
        where = f'robot "{self.name}": payload on "{frame}"'
        link, pose = self.frame(frame)
        place = pose.rotation @ as_array(f"{where}: position", position, (3,)) + pose.position
        load = float(as_array(f"{where}: mass", mass, ()))
        if load < 0.0:
            raise InputError(f"{where}: mass {load:g} kg, expected zero or more")
        if link < 0:
            raise InputError(f"{where}: does not move; what hangs there loads no joint")
        tensor = np.zeros((3, 3)) if inertia is None else np.asarray(inertia, dtype=np.float64)
        tensor = symmetric(tensor) if tensor.shape == (6,) else tensor
        check_inertia(where, LinkInertia(load, place, tensor))
        if (fault := unphysical(load, tensor)) is not None:
            raise InputError(f"{where}: {fault}")
        if load == 0.0:
            return self
        if load > HEAVY_RATIO * (own := float(self.tree.mass.sum())) > 0.0:
            _log.warning("%s: payload of %g kg on an arm of %.3g kg; payloads are in kg", where, load, own)
        if np.linalg.norm(place) > LONG_LINK_M:
            _log.warning("%s: it lies %.4g m from the joint; positions are in m", where, np.linalg.norm(place))
        own = self.tree.mass[link]
        apart = place - self.tree.com[link]
        masses, coms, tensors = self.tree.mass.copy(), self.tree.com.copy(), self.tree.inertia.copy()
        masses[link] = own + load
        coms[link] += load / (own + load) * apart
        # parallel axes: two bodies about their common centre, reduced mass times the distance between theirs
        tensors[link] += own * load / (own + load) * (apart @ apart * np.eye(3) - np.outer(apart, apart))
        tensors[link] += pose.rotation @ tensor @ pose.rotation.T
        return replace(
            self,
            tree=self.tree._replace(mass=masses, com=coms, inertia=tensors),
            massless=tuple(name for name in self.massless if name != self.link_names[link]),
            without_payload=self,
        )


def is_base(frame: Frame | None) -> bool:
    """Return True if a frame is the root that carries all others."""
    if frame is None or frame.link >= 0:
        return False
    return np.array_equal(frame.pose.rotation, np.eye(3)) and not frame.pose.position.any()
