"""The names that `import catenary` offers, and where each lives: read by type checkers and by `__init__.py` alike."""

from catenary.calibration.calibration import Calibration as Calibration
from catenary.calibration.calibration import evaluate as evaluate
from catenary.calibration.calibration import fit as fit
from catenary.calibration.calibration import load_model as load_model
from catenary.calibration.corrector import Corrector as Corrector
from catenary.control.elastic import ElasticPD as ElasticPD
from catenary.control.estimated_gravity_pd import EstimatedGravityPD as EstimatedGravityPD
from catenary.control.gravity_pd import GravityPD as GravityPD
from catenary.control.inertia_pd import InertiaPD as InertiaPD
from catenary.control.limits import TorqueLimits as TorqueLimits
from catenary.control.loop import run_loop as run_loop
from catenary.control.pd import JointPD as JointPD
from catenary.crtk.client import CrtkClient as CrtkClient
from catenary.dynamics.inverse_dynamics import BaseMotion as BaseMotion
from catenary.dynamics.inverse_dynamics import coriolis_matrix as coriolis_matrix
from catenary.dynamics.inverse_dynamics import inverse_dynamics as inverse_dynamics
from catenary.dynamics.inverse_kinematics import inverse_kinematics as inverse_kinematics
from catenary.dynamics.kernels import gravity_kernel as gravity_kernel
from catenary.dynamics.kinematics import forward_kinematics as forward_kinematics
from catenary.dynamics.kinematics import jacobian as jacobian
from catenary.dynamics.mass_matrix import mass_matrix as mass_matrix
from catenary.dynamics.regressor import torque_regressor as torque_regressor
from catenary.errors import CatenaryError as CatenaryError
from catenary.gravity.compact import compact_regressor as compact_regressor
from catenary.gravity.estimator import GravityEstimator as GravityEstimator
from catenary.gravity.regressor import gravity_regressor as gravity_regressor
from catenary.gravity.torque import gravity_torque as gravity_torque
from catenary.gravity.torque import potential_energy as potential_energy
from catenary.identification.identification import identify as identify
from catenary.identification.payload import estimate_payload as estimate_payload
from catenary.plant import JointState as JointState
from catenary.plant import MotionLog as MotionLog
from catenary.recording.logs import read_log as read_log
from catenary.recording.logs import write_parquet as write_parquet
from catenary.robots.catalog import load_robot as load_robot
from catenary.robots.model import RobotModel as RobotModel
from catenary.simulation.base_motion import FixedBase as FixedBase
from catenary.simulation.cable_plant import CablePlant as CablePlant
from catenary.simulation.mujoco_plant import MujocoPlant as MujocoPlant
from catenary.trajectories.point_to_point import go_to as go_to
from catenary.trajectories.reference import Reference as Reference
from catenary.trajectories.sinusoids import random_sinusoids as random_sinusoids
from catenary.trajectories.zigzag import zigzag as zigzag
from catenary.workflows.simulated_recording import record_simulated as record_simulated

__version__: str
