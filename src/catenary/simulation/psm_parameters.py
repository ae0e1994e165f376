"""The numbers of a simulated PSM: what the arm is, what its controller believes, what a tracker sees."""

from dataclasses import replace
from importlib.resources import as_file, files
from typing import Annotated, NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.config import Settings, load_toml
from catenary.robots.catalog import load_robot
from catenary.robots.link_inertia import symmetric
from catenary.robots.model import RobotModel, Tree
from catenary.simulation.cable_parameters import AxisFirmware, CableDrive, Entry, Origin, drawn, parameters_of
from catenary.simulation.records import AXES, POSITIONING, SIZES, PerAxis, PerTool, Record

ARM_JOINTS = AXES - 1  # all but the jaw
_LINKS = 8  # that turn or slide, of the parallelogram and the insertion
# seven joints behind cables, in place of a RAVEN-II's three
PSM_SIZES = {**SIZES, "joint": AXES, "link": _LINKS, "node": _LINKS + 1}

_PerArmJoint = Annotated[Floats, "f8", (ARM_JOINTS,)]
_ToolMatrix = Annotated[Floats, "f8", ("tool", "tool")]


class PsmDrive(CableDrive):
    """Motors, gears, cables and joints of a PSM as they really are.

    Cables are in the dVRK's actuator coordinates: the joints' own for the first three, the instrument's discs for the
    other four.
    """

    sizes = PSM_SIZES

    coupling: _ToolMatrix  # true: turns of the discs per turn of the tool's joints
    stop_lower: PerAxis  # joint positions of the stops [rad, rad, m, rad...]
    stop_upper: PerAxis
    stop_stiffness: PerAxis  # [Nm/rad, Nm/rad, N/m, Nm/rad...]
    stop_damping: PerAxis
    tool_inertia: PerTool  # of what the tool's joints move [kg m2]
    joint_damping: PerAxis  # [Nm s/rad, Nm s/rad, N s/m, Nm s/rad...]


class PsmController(AxisFirmware):
    """The dVRK's control of a PSM."""

    counts: PerAxis  # of an encoder per turn of its motor
    joints: _ToolMatrix  # tool's joints at its discs' positions; the inverse is the discs' at the joints'
    discs: _ToolMatrix
    tolerance: PerAxis  # error of a joint beyond which the controller stops [rad, rad, m, rad...]
    current_limit: PerAxis  # [A]
    registration: PerAxis  # reported less true actuator positions after homing [rad, rad, m, rad...]


def joints_per_actuator(controller: PsmController) -> Floats:
    """Return the joints' positions per those of the actuators, (7, 7), as the controller has them."""
    coupling = np.eye(AXES)
    coupling[POSITIONING:, POSITIONING:] = np.reshape(controller.joints, (AXES - POSITIONING, -1))
    return coupling


class Tracker(Record):
    """What sees the arm's joints from outside, by a camera or encoders."""

    resolution: _PerArmJoint  # [rad, rad, m, rad, rad, rad]
    noise: _PerArmJoint  # standard deviation of a reading


class LinkEntry(Settings):
    """Mass of one link of the data file."""

    mass_kg: float
    com_m: tuple[float, float, float]
    # xx xy xz yy yz zz about the centre of mass
    inertia_kg_m2: tuple[float, float, float, float, float, float]
    origin: Origin


class PsmFile(Settings):
    """The data file."""

    name: str
    sources: list[str]
    drive: dict[str, Entry]
    controller: dict[str, Entry]
    tracker: dict[str, Entry]
    links: dict[str, LinkEntry]


class PsmArm(NamedTuple):
    """A PSM as its data file has it."""

    name: str
    drive: PsmDrive
    controller: PsmController
    tracker: Tracker
    links: Tree  # of robot dvrk_psm_motors, in its own coordinates, with masses
    coupling: Floats  # (_LINKS, 3) the links' coordinates per yaw, pitch, insertion
    file: PsmFile

    def loaded_model(self) -> RobotModel:
        """Return robot dvrk_psm_motors with these masses; its first three coordinates are the arm's first joints."""
        return replace(load_robot("dvrk_psm_motors"), tree=self.links, missing_inertia=())


def load_psm() -> PsmArm:
    """Load the package's PSM."""
    with as_file(files("catenary.simulation") / "data" / "dvrk_psm.toml") as path:
        content = load_toml(path, PsmFile)
    model = load_robot("dvrk_psm_motors")
    links = [content.links[name] for name in model.link_names]
    tree = model.tree._replace(
        mass=np.array([link.mass_kg for link in links]),
        com=np.array([link.com_m for link in links]),
        inertia=np.array([symmetric(link.inertia_kg_m2) for link in links]),
    )
    return PsmArm(
        content.name,
        parameters_of(path, "drive", content.drive, PsmDrive),
        parameters_of(path, "controller", content.controller, PsmController),
        parameters_of(path, "tracker", content.tracker, Tracker),
        # writable ones: compiled code is compiled once more for another kind of array
        Tree._make(np.array(part) for part in tree),
        np.array(model.coupling[:, :POSITIONING]),
        content,
    )


_SHARES = {
    "stiffness": 0.15, "backlash": 0.15, "rotor_friction": 0.15, "link_friction": 0.15,
    "capstan_runout": 0.2, "pulley_runout": 0.2, "capstan_phase": 0.0, "pulley_phase": 0.0,
}  # fmt: skip


def varied_psm(arm: PsmArm, rng: np.random.Generator) -> PsmArm:
    """Draw another arm of the kind: gears by 0.5 %, stiffness, backlash and friction by 15 %, registration by 30 %."""
    drive = drawn(arm.drive, rng, 0.005, _SHARES)
    registration = arm.controller.registration * np.exp(0.3 * rng.standard_normal(AXES))
    return arm._replace(drive=drive, controller=arm.controller.replace(registration=registration))
