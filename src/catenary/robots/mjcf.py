"""Robots from MJCF files, read by MuJoCo itself and taken from its compiled arrays."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from catenary.arrays import Floats
from catenary.bounded_parsers import MAX_XML_BYTES, XML_COMMENT, plain_number, read_bounded, shortened, xml_tree
from catenary.errors import FileFormatError, UnsupportedModelError, imported
from catenary.robots.actuation import StatedDrive, stated_actuation
from catenary.robots.assembly import (
    Coordinate,
    Link,
    Mimic,
    assemble,
    file_source,
    left_out,
    naming_the_file,
    resolve_mimics,
)
from catenary.robots.link_inertia import LinkInertia
from catenary.robots.model import Loop, Loops, Massless, RobotModel
from catenary.robots.plausibility import MAX_LINKS
from catenary.spatial import Pose, identity_pose, rotation_from_quaternion
from catenary.terminal_text import visible

_WORLD = "world"  # MuJoCo's name of what everything hangs on
# MuJoCo refuses to compile a moving body without mass. Such a file is compiled with these least values
# instead, far below any robot's part, and what comes out below a hundred times them was not in the file. A robot that
# is simulated gets them for its massless links: no torque shows them.
LEAST_MASS = 1e-12  # [kg]
LEAST_INERTIA = 1e-14  # [kg m2], above mjMINVAL = 1e-15
_MOVES_A_JOINT = (0, 1)  # kinds of MuJoCo's actuators, mjTRN_JOINT and mjTRN_JOINTINPARENT


def load_mjcf(path: Path, *, massless: Massless = ()) -> RobotModel:
    """Load a robot from an MJCF file; included files and meshes are found beside it, images are not opened.

    MuJoCo moves a body by its joints in turn, each about its own anchor p:
    T_parent_body = T0 Trans(p1) J1(q1 - ref1) Trans(-p1) Trans(p2) J2(q2 - ref2) Trans(-p2) ...
    A body with k joints becomes k links; all but the last, which has the body's name, are massless. Linear joint
    equalities that are active at the start become coupled joints. Frames are bodies, named sites and "world". Free
    bodies without joints are left aside, others stand where they are put; so are missing meshes that no mass is taken
    from.
    """
    compiled = compile_mjcf(path)
    sources = [file_source(Path(name), text) for name, text in compiled.files.items()]
    with naming_the_file(str(path)), np.errstate(all="ignore"):  # what is not finite is refused by name
        _refuse_what_no_tree_has(compiled)
        model = _assemble(compiled, path, sources)
    return model.with_massless(massless)


class CompiledMjcf(NamedTuple):
    """With hinges and slides only, a joint's index is also its index in qpos0 and in the dof arrays."""

    mujoco: Any
    model: Any  # mujoco.MjModel
    mass: Floats  # (nbody,) [kg], zero where the file gives none
    inertia: Floats  # (nbody, 3) principal moments [kg m2]
    from_geoms: list[str]  # moving bodies whose inertia MuJoCo took from their geoms
    aside: tuple[str, ...]  # notes on what was left aside before MuJoCo compiled the rest
    files: Mapping[str, bytes]  # the file, and those that it includes

    def name(self, kind: str, index: int) -> str:
        """Return the name of a body, joint, ...; one without a name is called by its kind and number."""
        stated = self.mujoco.mj_id2name(self.model, getattr(self.mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), index)
        return str(stated) if stated else f"{kind}{index}"

    def body_joints(self, body: int) -> range:
        """Return the indices of a body's joints, in the order they move it."""
        first, count = int(self.model.body_jntadr[body]), int(self.model.body_jntnum[body])
        return range(first, first + count) if count else range(0)


