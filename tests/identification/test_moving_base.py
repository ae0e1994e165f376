"""Identification on a base that rocks: with its motion, with the wrench under it, and without either."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics
from catenary.dynamics.torque_regressor import PARAMETER_NAMES, link_parameters
from catenary.errors import InputError
from catenary.identification.identification import Identification, identify
from catenary.identification.identify_options import IdentifyOptions
from catenary.robots.catalog import load_robot
from catenary.robots.submodels import on_base_joints
from moving_arm import recorded, sinusoids

PANDA, RATE, ROWS = load_robot("panda"), 200.0, 2000
PLAIN = IdentifyOptions(friction=(), prior=False)
PLACE = np.array([0.1, -0.2, 0.3])  # [m] of an accelerometer in the base


def columns(**vectors):
    return {f"{name}:{axis}": v[:, k] for name, v in vectors.items() for k, axis in enumerate("xyz")}


def rocked(seed, amplitude, hz=0.3, *, wrench=False, place=(0.0, 0.0, 0.0)):
    """Recording on a base that rocks about x, with its signals by accelerometer and gyroscope with noise."""
    rng = np.random.default_rng(seed)
    t, w = np.arange(ROWS) / RATE, 2.0 * np.pi * hz
    roll = amplitude * np.sin(w * t + seed)
    gravity = 9.81 * np.column_stack([0.0 * t, -np.sin(roll), -np.cos(roll)])
    omega, alpha = np.zeros((2, ROWS, 3))
    omega[:, 0], alpha[:, 0] = amplitude * w * np.cos(w * t + seed), -amplitude * w**2 * np.sin(w * t + seed)
    q, qd, qdd = sinusoids(rng, PANDA, t)
    tau = inverse_dynamics(PANDA, q, qd, qdd, gravity, BaseMotion(omega, alpha)) + 0.3 * qd
    tau = tau + rng.normal(scale=0.05, size=q.shape)
    felt = gravity - np.cross(alpha, place) - np.cross(omega, np.cross(omega, place))
    signals = columns(
        gravity=felt + rng.normal(scale=0.02, size=felt.shape),
        base_rate=omega + rng.normal(scale=1e-3, size=omega.shape),
    )
    if wrench:
        held = on_base_joints(PANDA)
        mass, com, tensor = held.tree.mass.copy(), held.tree.com.copy(), held.tree.inertia.copy()
        mass[5], com[5], tensor[5] = 8.0, [0.02, 0.01, -0.1], np.diag([0.1, 0.12, 0.08])
        true = replace(held, tree=held.tree._replace(mass=mass, com=com, inertia=tensor), missing_inertia=())
        motion = (np.hstack([np.zeros((ROWS, 6)), rows]) for rows in (q, qd, qdd))
        under = inverse_dynamics(true, *motion, gravity, BaseMotion(omega, alpha))[:, :6] + [
            1.0,
            2.0,
            -3.0,
            0.1,
            0.2,
            0.3,
        ]
        under += rng.normal(scale=[0.3] * 3 + [0.03] * 3, size=under.shape)
        signals |= columns(base_force=under[:, :3], base_moment=under[:, 3:])
    log = recorded(PANDA, 0, seconds=ROWS / RATE, q_nominal=q, qd=qd, tau=tau)
    return replace(log, name=f"run{seed}", signals=signals)


@pytest.mark.parametrize(("amplitude", "count"), [(0.4, 70), (0.0, 64)])
def test_only_what_a_base_moved_by_is_asked_of_a_recording(amplitude, count):
    """A base that stands still in spite of its columns shows no more than one without, and is no refusal."""
    identified = identify([rocked(0, amplitude)], PANDA, PLAIN, tests=[rocked(1, amplitude)])
    assert identified.base.count <= count + 6 * (amplitude == 0.0)
    assert identified.tests[0].verdict == "holds"
    assert (identified.tests[0].relative_rms < 0.03).all()


def test_masses_are_true_with_a_rocking_bases_motion_and_told_to_be_wrong_without(caplog):
    run, test = rocked(0, 0.2), rocked(1, 0.2)
    true, options = PANDA.tree.mass, replace(PLAIN, prior=True)
    known = identify([run], PANDA, options, tests=[test])
    assert not caplog.messages
    blind = identify([replace(run, signals={})], PANDA, options, tests=[replace(test, signals={})])
    assert_allclose(known.robot().tree.mass, true, rtol=0.02)
    assert blind.tests[0].relative_rms.max() > 10.0 * known.tests[0].relative_rms[0]
    assert [message.partition(": ")[0] for message in caplog.messages] == ["run0", "run1"]
    assert all("those of a moving base" in message for message in caplog.messages)


def test_an_accelerometer_away_from_the_base_origin_is_brought_there():
    options = replace(PLAIN, base_sensor=tuple(PLACE))
    there, off = (identify([rocked(0, 0.3, 1.0, place=PLACE)], PANDA, chosen) for chosen in (options, PLAIN))
    origin = identify([rocked(0, 0.3, 1.0)], PANDA, PLAIN)
    assert (there.training[0].rms < 1.2 * origin.training[0].rms).all()
    assert off.training[0].rms[0] > 2.0 * there.training[0].rms[0]
    still = {key: column for key, column in rocked(0, 0.3).signals.items() if key.startswith("gravity")}
    with pytest.raises(InputError, match="has no base_rate, which base_sensor away from the origin needs"):
        identify([replace(rocked(0, 0.3), signals=still)], PANDA, options)


class TestWrench:
    @pytest.fixture(scope="class")
    def identified(self) -> tuple[Identification, Identification]:
        logs = [rocked(0, 0.2, wrench=True)]
        return identify(logs, PANDA, PLAIN), identify([rocked(0, 0.2)], PANDA, PLAIN)

    def test_the_arm_found_by_the_wrench_under_its_base_is_its_own_and_surer(self, identified):
        by_wrench, alone = identified
        assert by_wrench.model.joint_names == PANDA.joint_names
        links = dict(zip([f"{p} {link}" for link in PANDA.link_names for p in PARAMETER_NAMES],
                         link_parameters(PANDA.tree), strict=True))  # fmt: skip
        true = [links.get(name, 0.3 * name.startswith("viscous")) for name in by_wrench.base.parameters.names]
        off = by_wrench.beta - by_wrench.base.combination @ np.array(true)
        assert (np.abs(off) < 5.0 * by_wrench.std + 0.02).all()
        sure = dict(zip(by_wrench.base.names, by_wrench.std, strict=True))
        unsure = dict(zip(alone.base.names, alone.std, strict=True))
        shared = [name for name in sure if name in unsure]
        ratio = [sure[name] / unsure[name] for name in shared]
        assert min(ratio) < 0.5
        assert max(ratio) < 1.1

    @pytest.mark.parametrize("wrong", ["sign", "axes", "point"])
    def test_a_wrench_that_contradicts_the_joints_is_refused(self, wrong):
        log = rocked(0, 0.2, wrench=True)
        F, M = (np.column_stack([log.signals[f"{name}:{a}"] for a in "xyz"]) for name in ("base_force", "base_moment"))
        F, M = {
            "sign": (-F, -M),
            "axes": (F[:, [1, 0, 2]], M[:, [1, 0, 2]]),
            "point": (F, M - np.cross([0.05, 0.0, 0.0], F)),
        }[wrong]
        log = replace(log, signals={**log.signals, **columns(base_force=F, base_moment=M)})
        with pytest.raises(InputError, match="base_force and base_moment contradict the torques of joint q1"):
            identify([log], PANDA, PLAIN)

    def test_a_recording_that_lacks_what_others_have_is_refused(self):
        with pytest.raises(InputError, match='"run1": has no base_force and base_moment, which others have'):
            identify([rocked(0, 0.2, wrench=True), rocked(1, 0.2)], PANDA, PLAIN)
