"""The renderer as a Python object: a stage and a frame in, AOVs and files out."""

import threading

import numpy as np
from pxr import Usd, UsdGeom, UsdRender

from .camera import CameraState, effective_shutter, find_camera, framing_camera, read_camera
from .errors import Interrupted, SceneError
from .interrupts import ignored
from .log import SceneLog
from .options import Options
from .passes import PassCollections
from .primvars import wanted_primvars
from .scene import SceneSync
from .session import Session
from .transforms import TransformReader

POLL_SECONDS = 0.1


class Renderer:
    """Renders frames of stages. Keyword arguments are those of :class:`Options`.

    Use it in a `with` block, or call `close`. Frames of one stage after another are cheap: only
    what varies is read and diced again. The collections of `render_pass` say what is left out and
    what is held out. `options` may be replaced between frames, but for purposes and draw modes.
    """

    def __init__(
        self,
        options: Options | None = None,
        log: SceneLog | None = None,
        render_pass: UsdRender.Pass | None = None,
        **settings,
    ):
        self.options = options or Options(**settings)
        self.options.validate()
        self.log = log or SceneLog()
        self.session = Session(self.log)
        self._scene = SceneSync(
            self.session,
            self.log,
            self.options.purposes,
            self.options.draw_modes,
            PassCollections(render_pass, self.log),
        )
        self._camera_ids: dict[str, int] = {}
        self.camera: CameraState | None = None
        self.resolution = (0, 0)

    def close(self) -> None:
        """Frees the renderer's memory."""
        self.session.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    @property
    def prim_paths(self) -> dict[int, str]:
        """Prim path of each primId."""
        return self._scene.prim_paths

    def load(
        self,
        stage: Usd.Stage,
        frame: float | None = None,
        camera: UsdGeom.Camera | None = None,
        render_settings: UsdRender.Settings | None = None,
    ) -> None:
        """Reads a frame (None: the default time) of a stage.

        Without `camera`, the one of the options, the settings, the primary one, or one that
        frames the bounds.
        """
        options = self.options
        if camera is None:
            camera = find_camera(stage, options.camera, render_settings, self.log)
        # A held stage steps from value to value: nothing moves between its frames.
        held = stage.GetInterpolationType() == Usd.InterpolationTypeHeld
        still = held or not options.motion_blur
        shutter = effective_shutter(camera, frame, options.shutter, still, self.log)
        transforms = TransformReader(shutter, self.log)
        purposes = ["default", *(p for p in options.purposes if p != "default")]
        state = (
            read_camera(camera, shutter, transforms, self.log)
            if camera
            else framing_camera(stage, shutter, purposes)
        )
        self.camera = state
        # First of all, so that prims can be diced for them while others are read.
        self.session.set_camera(self.camera_id(state.path), state)
        self._apply_settings()
        self._scene.ask_for_primvars(wanted_primvars(options.aovs))
        self._scene.sync(stage, shutter, transforms)
        if not (self._scene.mesh_count or self._scene.has_hidden):
            self.log.warn("", "empty", "the stage has nothing to render for the purposes asked for")

    def camera_id(self, path: str) -> int:
        """The session's camera of a path; the one that frames the bounds has none."""
        if path not in self._camera_ids:
            self._camera_ids[path] = self.session.create("camera", path or "/framing_camera")
        return self._camera_ids[path]

    def _apply_settings(self) -> None:
        options = self.options
        self.resolution = options.resolution(self.camera.aspect)
        named = options.named()
        # The camera has it, and what moves was read for it.
        named.pop("shutter", None)
        self.session.set_settings(named, **options.image(self.camera.aspect))
        self.session.set_aovs(list(dict.fromkeys(options.aovs)))

    def commit(self) -> None:
        """Dices and builds what was loaded; `render` does so too."""
        self._in_background(self.session.commit, None)

    def render(self, on_progress=None) -> None:
        """Renders what was loaded. `on_progress` gets a trz_progress about ten times a second.

        KeyboardInterrupt cancels the render, keeps what it had, and comes out as Interrupted.
        """
        self._in_background(self._start_and_wait, on_progress)
        progress = self.session.progress()
        if on_progress:
            on_progress(progress)
        if progress.state == 5:
            raise SceneError("The render failed.")

    def _start_and_wait(self) -> None:
        self.session.start()
        self.session.wait(-1.0)

    def _in_background(self, work, on_progress) -> None:
        """Runs `work` beside this thread, which stays free for signals and progress."""
        errors: list[BaseException] = []

        def run():
            try:
                work()
            except BaseException as error:
                errors.append(error)

        worker = threading.Thread(target=run, name="hdtrapeze", daemon=True)
        worker.start()
        try:
            while worker.is_alive():
                worker.join(POLL_SECONDS)
                if on_progress and worker.is_alive():
                    on_progress(self.session.progress())
        except KeyboardInterrupt as interrupt:
            with ignored():
                self.session.cancel()
                worker.join()
            raise Interrupted("Interrupted.", getattr(interrupt, "terminated", False)) from None
        if errors:
            raise errors[0]

    def aov(self, name: str) -> np.ndarray:
        """An AOV of the last render, rows top down; linear. With overscan it is larger than the
        image: see `aov_origin`."""
        return self.session.aov(name)

    def aov_origin(self, name: str) -> tuple[int, int]:
        """Column and row of the image that the first pixel of `aov(name)` is in; (0, 0) but for
        overscan."""
        return self.session.aov_origin(name)

    def statistics(self) -> dict[str, float]:
        """Statistics of the last render."""
        return self.session.statistics()

    def explain(self) -> str:
        """Which effects the renderer simulates for what was committed, and why."""
        return self.session.explain()


def render_stage(stage: Usd.Stage, frame: float | None = None, **settings) -> dict[str, np.ndarray]:
    """Renders one frame and gives all its AOVs by name. Keyword arguments as for Options."""
    with Renderer(**settings) as renderer:
        renderer.load(stage, frame)
        renderer.render()
        return {name: renderer.aov(name) for name in renderer.options.aovs}
