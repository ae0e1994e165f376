"""catenary: make an arm's low-level model true.

Names below are loaded when first used, so that importing the package costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from catenary.dynamics.inverse_dynamics import BaseMotion as BaseMotion
    from catenary.dynamics.inverse_dynamics import coriolis_matrix as coriolis_matrix
    from catenary.dynamics.inverse_dynamics import inverse_dynamics as inverse_dynamics
    from catenary.dynamics.inverse_kinematics import inverse_kinematics as inverse_kinematics
    from catenary.dynamics.kinematics import forward_kinematics as forward_kinematics
    from catenary.dynamics.kinematics import jacobian as jacobian
    from catenary.dynamics.mass_matrix import mass_matrix as mass_matrix
    from catenary.dynamics.regressor import torque_regressor as torque_regressor
    from catenary.gravity.compact import compact_regressor as compact_regressor
    from catenary.gravity.regressor import gravity_regressor as gravity_regressor
    from catenary.gravity.torque import gravity_torque as gravity_torque
    from catenary.robots.catalog import load_robot as load_robot
    from catenary.robots.model import RobotModel as RobotModel

_HOME = {
    "BaseMotion": "catenary.dynamics.inverse_dynamics",
    "RobotModel": "catenary.robots.model",
    "compact_regressor": "catenary.gravity.compact",
    "coriolis_matrix": "catenary.dynamics.inverse_dynamics",
    "forward_kinematics": "catenary.dynamics.kinematics",
    "gravity_regressor": "catenary.gravity.regressor",
    "gravity_torque": "catenary.gravity.torque",
    "inverse_dynamics": "catenary.dynamics.inverse_dynamics",
    "inverse_kinematics": "catenary.dynamics.inverse_kinematics",
    "jacobian": "catenary.dynamics.kinematics",
    "load_robot": "catenary.robots.catalog",
    "mass_matrix": "catenary.dynamics.mass_matrix",
    "torque_regressor": "catenary.dynamics.regressor",
}

__all__ = [*_HOME, "__version__"]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'catenary' has no attribute {name!r}; it has {', '.join(_HOME)}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
