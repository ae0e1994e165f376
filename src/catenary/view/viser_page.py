"""Page of the view in a browser, by viser: 3D scene, panels as HTML, curves, access control by token.

Only browsers with the token of this run's address are admitted.
"""

import hmac
import logging
import re
import secrets
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from html import escape
from http.client import FORBIDDEN, OK, HTTPConnection
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.errors import CatenaryError
from catenary.monitor import Snapshot
from catenary.spatial import angle_between
from catenary.units import DISPLAY
from catenary.view.page_content import (
    ARMS,
    Change,
    Control,
    Curves,
    PageContent,
    Plot,
    TipPaths,
    Value,
    accepted,
    extent_of,
    joints_by_arm,
    numbers,
    scene_of_robot,
)

_OWN_HOST = re.compile(r"(127\.0\.0\.1|localhost)(:[0-9]{1,5})?")  # any port: it differs behind ssh -L
_REFUSED_TEXT = (
    "Refused: open the whole address that this run printed, at 127.0.0.1 or localhost, and from no other page.\n"
)
_HEADERS = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer", "X-Frame-Options": "DENY"}


@contextmanager
def gated(token: str) -> Iterator[None]:
    """Restrict servers opened by websockets in this context to requests of /TOKEN/ at their own address.

    A browser sends the name of the address in Host, and the requesting page in Origin; other programs send no Origin.
    viser has no hook for it, so `websockets.asyncio.server.serve` is replaced.
    """
    from websockets.asyncio import server

    serve = server.serve

    def with_gate(*args: Any, process_request: Any = None, **options: Any) -> Any:
        def admit(connection: Any, request: Any) -> Any:
            hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
            first, _, below = request.path.partition("?")[0].removeprefix("/").partition("/")
            knows = hmac.compare_digest(first.encode(errors="surrogateescape"), token.encode())
            own = [f"http://{host}" for host in hosts if _OWN_HOST.fullmatch(host)]
            if knows and len(hosts) == len(own) == 1 and origins in ([], own):
                request.path = f"/{below}"
                answer = process_request(connection, request)
            else:
                answer = connection.respond(FORBIDDEN, _REFUSED_TEXT)
            if answer is not None:
                answer.headers.update(_HEADERS)
            return answer

        return serve(*args, process_request=admit, **options)

    server.serve = with_gate  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        server.serve = serve  # type: ignore[misc]


def require_gate(host: str, port: int, token: str) -> None:
    """Raise CatenaryError unless a server admits requests with the token only; later versions of viser might not."""
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket"}
    for path, headers, expected in (("/", {}, FORBIDDEN), ("/", upgrade, FORBIDDEN), (f"/{token}/", {}, OK)):
        with closing(HTTPConnection(host, port, timeout=30.0)) as connection:
            connection.request("GET", path, headers=headers)
            if (status := connection.getresponse().status) != expected:
                raise CatenaryError(
                    f"this viser would let in strangers ({status}, expected {expected:d}): pip install 'viser<1.2'"
                )


_COLOURS = {"reported": "#3b6fb5", "calibrated": "#1f9d55", "true": "#a8a39a"}
_GRAVITY_COLOURS = {"measured": "#7a4fbf", "assumed": "#6d747e"}


def status_html(state: Snapshot) -> str:
    """Return the robot's state and warnings as HTML."""
    lines, warnings = [f"<b>{escape(state.state)}</b> &nbsp; {state.time:.1f} s"], state.warnings()
    lines += [f'<span style="color:#c0392b">&#9888; {escape(warning)}</span>' for warning in warnings]
    if not warnings:
        lines.append('<span style="color:#1f9d55">no warnings</span>')
    return _block("<br>".join(lines))


def joints_html(shown: PageContent, state: Snapshot) -> str:
    """Return an HTML table of joint positions [deg|mm], a column per arm: calibrated with interval, ? out of range."""
    n = shown.model.n
    rows, intervals = joints_by_arm(state, n), numbers(state.interval, n)
    arms = [name for name in rows if name in shown.legend]
    lines = [_row("th", ["", *(f"{_square(_COLOURS[name])} {escape(shown.legend[name])}" for name in arms)])]
    for j, (joint, si) in enumerate(zip(shown.model.joint_names, shown.model.joint_units, strict=True)):
        unit, scale = DISPLAY[si]
        about = f" \u00b1 {scale * intervals[j]:.2f}" if np.isfinite(intervals[j]) else ""
        marks = {"calibrated": f"{about}{'' if state.inside is None or state.inside[j] else '?'}"}
        values = [(scale * rows[name][j], marks.get(name, "")) for name in arms]
        cells = [f"{value:.2f}{mark}" if np.isfinite(value) else "-" for value, mark in values]
        lines.append(_row("td", [escape(f"{joint} [{unit}]"), *cells]))
    return _block(f'<table style="width:100%">{"".join(lines)}</table>')


