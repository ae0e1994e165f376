"""An unknown load on any link of a simulated 7-joint arm, at any time: what the on-line estimator believes of it."""

import numpy as np

from catenary import RobotModel, gravity_torque, load_robot
from catenary.arrays import Floats
from catenary.gravity.estimator import RecursiveGravityEstimator
from catenary.gravity.load_location import LOAD
from catenary.gravity.payload import Payload
from catenary.spatial import LEVEL
from papers.experiment import Result, run
from papers.regressor.decomposition import with_bodies

GEOMETRY = "panda"  # seven turning joints; masses are drawn
LIGHTEST, HEAVIEST = 0.1, 2.0  # [kg]
FURTHEST = 0.12  # [m] of the load from the origin of its link's frame, along each axis
SIZES = (0.8, 0.06)  # [kg, kg m] root mean squares of these masses and moments
NOISE = 0.1  # [Nm] that the estimator is told
POSES_BEFORE = (20, 40)  # poses at rest before the load comes, at the least and at most
LOOKED_AT = (1, 2, 5, 10, 20)  # poses with the load, after which beliefs are noted


def arm(seed: int | None) -> RobotModel:
    """Return an arm whose masses are drawn."""
    return with_bodies(load_robot(GEOMETRY), np.random.default_rng(100 if seed is None else seed))


def poses(model: RobotModel, count: int, rng: np.random.Generator) -> Floats:
    """Draw poses (count, n) in the middle 80 % of the joints' ranges."""
    middle, half = 0.5 * (model.lower + model.upper), 0.4 * (model.upper - model.lower)
    drawn: Floats = middle + half * rng.uniform(-1.0, 1.0, size=(count, model.n))
    return drawn


def trial(
    model: RobotModel, rng: np.random.Generator, noise: float, *, loaded: bool, load: tuple[float, float] = LOAD
) -> Result:
    """Let an arm learn itself, take up a load, and go through more poses; return what was believed on the way.

    Args:
        model: The arm.
        rng: Draws the load, the poses and the noise.
        noise: Standard deviation of the torques' noise [Nm].
        loaded: A load comes.
        load: What the estimator is told of loads: root mean squares of mass [kg] and moment [kg m].
    """
    link = int(rng.integers(len(model.link_names)))
    mass = float(np.exp(rng.uniform(np.log(LIGHTEST), np.log(HEAVIEST))))
    place = rng.uniform(-FURTHEST, FURTHEST, 3)
    name = model.link_names[link]
    carrying = Payload(mass, name, place).on(model) if loaded else model
    estimator = RecursiveGravityEstimator(
        model, noise=NOISE, settle=0.0, interval=0.0, novelty=0.0, forgetting=1.0, margin=-1.0,
        carriers=model.link_names, load=load,
    )  # fmt: skip
    before = int(rng.integers(*POSES_BEFORE, endpoint=True))
    q = poses(model, before + LOOKED_AT[-1], rng)
    gravity = np.concatenate([gravity_torque(model, q[:before], LEVEL), gravity_torque(carrying, q[before:], LEVEL)])
    tau = gravity + noise * rng.normal(size=q.shape)
    rest = np.zeros(model.n)
    seen = []
    alarm = False
    for k in range(len(q)):
        estimator.update(q[k], rest, tau[k], LEVEL, float(k))
        count = k - before + 1
        if count == 0:
            alarm = estimator.load is not None and estimator.load.no_load < 0.5
        if count in LOOKED_AT:
            beliefs = estimator.load
            if beliefs is None:
                seen.append({"poses": count, "no_load": 1.0})
                continue
            first = beliefs.carriers[0]
            there = next(one for one in beliefs.carriers if one.frame == name)
            given = first.probability / max(1.0 - beliefs.no_load, 1e-12)  # if there is a load
            seen.append(
                {
                    "poses": count,
                    "no_load": beliefs.no_load,
                    "right": first.frame == name,
                    "probability": given,
                    "likely": len(beliefs.likely),
                    "among_likely": name in beliefs.likely,
                    "mass_error_kg": first.mass - mass,
                    "mass_error_there_kg": there.mass - mass,
                    "mass_std_kg": first.mass_std,
                }
            )
    return {"link": link + 1 if loaded else 0, "mass_kg": mass if loaded else 0.0, "alarm": alarm, "seen": seen}


@run(revision=3)
def payload_trials(seed: int | None, noise_ratio: float, told_sizes: bool, trials: int) -> Result:
    """Try loads on an arm, every fourth time none.

    Args:
        seed: Of the arm.
        noise_ratio: True noise over what the estimator is told.
        told_sizes: The estimator is told how large these loads are; else it takes what the package comes with.
        trials: How many.
    """
    model = arm(seed)
    load = SIZES if told_sizes else LOAD
    # not the numbers on which the estimator's settings were chosen
    rng = np.random.default_rng([20261123, 0 if seed is None else seed + 1])
    return {
        "trials": [
            trial(model, rng, noise_ratio * NOISE, loaded=number % 4 != 3, load=load) for number in range(trials)
        ]
    }
