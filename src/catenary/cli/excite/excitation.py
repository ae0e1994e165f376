"""catenary excitation."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from catenary.cli.excite.collisions import CollisionOptions
from catenary.cli.gravity_source import ImuReading
from catenary.cli.identify import Gravity, gravity_vector
from catenary.cli.options import AsJsonNotTables, robots_beginning
from catenary.cli.out_files import EXCITATION, NAMED_AS_TYPED, TRAJECTORY, out_path, refuse_outputs
from catenary.cli.robots import DescriptionOptions
from catenary.cli.terminal import numbers, print_json, print_notes, print_table
from catenary.errors import InputError


@dataclass(frozen=True)
class LimitOptions:
    """Limits to keep, narrower than the robot's own or in their place where it has none."""

    lower: Annotated[str | None, Option(metavar="Q,Q,...", help="Lower limits to keep, rad and m.")] = None
    upper: Annotated[str | None, Option(metavar="Q,Q,...", help="Upper limits to keep, rad and m.")] = None
    velocity: Annotated[
        str | None, Option(metavar="V,V,...", help="Limits of velocity to keep, rad/s and m/s.")
    ] = None
    acceleration: Annotated[
        str | None,
        Option(metavar="A,A,...", help="Limits of acceleration to keep, rad/s2 and m/s2. [default: none]"),
    ] = None
    effort: Annotated[
        str | None,
        Option(metavar="T,T,...", help="Limits of torque to keep, Nm and N. [default: the robot's]"),
    ] = None

    def values(self) -> dict[str, tuple[float, ...] | None]:
        """Return the limits given, by name."""
        given = {
            name: getattr(self, name) for name in ("lower", "upper", "velocity", "acceleration", "effort")
        }
        return {name: None if text is None else numbers(f"--{name}", text) for name, text in given.items()}


def excitation(
    robot: Annotated[
        str,
        Argument(
            metavar="ROBOT", help="Catalogue name or file; needs no inertia.", autocompletion=robots_beginning
        ),
    ],
    description: DescriptionOptions,
    limits: LimitOptions,
    collisions: CollisionOptions,
    out: Annotated[
        Path,
        Option(
            metavar="FILE",
            parser=out_path,
            help=f"File to write t, q, dq, ddq to, .npz or .csv. {NAMED_AS_TYPED}",
        ),
    ],
    trajectory: Annotated[
        Path | None,
        Option(
            metavar="FILE",
            parser=out_path,
            help="Also write ROS's trajectory_msgs/JointTrajectory, .json or .yaml.",
        ),
    ] = None,
    ros: Annotated[int, Option(metavar="1|2", min=1, max=2, help="ROS that --trajectory is for.")] = 2,
    static: Annotated[int | None, Option(metavar="N", min=1, help="N poses to hold.")] = None,
    fourier: Annotated[bool, Option("--fourier", help="One period of a Fourier motion. [default]")] = False,
    period: Annotated[float, Option("--period-s", metavar="S", help="Period of the motion.")] = 10.0,
    harmonics: Annotated[int, Option(metavar="N", help="Harmonics of the motion, 3 or more.")] = 5,
    rate: Annotated[float, Option("--rate-hz", metavar="F", help="Rows of the motion per second.")] = 200.0,
    trials: Annotated[
        int, Option(metavar="N", min=1, help="Motions to choose from; more trials find a better one.")
    ] = 300,
    torque_noise: Annotated[
        float | None,
        Option(
            metavar="S",
            help="Standard deviation of the torques, Nm and N, for expected errors. [default: 1 % of their limits]",
        ),
    ] = None,
    gravity: Gravity = None,
    imu_reading: ImuReading = None,
    seed: Annotated[int, Option(metavar="N", min=0, help="Seed of everything random.")] = 0,
    as_json: AsJsonNotTables = False,
) -> None:
    """Design a motion that shows an arm's dynamics.

    It keeps the arm's limits and hits nothing; --static designs poses to hold.

    Example: catenary excitation panda --floor-m 0 --out motion.csv
    """
    import numpy as np

    from catenary.identification.motion_limits import room_of
    from catenary.workflows.excitation import (
        comparison_table,
        design_excitation,
        write_excitation,
        write_trajectory,
    )

    if static is not None and (fourier or trajectory is not None):
        raise InputError(f"excitation: give one of --static and --{'fourier' if fourier else 'trajectory'}")
    refuse_outputs({"--out": (out, EXCITATION), "--trajectory": (trajectory, TRAJECTORY)}, [Path(robot)])
    model = description.load(robot)
    given = limits.values()
    if static is not None and given["velocity"] is None:
        given["velocity"] = (1.0,) * model.n  # poses are held: how fast they are reached is the robot's
    room = room_of(model, **given)
    around = collisions.around(robot, model)
    shape: dict[str, Any] = {"period": period, "harmonics": harmonics, "rate": rate, "trials": trials}
    result = design_excitation(
        model,
        room,
        around,
        np.random.default_rng(seed),
        gravity=np.array(gravity_vector(gravity, imu_reading)),
        static=static,
        noise=torque_noise,
        **shape,
    )
    design = result.design
    write_excitation(design, model, out)
    if trajectory is not None:
        write_trajectory(design, model.joint_names, trajectory, ros=ros)
    print_notes([note for note in result.notes if not as_json or note.startswith("warning: ")])
    if as_json:
        files = {"file": str(out), **({} if trajectory is None else {"trajectory": str(trajectory)})}
        print_json({**result.summary(), "seed": seed, **files})
        return
    what = "poses" if design.terms == "static" else f"rows, {design.time[-1]:g} s"
    print(f"{model.name}: {len(design.q)} {what}")
    print(f"condition: {design.condition:.4g} for {design.n_base} base parameters")
    for line in result.kept():
        print(line)
    if result.comparison is not None:
        print_table("Beside other motions of equal length and limits", *comparison_table(result.comparison))
    print(f"file: {out}" if trajectory is None else f"file: {out}\ntrajectory: {trajectory}")
