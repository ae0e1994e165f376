"""How a simulated arm is set up: what its base does, what it carries, its drives and the sensor on its base."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from catenary.cli.gravity_source import SensingOptions
from catenary.cli.options import BaseTilt, SimulatedSeed
from catenary.cli.robots import DescriptionOptions
from catenary.cli.terminal import base_tilt, numbers
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.sensing.imu import SensedGravity
    from catenary.simulation.base_motion import MovingBase, Wave
    from catenary.workflows.gravity.simulated_arm import SimulatedArm

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_WAVE = "M/S2,HZ[,DEG]"


@dataclass(frozen=True)
class Conditions:
    """Options of a simulated arm: its base, its payload, its drives, its seed."""

    base_tilt_deg: BaseTilt = None
    rock_deg: Annotated[
        str | None,
        Option(metavar="FROM,TO", help="Rock the base about its y axis between these angles, once tilted."),
    ] = None
    rock_hz: Annotated[float, Option(metavar="F", min=0.0, help="Frequency of --rock-deg.")] = 1.0
    rock: Annotated[
        list[str] | None,
        Option(
            metavar="AXIS,DEG,HZ[,DEG]",
            help="Rock the base to either side about its x, y or z axis, with a phase; repeatable, outermost first.",
        ),
    ] = None
    heave: Annotated[
        list[str] | None,
        Option(metavar=_WAVE, help="Accelerate the base up and down, with a phase; repeatable."),
    ] = None
    surge: Annotated[list[str] | None, Option(metavar=_WAVE, help="The same along the world's x axis.")] = (
        None
    )
    sway: Annotated[list[str] | None, Option(metavar=_WAVE, help="The same along the world's y axis.")] = None
    payload: Annotated[
        float, Option(metavar="KG", min=0.0, help="Mass at the tool's wrist; the model knows nothing of it.")
    ] = 0.0
    kp: Annotated[
        str | None,
        Option(metavar="K,K,...", help="Stiffness of PD in Nm/rad and N/m: one number, or one a joint."),
    ] = None
    kd: Annotated[
        str | None, Option(metavar="K,K,...", help="Damping of PD in Nms/rad and Ns/m, likewise.")
    ] = None
    friction: Annotated[
        str | None,
        Option(
            metavar="F,F,...", help="Coulomb friction of the joints in Nm and N; RAVENs have their cables'."
        ),
    ] = None
    viscous: Annotated[
        str | None, Option(metavar="F,F,...", help="Viscous friction in Nms/rad and Ns/m, likewise.")
    ] = None
    simulated_imu: Annotated[
        bool,
        Option(
            "--simulated-imu",
            help="Take gravity from a simulated inertial unit on the base, and not as it truly is; each option of "
            "the sensor asks for it too.",
        ),
    ] = False
    sensor_bias: Annotated[
        str | None,
        Option(metavar="X,Y,Z", help="What is left of the unit's bias after its calibration, in m/s2."),
    ] = None
    seed: SimulatedSeed = None

    def as_data(self) -> dict[str, Any]:
        """Return plain data, for the JSON and the page."""
        given = {name: value for name, value in asdict(self).items() if value not in (None, False)}
        return given | {
            "base_tilt_deg": base_tilt(self.base_tilt_deg),
            "rock_deg": self._rocking(),
            "rock_hz": None if self.rock_deg is None else self.rock_hz,
            "payload": self.payload,
            "seed": self.seed,
        }

    def _rocking(self) -> tuple[float, ...] | None:
        return None if self.rock_deg is None else numbers("--rock-deg", self.rock_deg, 2)

    def base(self) -> "MovingBase":
        """Return what the arm stands on."""
        import numpy as np

        from catenary.simulation.base_motion import FixedBase, RockingBase, SwayingBase

        rocking = self._rocking()
        _require_finite("--rock-deg", rocking or ())
        _require_finite("--rock-hz", (self.rock_hz,))
        roll, pitch = np.deg2rad(base_tilt(self.base_tilt_deg))
        start = FixedBase(float(roll), float(pitch))
        rocks = tuple(_rock(text) for text in self.rock or ())
        moves = tuple(
            _wave(option, text, axis)
            for option, axis, texts in (
                ("--heave", "z", self.heave),
                ("--surge", "x", self.surge),
                ("--sway", "y", self.sway),
            )
            for text in texts or ()
        )
        if rocking is None:
            return SwayingBase(rocks, moves, start) if rocks or moves else start
        if rocks or moves:
            raise InputError(
                "--rock-deg: rocks about one axis alone; beside --heave, ... write --rock y,DEG,HZ"
            )
        first, last = np.deg2rad(rocking)
        middle, reach = float(first + last) / 2.0, float(last - first) / 2.0
        return RockingBase(middle, reach, self.rock_hz, axis=(0.0, 1.0, 0.0), start=start)

    def arm(self, robot: str, description: DescriptionOptions) -> "SimulatedArm":
        """Return the robot on its base."""
        from catenary.workflows.gravity.simulated_arm import simulated_arm

        drives = {
            name: _per_joint(f"--{name}", getattr(self, name)) for name in ("kp", "kd", "friction", "viscous")
        }
        return simulated_arm(
            robot,
            base=self.base(),
            payload=self.payload,
            seed=self.seed,
            massless=description.declared(),
            strict=description.strict,
            **drives,
        )

    def gravity(self, arm: "SimulatedArm", sensing: SensingOptions) -> "SensedGravity | None":
        """Return a simulated unit on the base as a source of gravity; None where gravity is as it truly is."""
        if not (self.simulated_imu or self.sensor_bias is not None or sensing != SensingOptions()):
            return None
        from catenary.workflows.gravity.simulated_arm import base_sensor

        bias = (0.0, 0.0, 0.0) if self.sensor_bias is None else numbers("--sensor-bias", self.sensor_bias, 3)
        sensor, told = base_sensor(
            self.base(), start=arm.plant.measured_js().time, bias=bias, noise=sensing.sensor_noise,
            seed=self.seed or 0,
        )  # fmt: skip
        return sensing.source(sensor.mailbox, told, angular=True, feed=sensor.advance)


def _rock(text: str) -> "Wave":
    import numpy as np

    from catenary.simulation.base_motion import Wave

    axis, _, rest = text.partition(",")
    if axis.strip() not in _AXES:
        raise InputError(f'--rock "{text}": expected AXIS,DEG,HZ with axis x, y or z, as x,8,0.1')
    amplitude, frequency, phase = _amplitude_frequency_phase("--rock", rest)
    return Wave(float(np.deg2rad(amplitude)), frequency, _AXES[axis.strip()], phase)


def _wave(option: str, text: str, axis: str) -> "Wave":
    from catenary.simulation.base_motion import Wave

    amplitude, frequency, phase = _amplitude_frequency_phase(option, text)
    return Wave(amplitude, frequency, _AXES[axis], phase)


def _amplitude_frequency_phase(option: str, text: str) -> tuple[float, float, float]:
    import numpy as np

    values = numbers(option, text)
    _require_finite(option, values)
    if len(values) not in (2, 3) or values[1] < 0.0:
        raise InputError(
            f'{option} "{text}": expected an amplitude, a frequency of 0 Hz or more, and a phase in deg if any'
        )
    return values[0], values[1], float(np.deg2rad(values[2])) if len(values) == 3 else 0.0


def _per_joint(option: str, text: str | None) -> "float | tuple[float, ...] | None":
    """Return one number for all joints, or one for each; None where nothing is given."""
    if text is None:
        return None
    values = numbers(option, text)
    return values[0] if len(values) == 1 else values


def _require_finite(option: str, values: Sequence[float]) -> None:
    import numpy as np

    if not np.isfinite(values).all():
        raise InputError(f"{option}: expected finite numbers, got {', '.join(f'{v:g}' for v in values)}")