def _row(kind: str, cells: list[str]) -> str:
    right = f"text-align:right;padding-left:6px;vertical-align:bottom{';white-space:nowrap' if kind == 'td' else ''}"
    placed = [f'<{kind} style="{right if k else ""}">{cell}</{kind}>' for k, cell in enumerate(cells)]
    return f"<tr>{''.join(placed)}</tr>"


def _square(colour: str, *, dashed: bool = False) -> str:
    return f'<span style="color:{colour}">{"&#9476;" if dashed else "&#9632;"}</span>'


def gravity_html(state: Snapshot) -> str:
    """Return the gravity vectors and the angle between them as HTML."""
    lines = []
    for name, vector in (("measured", state.gravity), ("assumed", state.assumed)):
        if vector is not None:
            x, y, z = vector
            lines.append(f"{_square(_GRAVITY_COLOURS[name])} gravity {name}: {x:.2f}, {y:.2f}, {z:.2f} m/s&sup2;")
    if state.gravity is not None and state.assumed is not None:
        lines.append(f"{np.rad2deg(angle_between(state.gravity, state.assumed)):.1f} deg apart")
    if np.isfinite(state.gravity_age):
        lines.append(f"measured {1e3 * state.gravity_age:.0f} ms ago")
    return _block("<br>".join(lines))


def legend_html(plot: Plot) -> str:
    """Return the legend of a plot as HTML: mark, name and present value of each known curve."""
    place = int(np.searchsorted(plot.time, 0.0, side="right")) - 1
    entries = [
        f'<span style="white-space:nowrap;padding-right:0.7em">{_square(curve.colour, dashed=curve.dashed)} '
        f"{escape(curve.label)} {curve.values[place]:.3g}</span>"
        for curve in plot.known()
        if curve.label
    ]
    return _block(" ".join(entries))


def _block(text: str) -> str:
    return f'<div style="font-size:0.75em;padding:0 0.9em 0.4em;line-height:1.5">{text}</div>'


_HOST = "127.0.0.1"  # viser's default is every address
_OPACITY = {"reported": 0.4, "calibrated": 0.55, "true": None}
# offsets from the true arm, so that coincident arms do not flicker; times the arm's length
_SHELL = {"reported": 0.006, "calibrated": 0.003, "true": 0.0}
_ARROW_LENGTH = 0.35  # length of gravity's arrows at 9.81 m/s2, times the arm's
_FROM_NOW = "s from now"
_SKY_LIGHT = 2.0  # light from above and below, in addition to viser's own
_PATH_LEAP_S = 5.0  # [s] between two states, beyond which a path restarts
_PLOT_ASPECT = 1.6
_CURVES_WIDTH, _MAIN_WIDTH, _NARROW_WIDTH = 220, 300, 1000  # pixels; curves are collapsed in windows below the last
_PREPARING = "**Preparing the robot.** It is compiled (the first time up to a minute) and homed, then appears here."


