"""A robot on ROS in a project: homed, driven, recorded and deployed on, with a person beside it where one is needed.

What a person has to do is asked for, and done when the robot's own topics show it: encoders when their readings come,
the start button when it is homed, the pedal when it is ENABLED. Whatever ends a step, the robot holds and is paused.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from catenary.calibration.model import CalibrationModel
from catenary.crtk.client import CrtkClient
from catenary.crtk.transport import Transport
from catenary.errors import NotReadyError
from catenary.plant import JointState, OperatingState
from catenary.recording.journal import About
from catenary.trajectories.reference import Reference, Trajectory
from catenary.workflows.project.deploy import deploy_on_robot
from catenary.workflows.project.folder import Project, write
from catenary.workflows.project.kinds import ProjectKind, kind_of
from catenary.workflows.project.robot import ProjectRobot, Take, set_aside
from catenary.workflows.robot.guide import LOOK, PATIENCE, AnswerYes, Check, Guide, clear_workspace, have_done
from catenary.workflows.robot.homing import HOMING, home_client
from catenary.workflows.robot.motion import check_motion, move_to, run_trajectory
from catenary.workflows.robot.rest import at_rest_afterwards, pause, paused_if_interrupted
from catenary.workflows.robot.topic_recorder import TopicRecorder, refuse_missing

COLLECT_EVERY = 20  # ticks between two looks at what has come
SOON = 3.0  # [s] in which encoders that are mounted read, once the robot has homed


class RosRobot(ProjectRobot):
    """A RAVEN-II's arm behind a transport."""

    def __init__(
        self,
        transport: Transport,
        guide: Guide,
        *,
        simulated: bool = False,
        patience: float = PATIENCE,
        homing_patience: float = HOMING,
    ) -> None:
        """Take a transport; the robot is looked for when a step needs it.

        Args:
            transport: Brings and takes messages; stays open.
            guide: Asks the person beside the robot.
            simulated: What is behind the topics, which do not say it.
            patience: [s] until the robot must report what a person has done.
            homing_patience: [s] from the press of its button until it must be homed.
        """
        self._transport, self._guide = transport, guide
        self._simulated, self._patience = simulated, patience
        self._homing_patience = homing_patience
        self._is_clear = False  # whether the workspace was said to be

    def home(self, project: Project) -> bool:
        """Home it with its encoders mounted; return whether that had to be done."""
        path = project.folder / "robot" / "home.json"

        def work() -> None:
            path.parent.mkdir(exist_ok=True)
            with self._connected(project) as client, paused_if_interrupted(client):
                self._make_homed(client, project)
                pause(client)  # nobody moves it now; one that homes by its own button is paused already
                believed, encoders = client.measured_js().q, client.external_encoders()
                found = {
                    "joint_names": client.joint_names,
                    "believed": believed,
                    "external_encoders": encoders,
                }
                write(path, {"simulated": self._simulated, **found})

        return project.run("home", _robot_settings(project), [path], work)

    def drive(self, project: Project, take: Take) -> None:
        """Record over the robot's topics; a recording that was interrupted is begun anew."""
        with self._connected(project) as client, paused_if_interrupted(client):
            joints = kind_of(project.settings).joints
            check_motion(client, take.trajectory, joints=joints)
            self._make_homed(client, project)
            client.require_free()
            with at_rest_afterwards(client):
                self._enable(client)
                move_to(client, take.trajectory(0.0).q, joints=joints)
                set_aside(project, take.name)
                self._record(client, project, take)

    def deploy(
        self, project: Project, model: CalibrationModel, trajectory: Trajectory, *, after: str
    ) -> Mapping[str, Any]:
        """Run a model in a 1 kHz loop around the robot; errors are against the external encoders' latest reading."""
        with self._connected(project) as client, paused_if_interrupted(client):
            self._make_homed(client, project)
            client.require_free()
            with at_rest_afterwards(client):
                self._enable(client)
                found = deploy_on_robot(client, model, trajectory, real_time=not self._simulated)
        return found.as_data()

    def _connected(self, project: Project) -> CrtkClient:
        return kind_of(project.settings).client(self._transport, simulated=self._simulated)

    def _make_homed(self, client: CrtkClient, project: Project) -> None:
        """Home it if it is not, with encoders whose readings come."""
        if not self._is_clear:
            clear_workspace(self._guide)
            self._is_clear = True
        if isinstance(self._guide, AnswerYes) and client.operating_state().state == "FAULT":
            raise NotReadyError("the robot is in FAULT; clear the fault by hand: --yes does not clear it")
        kind = kind_of(project.settings)
        if not client.operating_state().is_homed:
            self._have(
                kind.encoders, lambda: self._no_encoders(kind)
            )  # their readings count from the homing on
            home_client(client, self._guide, patience=self._homing_patience)
        if not self._comes(lambda: _not_registered(client, kind)):
            self._have(kind.encoders, lambda: _not_registered(client, kind))

    def _enable(self, client: CrtkClient) -> None:
        if client.operating_state().state == "ENABLED":
            return
        if (
            isinstance(self._guide, AnswerYes) or client.dialect == "crtk"
        ):  # a dVRK has no pedal that enables it
            client.state_command("resume" if client.operating_state().state == "PAUSED" else "enable")
        pedal = "press the pedal, so that the robot is ENABLED"
        self._have(pedal, lambda: _not_enabled(client.operating_state()))

    def _have(self, text: str, missing: Check) -> None:
        have_done(self._guide, text, missing, self._transport.sleep, patience=self._patience)

    def _comes(self, missing: Check) -> bool:
        """Wait a little for what needs nobody's help; return whether the robot reports it."""
        for _ in range(round(SOON / LOOK)):
            if missing() is None:
                return True
            self._transport.sleep(LOOK)
        return missing() is None

    def _no_encoders(self, kind: ProjectKind) -> str | None:
        topic = kind.required[-1].name
        return None if topic in self._transport.topics() else f"nobody publishes {topic}"

    def _record(self, client: CrtkClient, project: Project, take: Take) -> None:
        kind = kind_of(project.settings)
        made = {"motion": take.motion}
        about = About(robot=kind.recorded_as, simulated=self._simulated, configuration=made)
        tick = 0

        with TopicRecorder(self._transport, take.folder, kind.topics, about=about) as recorder:

            def observe(_: JointState, __: Reference) -> None:
                nonlocal tick
                tick += 1
                if tick % COLLECT_EVERY == 0:
                    recorder.collect()

            run_trajectory(
                client, take.trajectory, joints=kind.joints, observe=observe, progress=take.progress
            )
            recorder.collect()
            refuse_missing(recorder.counts, [topic.name for topic in kind.required])
        for problem in recorder.problems():
            self._guide.say(problem)


def _not_enabled(now: OperatingState) -> str | None:
    return None if now.state == "ENABLED" else f"the robot is {now.state}"


def _not_registered(client: CrtkClient, kind: ProjectKind) -> str | None:
    """Return what is wrong with the encoders of a homed robot, or None."""
    if np.isfinite(client.external_encoders()).all():
        return None
    return f"no reading comes on {kind.required[-1].name}"


def _robot_settings(project: Project) -> Any:
    settings = project.settings
    place = [settings.namespace] if settings.robot == "dvrk_psm" else []
    return [settings.robot, settings.side, settings.connection, *place]
