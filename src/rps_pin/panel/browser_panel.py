"""Panel in the browser: the robot in viser's page, with all that moves it, on this machine only."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Self

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import RPSPinError
from rps_pin.panel.guarded_server import guarded_server, stop
from rps_pin.panel.history import History
from rps_pin.panel.page import texts
from rps_pin.panel.page.charts import UNITS, Charts
from rps_pin.panel.page.gizmo import Gizmo
from rps_pin.panel.page.worker import Worker
from rps_pin.panel.panel import Panel
from rps_pin.panel.pose_file import PoseFile
from rps_pin.panel.recording import SPEEDS, Player
from rps_pin.panel.slider import Slider, beyond
from rps_pin.plain_text import plain
from rps_pin.viewer import Layer, View
from rps_pin.viewer.writers.viser_writer import ViserWriter

_FRAME, _TEXTS, _PLOTS = 1.0 / 30.0, 0.1, 0.25
"""Least times between pictures, texts and plots of a motion that is played, s."""
_PATIENCE = 1.5
"""After which sliders go back from what was refused, s: a number is typed digit by digit."""
_RED = (0.84, 0.10, 0.10)
_RIGHT, _LEFT = 350, 310
"""Widths of the columns, pixels."""
_BACK = 1.15
"""The camera is so much farther away than in the exported page, which has no columns."""
_HANDLE = 0.38
"""Length of the handle's arrows, in radii of the robot."""
_NO_POSE = "(none)"


