"""An arm whose file calls a frame "base" that is not its root: turned by pi about z, as Universal Robots' pendant has it."""

import numpy as np
import pinocchio

from catenary.arrays import Floats

_BODY = '<inertial><origin xyz="0.2 0.01 0"/><mass value="2"/><inertia ixx=".1" ixy="0" ixz="0" iyy=".1" iyz="0" izz=".1"/></inertial>'
_LIMIT = '<limit lower="-3" upper="3" velocity="2" effort="9"/>'


def _joint(name: str, parent: str, child: str, place: str, *, fixed: bool = False) -> str:
    kind, more = ("fixed", "") if fixed else ("revolute", f'<axis xyz="0 1 1"/>{_LIMIT}')
    links = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{links}<origin {place}/>{more}</joint>'


LINKS = ("base_link", "base", "world", "tip", "shoulder", "tool0")
URDF = (
    '<robot name="turned">'
    + "".join(f'<link name="{name}">{_BODY if name in ("shoulder", "tip") else ""}</link>' for name in LINKS)
    + _joint("to_base", "base_link", "base", f'xyz="0.1 0 0" rpy="0 0 {np.pi!r}"', fixed=True)
    + _joint("to_world", "base_link", "world", 'xyz="0 0 -0.5" rpy="0 0 0.3"', fixed=True)
    + _joint("tool0", "base_link", "shoulder", 'xyz="0 0 0.3" rpy="0.2 0 0"')  # a joint may bear a link's name
    + _joint("elbow", "shoulder", "tip", 'xyz="0.4 0 0" rpy="0 0.1 0"')
    + _joint("to_tool", "tip", "tool0", 'xyz="0.1 0.2 0" rpy="0 0 0.5"', fixed=True)
    + "</robot>"
)
MOVING = URDF.replace('"shoulder"', '"base"').replace('<link name="base"></link>', "", 1).replace(
    _joint("to_base", "base_link", "base", f'xyz="0.1 0 0" rpy="0 0 {np.pi!r}"', fixed=True), ""
)  # fmt: skip
MJCF = """<mujoco model="turned"><compiler angle="radian"/><worldbody>
  <body name="base" pos="0.1 0 0" quat="0 0 0 1"><geom size="0.1" mass="1"/>
    <body name="shoulder" pos="0 0 0.3"><joint name="tool0" axis="0 1 1"/><geom size="0.1" mass="1"/>
      <site name="tip" pos="0.1 0.2 0"/></body>
  </body>
</worldbody></mujoco>"""
TABLE = """
name = "turned"
convention = "modified"
sources = ["assumed"]
base_frame = "base"
root = "base_link"
base_rotation = [[-1, 0, 0], [0, -1, 0], [0, 0, 1]]
base_position_m = [0.1, 0, 0]
[[link]]
name = "shoulder"
joint = "revolute"
alpha_deg = 0
a_m = 0.2
d_m = 0.3
theta_deg = 0
"""


def poses(text: str, q: Floats) -> dict[str, pinocchio.SE3]:
    """Return where Pinocchio has every link of a URDF, in the root's axes."""
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, q)
    bodies = {f.name: k for k, f in enumerate(model.frames) if f.type == pinocchio.FrameType.BODY}
    return {name: data.oMf[k] for name, k in bodies.items()}