def compile_mjcf(path: Path) -> CompiledMjcf:
    """Return a file as MuJoCo compiles it, whatever masses it lacks; refuse one that asks for too much first."""
    content = read_bounded(path, MAX_XML_BYTES)
    included = _included_files(path, content)
    _refuse_too_much(path, content, included)
    mujoco = imported("mujoco", f"{path}: MuJoCo reads MJCF files and is not installed", "mujoco")
    for lacks_mass in (False, True):
        try:
            spec, aside = _read(mujoco, path, content, included)
            if lacks_mass:
                spec.compiler.boundmass = max(spec.compiler.boundmass, LEAST_MASS)
                spec.compiler.boundinertia = max(spec.compiler.boundinertia, LEAST_INERTIA)
            with warnings.catch_warnings():  # MuJoCo's are of its own simulation, and the tree is checked here
                warnings.simplefilter("ignore")
                model = spec.compile()
            break
        except (ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
            if lacks_mass or "must be larger than mjMINVAL" not in str(error):
                raise FileFormatError(f"{path}: MuJoCo cannot read it: {str(error).strip()}") from error
    mass, inertia = model.body_mass, model.body_inertia
    if lacks_mass:
        mass = np.where(mass > 100.0 * LEAST_MASS, mass, 0.0)
        inertia = np.where(inertia > 100.0 * LEAST_INERTIA, inertia, 0.0)
    explicit = {body.name for body in spec.bodies if body.explicitinertial}
    files = {path.name: content} | included
    compiled = CompiledMjcf(mujoco, model, np.array(mass), np.array(inertia), [], aside, files)
    for body in range(1, model.nbody):
        name = compiled.name("body", body)
        if mass[body] > 0.0 and model.body_weldid[body] != 0 and name not in explicit:
            compiled.from_geoms.append(name)
    return compiled


def _read(mujoco: Any, path: Path, content: bytes, included: Mapping[str, bytes]) -> tuple[Any, tuple[str, ...]]:
    """Parse a file, and leave aside what is no part of an arm: free bodies, free bases, pictures, missing meshes.

    MuJoCo opens the ending .xml only, and paths in UTF-8, so others are handed over as text.
    """
    is_text = visible(str(path)) == str(path)
    if path.suffix == ".xml" and is_text:
        spec = mujoco.MjSpec.from_file(str(path))
    else:
        spec = mujoco.MjSpec.from_string(content.decode(), include=included)
        spec.modelfiledir = str(path.absolute().parent) if is_text else ""  # where meshes are looked for
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for image in [*spec.textures, *spec.skins]:
        spec.delete(image)
    return spec, (*_without_free_joints(mujoco, spec), *_without_missing_meshes(mujoco, spec, path))


def _without_free_joints(mujoco: Any, spec: Any) -> list[str]:
    """Leave out bodies that nothing holds and that carry no joint; let those stand that carry some."""
    loose, floating = list[str](), list[str]()
    for joint in [joint for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE]:
        body = joint.parent
        carries = len(body.find_all("joint")) > 1
        (floating if carries else loose).append(body.name or f"body{body.id}")
        spec.delete(joint if carries else body)
    for key in list(spec.keys) if loose or floating else ():
        spec.delete(key)  # states of all joints, those that are gone too
    stand = [f"free bodies are fixed where the file puts them ({', '.join(floating)})"] if floating else []
    return [*left_out("free bodies that carry no joint", loose), *stand]


def _without_missing_meshes(mujoco: Any, spec: Any, path: Path) -> list[str]:
    """Leave out meshes whose files are not there, where no mass is taken from them."""
    missing = [mesh for mesh in spec.meshes if mesh.file and not (path.parent / spec.meshdir / mesh.file).is_file()]
    files = {mesh.name or Path(mesh.file).stem: mesh.file for mesh in missing}
    forced = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    low, high = spec.compiler.inertiagrouprange
    for geom in [geom for geom in spec.geoms if geom.meshname in files]:
        body = geom.parent
        weighs = geom.mass > 0.0 or (np.isnan(geom.mass) and geom.density > 0.0)
        held = body.name == _WORLD or (body.explicitinertial and not forced)
        if weighs and low <= geom.group <= high and not held:
            raise FileFormatError(
                f'{path}: no mesh {files[geom.meshname]!r}, from which the mass of body "{body.name}" is taken'
            )
        spec.delete(geom)
    for mesh in missing:
        spec.delete(mesh)
    return left_out("meshes whose files are not there", files.values())


def _refuse_what_no_tree_has(c: CompiledMjcf) -> None:
    for joint in range(c.model.njnt):
        kind = c.mujoco.mjtJoint(c.model.jnt_type[joint])
        if kind not in (c.mujoco.mjtJoint.mjJNT_HINGE, c.mujoco.mjtJoint.mjJNT_SLIDE):
            body = c.name("body", int(c.model.jnt_bodyid[joint]))
            raise UnsupportedModelError(
                f'joint "{c.name("joint", joint)}" of body "{body}" is a {kind.name[6:].lower()} joint; '
                "expected hinge or slide: a joint here has one coordinate"
            )
    if c.model.nflex:
        raise UnsupportedModelError(f'flexible body "{c.name("flex", 0)}": expected rigid bodies only')
    for equality in _active_equalities(c):
        kind = c.mujoco.mjtEq(c.model.eq_type[equality])
        if kind not in (c.mujoco.mjtEq.mjEQ_JOINT, c.mujoco.mjtEq.mjEQ_CONNECT):
            raise UnsupportedModelError(
                f'equality "{c.name("equality", equality)}" ({kind.name[5:].lower()}): '
                "a loop cannot be represented by a tree; expected joint and connect equalities only"
            )


def _assemble(c: CompiledMjcf, path: Path, sources: Sequence[str]) -> RobotModel:
    joints = _joint_names(c)
    leaders = resolve_mimics(_mimics(c, joints), joints.values())
    free = [name for name, leader in leaders.items() if leader.leader == name]
    links: list[Link] = []
    for body in range(1, c.model.nbody):
        links += _body_links(c, body, joints, leaders)
    site_names = {site: c.model.site(site).name for site in range(c.model.nsite) if c.model.site(site).name}
    taken = {_WORLD, *(link.name for link in links)}
    frames, notes = {}, []
    for site, name in site_names.items():
        frame = f"{name} (site)" if name in taken else name
        notes += [f'site "{name}" of the file is named "{frame}" here'] if name in taken else []
        carrier = int(c.model.site_bodyid[site])
        pose = Pose(rotation_from_quaternion(c.model.site_quat[site]), np.array(c.model.site_pos[site]))
        frames[frame] = (c.name("body", carrier), pose)
    name = bytes(c.model.names).split(b"\0", 1)[0].decode()  # the first of the compiled names is the model's
    model = assemble(
        path.stem if name in ("", "MuJoCo Model") else name,
        links,
        [_coordinate(c, joint, name) for joint, name in joints.items() if name in free],
        frames=frames,
        root=_WORLD,
        actuation=stated_actuation(free, _drives(c, joints, leaders)),
        sources=sources,
        notes=[*notes, *c.aside, *_notes(c, joints)],
    )
    return replace(model, loops=_loops(c, joints, model.joint_names))


def _drives(c: CompiledMjcf, joints: Mapping[int, str], leaders: Mapping[str, Mimic]) -> list[StatedDrive]:
    """Return dry friction, damping, armature and springs of the joints; those that nothing moves ask nothing."""
    m, drives = c.model, []
    for joint, name in joints.items():
        leader, factor, offset = leaders[name]
        if leader is not None:
            arrays = m.dof_frictionloss, m.dof_damping, m.dof_armature, m.jnt_stiffness, m.qpos_spring
            *stated, relaxed = (float(array[joint]) for array in arrays)
            drives.append(StatedDrive(leader, factor, *stated, relaxed - offset))  # type: ignore[call-arg]
    return drives


def _joint_names(c: CompiledMjcf) -> dict[int, str]:
    """Name every joint; one without a name has its body's, numbered when the body has several."""
    names: dict[int, str] = {}
    for body in range(1, c.model.nbody):
        for number, joint in enumerate(c.body_joints(body), start=1):
            stated = c.mujoco.mj_id2name(c.model, c.mujoco.mjtObj.mjOBJ_JOINT, joint)
            several = len(c.body_joints(body)) > 1
            names[joint] = str(stated) if stated else c.name("body", body) + (f"_{number}" if several else "")
    return names


def _body_links(c: CompiledMjcf, body: int, joints: Mapping[int, str], leaders: Mapping[str, Mimic]) -> Iterator[Link]:
    """Return a body as one link per joint, each moving the next; a body without joints as one fixed link."""
    name, parent = c.name("body", body), c.name("body", int(c.model.body_parentid[body]))
    pose = Pose(rotation_from_quaternion(c.model.body_quat[body]), np.array(c.model.body_pos[body]))
    inertia = _inertia(c, body)
    own = c.body_joints(body)
    if not own:
        yield Link(name, parent, "fixed", pose, inertia=inertia)
    for joint in own:
        is_last = joint == own[-1]
        anchor = np.array(c.model.jnt_pos[joint])
        link = name if is_last else f"{name}/{joints[joint]}"
        mimic = leaders[joints[joint]]
        slides = c.model.jnt_type[joint] == c.mujoco.mjtJoint.mjJNT_SLIDE
        yield Link(
            name=link,
            parent=parent,
            joint="prismatic" if slides else "revolute",
            pose=pose @ Pose(np.eye(3), anchor),
            axis=np.array(c.model.jnt_axis[joint]),
            variable={} if mimic.leader is None else {mimic.leader: mimic.multiplier},
            offset=mimic.offset - float(c.model.qpos0[joint]),
            frame=Pose(np.eye(3), -anchor),
            inertia=inertia if is_last else None,
            massless=not is_last,
        )
        parent, pose = link, identity_pose()


def _inertia(c: CompiledMjcf, body: int) -> LinkInertia | None:
    if c.mass[body] == 0.0:
        return None
    about_com = LinkInertia(float(c.mass[body]), np.zeros(3), np.diag(c.inertia[body]))
    return about_com.moved(Pose(rotation_from_quaternion(c.model.body_iquat[body]), np.array(c.model.body_ipos[body])))


def _coordinate(c: CompiledMjcf, joint: int, name: str) -> Coordinate:
    """Return the joint's coordinate; its effort limit is the smaller side of `actuatorfrcrange`."""
    lower, upper = c.model.jnt_range[joint] if c.model.jnt_limited[joint] else (-np.inf, np.inf)
    effort = np.inf
    if c.model.jnt_actfrclimited[joint]:
        lowest, highest = c.model.jnt_actfrcrange[joint]
        effort = max(0.0, min(-float(lowest), float(highest)))
    unit = "m" if c.model.jnt_type[joint] == c.mujoco.mjtJoint.mjJNT_SLIDE else "rad"
    return Coordinate(name, unit, float(lower), float(upper), effort=effort)


def _active_equalities(c: CompiledMjcf, kind: str = "") -> list[int]:
    """Return the equalities that are active at the start, of every kind or of one (JOINT, CONNECT)."""
    active = np.flatnonzero(c.model.eq_active0).tolist()
    return [k for k in active if not kind or c.model.eq_type[k] == getattr(c.mujoco.mjtEq, f"mjEQ_{kind}")]


def _loops(c: CompiledMjcf, joints: Mapping[int, str], coordinates: Sequence[str]) -> Loops | None:
    """Return the loops that connect equalities close; joints that an actuator moves are motors."""
    m, loops = c.model, list[Loop]()
    for equality in _active_equalities(c, "CONNECT"):
        ends, points = (int(m.eq_obj1id[equality]), int(m.eq_obj2id[equality])), m.eq_data[equality][:6].reshape(2, 3)
        if m.eq_objtype[equality] == c.mujoco.mjtObj.mjOBJ_SITE:
            points = np.array([m.site_pos[site] for site in ends])
            ends = int(m.site_bodyid[ends[0]]), int(m.site_bodyid[ends[1]])
        frames = c.name("body", ends[0]), c.name("body", ends[1])
        loops.append(Loop(c.name("equality", equality), frames, np.array(points)))
    if not loops:
        return None
    moved = {joints[int(m.actuator_trnid[k, 0])] for k in range(m.nu) if m.actuator_trntype[k] in _MOVES_A_JOINT}
    place = {joints[joint]: float(m.qpos0[joint]) for joint in joints}
    motors = tuple(name for name in coordinates if name in moved)
    return Loops(tuple(loops), motors, np.array([place[name] for name in coordinates]))


def _mimics(c: CompiledMjcf, joints: Mapping[int, str]) -> dict[str, Mimic]:
    """Read joint equalities: q1 - ref1 = c0 + c1 (q2 - ref2), constant when there is no second joint."""
    mimics: dict[str, Mimic] = {}
    for equality in _active_equalities(c, "JOINT"):
        what = f'equality "{c.name("equality", equality)}"'
        first, second = int(c.model.eq_obj1id[equality]), int(c.model.eq_obj2id[equality])
        c0, c1, *higher = (float(v) for v in c.model.eq_data[equality][:5])
        follower = joints[first]
        if follower in mimics:
            raise UnsupportedModelError(f'{what}: a second one binds joint "{follower}", expected one')
        if second >= 0 and any(higher):
            raise UnsupportedModelError(
                f"{what}: polycoef {[c0, c1, *higher]}: expected a linear one, {{c0, c1, 0, 0, 0}}"
            )
        offset = float(c.model.qpos0[first]) + c0
        if second < 0:
            mimics[follower] = Mimic(None, 0.0, offset)
        else:
            offset -= c1 * float(c.model.qpos0[second])
            mimics[follower] = Mimic(joints[second], c1, offset)
    return mimics


def _notes(c: CompiledMjcf, joints: Mapping[int, str]) -> list[str]:
    """Return notes on what the file holds and the model leaves out."""
    m = c.model
    notes = []
    for what, array in (("joint damping", "dof_dampingpoly"), ("joint springs", "jnt_stiffnesspoly")):
        higher = np.atleast_2d(getattr(m, array, np.zeros((m.njnt, 0))))  # of later versions of MuJoCo
        notes += left_out(f"terms of {what} beyond the linear one", [n for j, n in joints.items() if higher[j].any()])
    for kind, what, concerned in (
        ("body", "gravity compensation of bodies", np.flatnonzero(m.body_gravcomp)),
        ("tendon", "tendons", range(m.ntendon)),
        ("actuator", "actuators with their gears and limits", range(m.nu)),
        ("equality", "equalities that are not active at the start", np.flatnonzero(m.eq_active0 == 0)),
        ("body", "motion of mocap bodies, fixed here", np.flatnonzero(m.body_mocapid >= 0)),
    ):
        notes += left_out(what, [c.name(kind, int(index)) for index in concerned])
    if c.from_geoms:
        notes.append(f"inertia from the shapes of geoms, not from <inertial> ({', '.join(c.from_geoms)})")
    gravity = np.array(m.opt.gravity)
    if not np.allclose(gravity, (0.0, 0.0, -9.81), atol=0.011):  # 9.8 to 9.82 are all "standard"
        notes.append(f"left out: the file's gravity {gravity.tolist()}; gravity is an argument here")
    return notes


# what a file asks for is counted before MuJoCo is given it: a line of it can ask for gigabytes
_MAX_FILES = 100  # that a file includes
_MAX_COUNTS = {"bodies": MAX_LINKS, "points of images and height fields": 2**24, "reserved numbers": 10_000}
_IMAGE_SIZES = {"texture": ("width", "height"), "hfield": ("nrow", "ncol")}


def _mjcf_tree(content: bytes, where: str) -> Element:
    """Return the root element, without comments; lines keep their numbers."""
    return xml_tree(XML_COMMENT.sub(lambda match: b"\n" * match[0].count(b"\n"), content), where)


def _included_files(path: Path, content: bytes) -> dict[str, bytes]:
    """Return the files that <include> brings in, by the name it gives them, relative to the main file."""
    files: dict[str, bytes] = {}
    waiting = [(str(path), content)]
    folder = path.parent.resolve()
    while waiting:
        where, text = waiting.pop()
        for name in (element.get("file", "") for element in _mjcf_tree(text, where).iter("include")):
            place = path.parent / name.replace("\0", "")
            if name in files or not place.is_file():
                continue  # MuJoCo says what it misses
            if not place.resolve().is_relative_to(folder):
                raise FileFormatError(f"{where}: <include file={shortened(name)}>: is outside {path.parent}")
            files[name] = read_bounded(place, MAX_XML_BYTES)
            if len(files) > _MAX_FILES or sum(map(len, files.values())) > MAX_XML_BYTES:
                raise FileFormatError(
                    f"{path}: includes more than {_MAX_FILES} files, or more than {MAX_XML_BYTES} bytes"
                )
            waiting.append((str(place), files[name]))
    return files


def _refuse_too_much(path: Path, content: bytes, included: Mapping[str, bytes]) -> None:
    """Refuse a file that asks for more bodies, points of images or reserved numbers than a robot has."""
    trees = {name: _mjcf_tree(text, str(path.parent / name)) for name, text in included.items()}
    bodies, points, reserved = _MAX_COUNTS
    counts = dict.fromkeys(_MAX_COUNTS, 0.0)
    for element, times in _elements(_mjcf_tree(content, str(path)), trees):
        if element.tag == "body":
            counts[bodies] += times
        elif element.tag in ("composite", "flexcomp"):
            counts[bodies] += times * _product(element.get("count", "").split())
        elif element.tag in _IMAGE_SIZES:
            counts[points] += _product([element.get(key, "1") for key in _IMAGE_SIZES[element.tag]])
        elif element.tag == "size":
            numbers = [n for key, n in element.items() if key.startswith(("nuser_", "nkey"))]
            counts[reserved] += sum(_product([number]) for number in numbers)
        for what, limit in _MAX_COUNTS.items():
            if counts[what] > limit:
                raise FileFormatError(f"{path}: asks for {counts[what]:g} {what}, expected at most {limit}")


def _elements(root: Element, included: Mapping[str, Element]) -> Iterator[tuple[Element, float]]:
    """Yield every element and how often <replicate> makes it; a file that includes itself is gone through once."""
    waiting, seen = [(root, 1.0)], set[str]()
    while waiting:
        element, times = waiting.pop()
        yield element, times
        name = element.get("file", "") if element.tag == "include" else ""
        if name in included and name not in seen:
            seen.add(name)
            waiting.append((included[name], times))
        within = times * (_product([element.get("count", "1")]) if element.tag == "replicate" else 1.0)
        waiting += [(child, within) for child in element]


def _product(words: list[str]) -> float:
    """Return the product of numbers; words that are none are MuJoCo's to refuse."""
    product = 1.0
    for word in words:
        try:
            product *= max(1.0, plain_number(word))
        except ValueError:
            continue
    return product
