import numpy as np

from catenary import FixedBase, MotionLog, compact_regressor, gravity_torque, load_robot
from catenary.arrays import Floats
from catenary.identification.base_parameters import gravity_base_parameters
from papers.regressor import identification as raven_identification

ARM = load_robot("raven2")
REGRESSOR = compact_regressor(ARM)
BELIEF = REGRESSOR.parameters(raven_identification.believed(ARM))


def ideal(base: FixedBase, seed: int) -> raven_identification.Poses:
    """Poses whose torques are gravity's alone."""
    q: Floats = np.random.default_rng(seed).uniform(raven_identification.LOWER, raven_identification.UPPER, (20, 3))
    gravity = base.sample(np.zeros(1)).gravity[0]
    tau = gravity_torque(ARM, q, gravity)
    log = MotionLog("ideal", ARM.joint_names, ARM.joint_units, q, np.ones(20, bool), tau=tau)
    return raven_identification.Poses({"reported": q, "true": q}, tau, gravity, log)


def test_poses_show_all_that_torques_can_tell_unless_joint_1_stands_upright() -> None:
    # Z0, joint 1's axis, is the base's -y: level and tilted bases load it, one rolled by 90 deg does not
    upright = FixedBase(np.pi / 2)
    for base in (*raven_identification.BASES.values(), upright):
        poses = ideal(base, 0)
        fit = raven_identification.fit_compact(REGRESSOR, BELIEF, [poses], "true", "base")
        assert fit.rank == gravity_base_parameters(ARM, poses.gravity).count
    every = gravity_base_parameters(ARM, None).count
    assert (
        raven_identification.fit_compact(
            REGRESSOR, BELIEF, [ideal(raven_identification.BASES["level"], 0)], "true", "level"
        ).rank
        == every
    )
    assert raven_identification.fit_compact(REGRESSOR, BELIEF, [ideal(upright, 0)], "true", "upright").rank == every - 2


def test_what_was_identified_on_a_level_base_holds_on_another() -> None:
    test = ideal(raven_identification.TEST_BASE, 9)
    level = raven_identification.fit_compact(
        REGRESSOR, BELIEF, [ideal(raven_identification.BASES["level"], 0)], "true", "level"
    )
    wrong, right = (raven_identification.torque_error(REGRESSOR, s, test, ARM, "true") for s in (BELIEF, level.s))
    assert (right < 0.2 * wrong).all()  # the belief still pulls, friction's noise being assumed