class ViserPage:
    """Page on this machine that draws states, and reports changes of its controls."""

    def __init__(self, shown: PageContent, server: Any, tell: Callable[[Change], None]) -> None:
        """Fill a page of `open_server`; `tell` is called with changes, in another thread."""
        self._shown, self._tell = shown, tell
        self._server = server
        self._paths = TipPaths(shown.shapes.length)
        self._curves = Curves(shown.model, shown.recording, shown.nominal_hz)
        self._time = 0.0  # of the last state
        self._handles: dict[str, Any] = {}  # of controls
        self._values: dict[str, Value] = {}  # last values of controls
        self._joint = 0
        self._visible = dict.fromkeys(ARMS, True)
        self._build_scene()
        self._build_panels()

    @property
    def clients(self) -> int:
        """Number of connected browsers."""
        return len(self._server.get_clients())

    def close(self) -> None:
        """Close the page."""
        self._server.stop()

    # updates

    def draw(self, state: Snapshot) -> None:
        """Update the scene by a state; viser sends differences only."""
        scene = scene_of_robot(self._shown.model, state)
        if not 0.0 <= state.time - self._time <= _PATH_LEAP_S:
            self.forget_paths()
        self._time = state.time
        self._paths.add(scene)
        self._curves.add(state)
        with self._server.atomic():
            self._base.wxyz = scene.base_wxyz
            for name in ARMS:
                arm = scene.arms.get(name)
                self._roots[name].visible = arm is not None and self._visible[name]
                if arm is not None:
                    for node, wxyz, position in zip(self._arms[name], arm.wxyz, arm.positions, strict=True):
                        node.wxyz, node.position = wxyz, position
            for arrow, vector in zip(self._arrows, (scene.measured, scene.assumed), strict=True):
                arrow.wxyz, arrow.visible = scene.base_wxyz, vector is not None
                if vector is not None:
                    length = _ARROW_LENGTH * self._shown.shapes.length
                    arrow.points = np.array([[np.zeros(3), length * vector.round(3)]], np.float32)

    def write(self, state: Snapshot, values: Mapping[str, Value]) -> None:
        """Update texts by a state, and values of controls, less often than the scene."""
        self._status.content = status_html(state)
        self._joints.content = joints_html(self._shown, state)
        self._gravity.content = gravity_html(state)
        for name, value in values.items():
            if name in self._handles and self._values.get(name) != value:
                self._values[name] = value
                self._handles[name].value = value

    def plot(self) -> None:
        """Update the tips' paths and the curves."""
        for name, path in self._path_nodes.items():
            if len(segments := self._paths.segments(name)):
                path.points = segments.astype(np.float32)
                path.colors = np.array(_rgb(_COLOURS[name]), np.uint8)
        with self._server.atomic():
            for (handle, legend), plot in zip(self._plots, self._curves.plots(self._joint), strict=True):
                _draw_plot(handle, plot)
                legend.content = legend_html(plot)

    def forget_paths(self) -> None:
        """Remove the tips' paths."""
        self._paths.clear()
        for path in self._path_nodes.values():
            path.points = np.zeros((1, 2, 3), np.float32)

    # the scene

    def _build_scene(self) -> None:
        scene, shown = self._server.scene, self._shown
        length, (centre, radius) = shown.shapes.length, extent_of(shown)
        scene.set_up_direction("+z")
        scene.configure_default_lights(cast_shadow=False)
        # an environment map costs a browser with software rendering 4 s before the first frame
        scene.configure_environment_map(hdri=None)
        scene.add_light_hemisphere("/sky", ground_color=(150, 150, 160), intensity=_SKY_LIGHT)
        floor = float(centre[2] - 1.05 * radius)
        scene.add_grid(
            "/floor", 4.0 * radius, 4.0 * radius, position=(0.0, 0.0, floor),
            cell_size=_round(radius / 4.0), section_size=_round(radius), shadow_opacity=0.0,
        )  # fmt: skip
        self._base = scene.add_frame("/base", axes_length=0.12 * length, axes_radius=0.006 * length, origin_radius=0.0)
        if shown.shapes.base is not None:
            base = shown.shapes.base
            scene.add_mesh_simple("/base/foot", np.asarray(base.vertices), np.asarray(base.faces), color=(70, 74, 82))
        self._roots: dict[str, Any] = {}
        self._arms = {name: self._add_arm(name) for name in ARMS}
        # next to the arm in the camera's view; it turns with the base but does not move
        corner = centre + radius * np.array([-0.75, -0.8, 0.75])
        self._arrows = [self._add_arrow(name, corner) for name in ("measured", "assumed")]
        empty = np.zeros((1, 2, 3), np.float32)
        self._path_nodes = {
            name: scene.add_line_segments(
                f"/base/path_{name}", empty, _rgb(_COLOURS[name]), thickness=2.0, thickness_units="screen"
            )
            for name in ARMS
        }
        camera = self._server.initial_camera
        camera.look_at = centre
        camera.position = centre + radius * np.array([2.9, -1.9, 1.2])
        camera.fov = np.deg2rad(50.0)

    def _add_arm(self, name: str) -> list[Any]:
        scene, shapes = self._server.scene, self._shown.shapes
        out = _SHELL[name] * shapes.length
        self._roots[name] = scene.add_frame(f"/base/{name}", show_axes=False, visible=False)
        return [
            scene.add_mesh_simple(
                f"/base/{name}/link_{i}", np.asarray(mesh.vertices + out * mesh.vertex_normals), np.asarray(mesh.faces),
                color=_rgb(_COLOURS[name]),
                opacity=_OPACITY[name], side="front", cast_shadow=False, receive_shadow=False,
            )
            for i, mesh in enumerate(shapes.links)
        ]  # fmt: skip

    def _add_arrow(self, name: str, place: Floats) -> Any:
        length = self._shown.shapes.length
        points = np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, -_ARROW_LENGTH * length]]], np.float32)
        size = 1.0 if name == "measured" else 0.8
        arrow = self._server.scene.add_arrows(
            f"/gravity_{name}", points, _rgb(_GRAVITY_COLOURS[name]), shaft_radius=0.009 * size * length,
            head_radius=0.022 * size * length, head_length=0.06 * length, position=place, visible=False,
        )  # fmt: skip
        if name == "measured":
            self._server.scene.add_label("/gravity_measured/label", "gravity", anchor="bottom-center")
        return arrow

    # the panels

    def _build_panels(self) -> None:
        gui, shown = self._server.gui, self._shown
        gui.reset()
        gui.set_panel_label(shown.title)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(_MAIN_WIDTH)
        self._status = gui.add_html("")
        self._joints = gui.add_html("")
        self._gravity = gui.add_html("")
        tabs = gui.add_tab_group()
        for tab in shown.tabs:
            with tabs.add_tab(tab.label):
                if tab.text:
                    gui.add_markdown(tab.text)
                for control in tab.controls:
                    self._handles[control.name] = self._add_control(control)
        with tabs.add_tab("Show"):
            for name in ARMS:
                if name in shown.legend:
                    box = gui.add_checkbox(f"{shown.legend[name]} arm", True)
                    box.on_update(lambda event, name=name: self._visible.__setitem__(name, event.target.value))
            gui.add_button("Clear the tip's paths").on_click(lambda _: self.forget_paths())
        plots = gui.add_panel()
        plots.dock_left()
        plots.set_width(_CURVES_WIDTH)
        with plots.add_tab("Curves"):
            names = shown.model.joint_names
            joint = gui.add_dropdown("joint", names, initial_value=names[0])
            joint.on_update(lambda event: setattr(self, "_joint", names.index(event.target.value)))
            self._plots = [(_add_plot(gui, one, self._curves.span), gui.add_html("")) for one in self._curves.plots(0)]
        self._server.on_client_connect(lambda one: plots.minimize() if one.camera.image_width < _NARROW_WIDTH else None)

    def _add_control(self, control: Control) -> Any:
        gui, name, hint = self._server.gui, control.name, control.hint or None
        handle: Any

        def changed(event: Any) -> None:
            if event.client is None:  # changed by this program
                return
            value = accepted(control, entered := event.target.value)
            if value != entered:
                event.target.value = self._values[name] if value is None else value  # in all browsers
            if value is not None:
                self._values[name] = value
                self._tell(Change(name, value))

        if control.kind == "slider":
            handle = gui.add_slider(control.label, *control.options, initial_value=control.value, hint=hint)
        elif control.kind == "choice":
            handle = gui.add_dropdown(control.label, control.options, initial_value=control.value, hint=hint)
        elif control.kind == "switch":
            handle = gui.add_checkbox(control.label, control.value, hint=hint)
        else:
            handle = gui.add_button_group(control.label, control.options, hint=hint)
        self._values[name] = handle.value
        (handle.on_click if control.kind == "buttons" else handle.on_update)(changed)
        return handle