class BrowserPanel:
    """A panel on a page of its own, served while a ``with`` block lasts.

    Parameters
    ----------
    panel
        An `RPSPanel` or a `MechanismPanel`. A trajectory that it has loaded is played in the page.
    port
        The port to serve on. Default: a free one from 8080 on.
    title
        Plain text, above the sliders.
    layers, hidden
        Layers as for `rps_pin.viewer.View`, with a switch for each below the readings; those in
        `hidden` are switched off at first. Forces are those that hold the weight, and of a
        trajectory those that move it.
    poses
        Named poses that the page can go to, and add to.

    Attributes
    ----------
    url : str
        Address to open in a browser on this machine. A token in it lets the page in; requests
        without it, from pages of other sites, or by another name of this machine, are refused.
    view : View
        The robot with its layers.
    player : Player or None
        The clock of the trajectory.

    Raises
    ------
    RPSPinError
        If viser is not installed; says how to install it.
    InputError
        If the port cannot be used, or a layer is unknown or does not fit the mechanism.
    """

    def __init__(
        self,
        panel: Panel,
        *,
        port: int | None = None,
        title: str = "Robot",
        layers: Sequence[str | Layer] = (),
        hidden: Sequence[str | Layer] = (),
        poses: PoseFile | None = None,
    ) -> None:
        self._panel, self._poses, self._history = panel, poses, History()
        self._shown: dict[str, list[float]] = {}
        self._asked: dict[str, dict[int, float]] = {}
        self._beyond: dict[str, float] = {}
        self._red: frozenset[str] = frozenset()
        self._notice, self._replace = "", ""
        self._due_at: dict[str, tuple[float, Callable[[], object]]] = {}
        self._texts_at = 0.0
        self.player = None if panel.recording is None else Player(panel.recording.duration)
        self._worker = Worker(self._due)
        self._server: Any
        self._server, self.url = guarded_server(port, self._refused)
        self._writer = ViserWriter(self._server, self._switched)
        try:
            self._build(title, layers, hidden)
            self._refresh()
            if panel.recording is None:
                self._plot()
            else:
                self._charts.show_recording(panel.recording)
            self._worker.start()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End the server."""
        self._worker.end()
        stop(self._server)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def text(self) -> str:
        """The state and the readings, as HTML."""
        return "".join(str(one.content) for one in (self._state, self._table, self._remarks))

    def move(self, group: str, shown: Sequence[float]) -> None:
        """Set the sliders of a group, in the units they show, as a user of the page does."""
        for (_, handle), value in zip(self._sliders[group], shown, strict=True):
            handle.value = value

    def shown(self, group: str) -> list[float]:
        """Return where the sliders of a group are, in the units they show."""
        return [float(handle.value) for _, handle in self._sliders[group]]

    # The page -------------------------------------------------------------------------------------

    def _build(
        self, title: str, layers: Sequence[str | Layer], hidden: Sequence[str | Layer]
    ) -> None:
        gui, panel = self._server.gui, self._panel
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(_RIGHT)
        gui.add_html(texts.STYLE)
        self._heading = gui.add_html(texts.heading(title))
        self._sliders: dict[str, list[tuple[Slider, Any]]] = {}
        for group, sliders in panel.groups.items():
            units = {one.unit for one in sliders}
            gui.add_html(texts.group(group, units))
            self._sliders[group] = [
                (one, self._slider(group, k, value, short=len(units) == 1))
                for k, (one, value) in enumerate(zip(sliders, panel.values(group), strict=True))
            ]
        self._buttons("go to", {"Home": self._go_home, "Reset": self._reset})
        self._state = gui.add_html("")  # below the sliders, which it must not move
        self._remarks = gui.add_html("")
        with gui.add_folder("layers"):
            shadows = gui.add_checkbox("shadows", True, hint="off: faster where there is no GPU")
            shadows.on_update(lambda event: self._writer.set_shadows(event.target.value))
            if panel.handle is not None:
                tick = gui.add_checkbox("handle", True, hint="arrows and rings that drag the frame")
                tick.on_update(lambda event: self._gizmo.set_visible(event.target.value))
            self.view = self._view(layers, hidden)
            self.view.updates_hidden = False
        self._gizmo: Any = None
        if panel.handle is not None:
            size = _HANDLE * self.view.scene.box.radius
            self._gizmo = Gizmo(self._server.scene, panel.handle, size, self._dragged)
        if self._poses is not None:
            self._add_poses()
        beside = gui.add_panel()
        with beside.add_tab("in time"):
            self._mark = gui.add_html(texts.mark(None))
            if self.player is not None:
                self._add_player(self.player)
            self._table = gui.add_html("")
            self._charts = Charts(gui, panel)
        beside.dock_left()
        beside.set_width(_LEFT)
        camera = self._server.initial_camera  # for the space between the columns, which is narrow
        middle = np.asarray(camera.look_at)
        camera.position = middle + _BACK * (np.asarray(camera.position) - middle)
        self._server.on_client_connect(self._check_frame)

    def _view(self, layers: Sequence[str | Layer], hidden: Sequence[str | Layer]) -> View:
        panel = self._panel
        return View(
            self._writer,
            getattr(panel, "robot", panel.mechanism),
            panel.motion,
            visual=panel.visual_model(),
            layers=layers,
            hidden=hidden,
        )

    def _slider(self, group: str, number: int, value: float, *, short: bool) -> Any:
        one = self._panel.groups[group][number]
        now = _shown(one, float(value))
        marks = [end for end in one.limits if one.low <= end <= one.high]
        handle = self._server.gui.add_slider(
            plain(one.label if short else f"{one.label}, {UNITS[one.unit]}"),
            min=min(one.low, now),
            max=max(one.high, now),
            step=one.step,
            initial_value=now,
            marks=[(end, f"{end:.4g}") for end in marks or (one.low, one.high)],
            hint=f"limits: {one.limits[0]:.6g} to {one.limits[1]:.6g} {one.unit}"
            if marks
            else None,
        )
        handle.precision = len(f"{one.step:.6f}".rstrip("0").partition(".")[2])
        handle.on_update(lambda event: self._ask(group, number, float(event.target.value)))
        return handle

    def _buttons(self, label: str, jobs: dict[str, Callable[[], object]]) -> Any:
        """Add buttons in a row."""
        buttons = self._server.gui.add_button_group(label, list(jobs))
        buttons.on_click(lambda event: self._worker.submit(label, jobs[event.target.value]))
        return buttons

    def _add_player(self, player: Player) -> None:
        gui = self._server.gui
        self._clock = gui.add_html(texts.clock(0.0, player.duration))
        self._buttons(
            "trajectory", {"Play": lambda: self._play(True), "Pause": lambda: self._play(False)}
        )
        self._scrub = gui.add_slider(
            "time, s",
            min=0.0,
            max=player.duration,
            step=player.duration / 1000,
            initial_value=0.0,
            marks=[(0.0, "0"), (player.duration, f"{player.duration:.4g}")],
        )
        self._scrub.precision = 3
        self._scrub_shown = 0.0
        self._scrub.on_update(lambda event: self._ask_time(float(event.target.value)))
        speed = gui.add_dropdown("speed", [f"{one:g}" for one in SPEEDS], initial_value="1")

        def set_speed() -> None:
            player.speed = float(speed.value)

        speed.on_update(lambda _: self._worker.submit("speed", set_speed))

    def _add_poses(self) -> None:
        gui = self._server.gui
        with gui.add_folder("poses"):
            self._saved = gui.add_dropdown("saved", self._names())
            self._buttons("pose", {"Go": self._go_to_pose, "Save as": self._save_pose})
            self._name = gui.add_text("name", "")

    def _names(self) -> list[str]:
        assert self._poses is not None
        return [plain(name) for name in self._poses.poses] or [_NO_POSE]

    # What a user does -----------------------------------------------------------------------------

    def _ask(self, group: str, number: int, shown: float) -> None:
        """Note where a slider is put, and follow it soon; not where it is put here."""
        if shown != self._shown[group][number]:
            self._asked.setdefault(group, {})[number] = shown
            self._worker.submit(("move", group), lambda: self._follow(group))

    def _follow(self, group: str) -> None:
        """Follow the sliders of a group."""
        values, sliders = self._panel.values(group), self._sliders[group]
        asked = self._asked.pop(group, {})
        for number, shown in asked.items():
            one, handle = sliders[number]
            typed = self._beyond.pop(handle._impl.uuid, None)
            if typed is not None and _is_cut(handle, shown, typed):
                self._settle()
                return
            values[number] = shown / one.scale
            self._shown[group][number] = shown
        self._by_hand()
        followed = self._panel.move(group, values)
        self._refresh(but=group)
        if followed:
            self._due_at.pop("settle", None)
        else:
            self._later("settle", _PATIENCE, self._settle)

    def _refused(self, handle: Any, value: float) -> None:
        """Say, from viser's thread, that a number beyond its slider was typed."""
        for one, mine in itertools.chain(*self._sliders.values()):
            if mine is handle:
                self._worker.submit("refused", partial(self._refuse, one, handle, value))

    def _refuse(self, one: Slider, handle: Any, value: float) -> None:
        self._beyond[handle._impl.uuid] = value
        self._panel.refuse(beyond(one, value))
        self._write()
        self._later("settle", 2.0 * _PATIENCE, self._settle)

    def _settle(self) -> None:
        """Put all sliders where the robot is."""
        self._put_sliders(None, again=True)

    def _dragged(self, placement: Array, ended: bool) -> None:
        """Follow the handle: told by viser's thread."""
        self._worker.submit("drag", lambda: self._drag(placement))
        if ended:
            self._worker.submit("drag ended", self._place_handle)

    def _drag(self, placement: Array) -> None:
        self._by_hand()
        self._panel.drag(placement)
        self._refresh()

    def _place_handle(self) -> None:
        if self._gizmo is not None:
            self._gizmo.place(self._panel.configuration)

    def _switched(self, name: str, visible: bool) -> None:
        """Show or hide a layer: told by viser's thread."""

        def switch() -> None:
            self.view.set_visible(name, visible)
            self._draw()

        self._worker.submit(("layer", name), switch)

    def _go_home(self) -> None:
        self._by_hand()
        self._panel.home()
        self._refresh()

    def _reset(self) -> None:
        """Go home, forget the last seconds, and put clock and camera at their beginning."""
        self._by_hand()
        self._panel.home()
        self._history.clear()
        if self.player is not None:
            self.player.time = 0.0
            self._plot_recording()
            self._show_time()
        for client in self._server.get_clients().values():
            self._frame(client)
        self._refresh()

    def _check_frame(self, client: Any) -> None:
        """Put a page's camera at its beginning, where viser on a busy machine may not have it."""
        wanted = np.asarray(self._server.initial_camera.position)
        if not np.allclose(client.camera.position, wanted, rtol=0.01):
            self._frame(client)

    def _frame(self, client: Any) -> None:
        """Put a page's camera where it was at the beginning, or farther in a narrow window."""
        camera = self._server.initial_camera
        middle = np.asarray(camera.look_at)
        back = max(1.0, 1.0 / client.camera.aspect / _BACK)
        client.camera.position = middle + back * (np.asarray(camera.position) - middle)
        client.camera.look_at = middle

    def _by_hand(self) -> None:
        """Pause the trajectory: the robot is moved by hand."""
        self._notice = ""
        if self.player is not None and self.player.playing:
            self.player.play(False)
        self._later("plots", _PLOTS, self._plot)

    def _go_to_pose(self) -> None:
        assert self._poses is not None
        name = self._saved.value
        found = {plain(one): values for one, values in self._poses.poses.items()}.get(name)
        self._by_hand()
        if found is None:
            self._notice = "no pose is saved yet"
        else:
            self._panel.move(self._poses.group, found)
        self._refresh()

    def _save_pose(self) -> None:
        assert self._poses is not None
        poses, name = self._poses, self._name.value.strip()
        try:
            replace = name == self._replace and bool(name)
            poses.save(name, self._panel.values(poses.group), replace=replace)
            self._notice, self._replace = "", ""
            self._saved.options = self._names()
            self._saved.value = plain(name)
        except RPSPinError as error:
            self._notice = str(error)
            if name in poses.poses:
                self._notice += "; press 'Save as' again to replace it"
                self._replace = name
        self._write()

    # Trajectory -----------------------------------------------------------------------------------

    def _play(self, playing: bool) -> None:
        assert self.player is not None
        self._plot_recording()
        self.player.play(playing)
        self._show_moment()

    def _ask_time(self, elapsed: float) -> None:
        """Go to a time soon; not where the clock is put here."""
        if elapsed != self._scrub_shown:
            self._worker.submit("time", lambda: self._seek(elapsed))

    def _seek(self, elapsed: float) -> None:
        assert self.player is not None
        self.player.play(False)
        self.player.time = elapsed
        self._plot_recording()
        self._show_moment()

    def _show_moment(self) -> None:
        """Show the trajectory now, and again soon if it plays."""
        assert self.player is not None
        self._panel.show(self.player.time)
        self._show_time()
        now = time.monotonic()
        if self.player.playing:
            self._later("frame", _FRAME, self._show_moment)
        if not self.player.playing or now > self._texts_at:
            self._texts_at = now + _TEXTS
            self._refresh(remember=False)
        else:
            self._draw()

    def _show_time(self) -> None:
        assert self.player is not None
        elapsed, duration = self.player.time, self.player.duration
        self._clock.content = texts.clock(elapsed, duration)
        self._mark.content = texts.mark(elapsed / duration)
        self._scrub_shown = elapsed
        self._scrub.value = elapsed

    def _plot_recording(self) -> None:
        assert self._panel.recording is not None
        self._notice = ""
        self._due_at.pop("plots", None)
        self._charts.show_recording(self._panel.recording)

    # Showing --------------------------------------------------------------------------------------

    def _refresh(self, but: str | None = None, *, remember: bool = True) -> None:
        """Show the robot, the readings, and the sliders of all other groups where it is."""
        self._draw()
        self._write()
        self._put_sliders(but)
        if remember:
            panel = self._panel
            row = np.hstack([panel.position, panel.forces, panel.conditioning])
            self._history.add(time.monotonic(), row)

    def _draw(self) -> None:
        """Show the robot."""
        panel = self._panel
        self.view.display(panel.configuration, panel.velocity, panel.acceleration)
        red = frozenset(one for joint in panel.outside for one in self._beside(joint))
        for joint in red ^ self._red:
            self.view.scene.set_joint_colour(joint, _RED if joint in red else None)
        self._red = red
        if self._gizmo is not None:
            self._gizmo.place(panel.configuration)

    def _beside(self, joint: str) -> list[str]:
        """Return the joints that carry the links on both sides of a joint."""
        model = self._panel.mechanism.model
        index = model.getJointId(joint)
        return [model.names[one] for one in (index, model.parents[index]) if one > 0]

    def _write(self) -> None:
        """Show the readings."""
        self._state.content = texts.state(self._panel, self._notice)
        self._remarks.content = texts.remarks(self._panel)
        self._table.content = texts.actuators(self._panel)

    def _put_sliders(self, but: str | None, *, again: bool = False) -> None:
        """Put sliders where the robot is; `again` those too that are said to be there."""
        for group in self._panel.groups.keys() - {but}:
            values, shown = self._panel.values(group).tolist(), []
            for (one, handle), value in zip(self._sliders[group], values, strict=True):
                shown.append(min(max(_shown(one, value), handle.min), handle.max))
            self._shown[group] = shown
            for (_, handle), value in zip(self._sliders[group], shown, strict=True):
                if again and handle.value == value:  # the page may show what was refused
                    handle._queue_update("value", value)
                handle.value = value

    def _plot(self) -> None:
        """Plot the last seconds."""
        self._mark.content = texts.mark(None)
        self._charts.show_history(self._history, len(self._panel.actuators))

    # Time -----------------------------------------------------------------------------------------

    def _later(self, key: str, delay: float, job: Callable[[], object]) -> None:
        """Do a job after a time; one with the same key that waits already is put off, or stays."""
        due = time.monotonic() + delay
        if key == "plots" and key in self._due_at:
            return
        self._due_at[key] = (due, job)

    def _due(self) -> float | None:
        """Do what is due; return the seconds until something else is."""
        now = time.monotonic()
        for key, (due, job) in list(self._due_at.items()):
            if due <= now:
                del self._due_at[key]
                job()
        if not self._due_at:
            return None
        return max(0.0, min(due for due, _ in self._due_at.values()) - time.monotonic())


def _shown(one: Slider, value: float) -> float:
    """Return a value in the unit shown; rounding errors about zero are zero."""
    shown = one.scale * value
    return 0.0 if abs(shown) < 1e-6 * one.step else shown


def _is_cut(handle: Any, now: float, typed: float) -> bool:
    """Return whether a slider's value is what its page makes of a number beyond it."""
    end = handle.max if typed > handle.max else handle.min
    return bool(now == end and not f"{end:g}".startswith(f"{typed:g}"))