def open_server(port: int) -> tuple[Any, str]:
    """Open an empty page on a port of this machine only, or the next free one; return it and its address."""
    import viser  # takes most of a second

    logging.getLogger("websockets").setLevel(logging.CRITICAL)
    token = secrets.token_urlsafe(16)
    with gated(token):
        server = viser.ViserServer(host=_HOST, port=port, label="catenary", verbose=False)
    require_gate(_HOST, server.get_port(), token)
    server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
    server.gui.set_panel_label("catenary: preparing ...")
    server.gui.add_markdown(_PREPARING)
    return server, f"http://{_HOST}:{server.get_port()}/{token}/"


def _add_plot(gui: Any, plot: Plot, span: tuple[float, float]) -> Any:
    from viser import uplot

    nothing = (np.zeros(1), np.zeros(1))
    series = (uplot.Series(label=_FROM_NOW), uplot.Series(label=""))
    # seconds from now on a fixed axis: the page keeps its zoom, which a moving axis would reset
    scales = {"x": uplot.Scale(time=False, range=span)}
    return gui.add_uplot(nothing, series, title=plot.title, aspect=_PLOT_ASPECT, scales=scales, legend={"show": False})


def _draw_plot(handle: Any, plot: Plot) -> None:
    """Draw the known curves; series and titles are only set if they change, which is slow."""
    from viser import uplot

    known = plot.known()
    if not known:
        return
    series = [uplot.Series(label=_FROM_NOW)]
    for curve in known:
        line = uplot.Series(label=curve.label, stroke=curve.colour, width=2.0, points={"show": False})
        series.append(uplot.Series(**line, dash=(4.0, 4.0)) if curve.dashed else line)
    if tuple(one["label"] for one in handle.series) != tuple(one["label"] for one in series):
        handle.series = tuple(series)
    handle.data = (plot.time, *(curve.values for curve in known))
    handle.title = plot.title


def _rgb(colour: str) -> tuple[int, int, int]:
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def _round(size: float) -> float:
    """Return the nearest round length [m]: 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(size))
    return float(power * min((1.0, 2.0, 5.0, 10.0), key=lambda x: abs(x - size / power)))
