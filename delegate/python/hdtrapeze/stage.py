"""Opens stages, and hears what USD has to say about them."""

import logging
import re
from pathlib import Path

from pxr import Ar, Sdf, Tf, Usd, UsdUtils

from .errors import InputError, UsageError
from .guard import reason
from .log import SceneLog


class Diagnostics:
    """While it lives, USD's own messages go to the log and not raw to stderr."""

    def __init__(self, log: SceneLog):
        self._log = log
        self._delegate = UsdUtils.CoalescingDiagnosticDelegate()

    def report(self, stage: Usd.Stage | None = None) -> None:
        """Logs what USD has said since; with a stage just opened, its composition errors too."""
        for error in stage.GetCompositionErrors() if stage else ():
            self._log.warn(error.rootSite.path, "composition", _one_line(str(error)))
        for message in self._delegate.TakeUncoalescedDiagnostics():
            # The stage has named these itself; what schemas say of a prim, who reads it has said,
            # but for transform ops.
            named = stage and message.sourceFunction.endswith("UsdStage::_ReportErrors")
            source = message.sourceFileName.replace("\\", "/")
            read = "/usdSkel/" in source or ("/usdGeom/" in source and "/usdGeom/xf" not in source)
            if not named and not read:
                status = "STATUS" in message.diagnosticCodeString
                level = logging.INFO if status else logging.WARNING
                text = _one_line(message.commentary)
                prim = re.search(r"<(/[^>.]*)", text)
                self._log.say(level, prim[1] if prim else "", "usd", text)


def _one_line(text: str) -> str:
    """The text without line breaks and without the address of the session layer."""
    return " ".join(re.sub(r",@anon:[^@]*@", "", text).split()).removesuffix(".")


def open_layer(path: str) -> Sdf.Layer:
    """The layer at `path`; raises InputError where it is missing or cannot be read."""
    if not path:
        raise InputError("The file to read has no name.")
    try:
        layer = Sdf.Layer.FindOrOpen(path)
    except Tf.ErrorException as error:
        raise InputError(f"{path} cannot be read: {reason(error)}.") from None
    if layer is None:
        if not Path(path).exists():
            raise InputError(f"{path} does not exist.")
        raise InputError(f"{path} is not a file that USD can read.")
    return layer


def open_stage(
    path: str,
    mask: str | None = None,
    session_layer: str | None = None,
    resolver: str = "root",
    log: SceneLog | None = None,
) -> Usd.Stage:
    """Opens the stage at `path`; `mask` is a list of prim paths joined by commas or spaces.

    The log hears of paths of the mask that are no prims.
    """
    root = open_layer(path)
    session = open_layer(session_layer) if session_layer else Sdf.Layer.CreateAnonymous()
    asset_resolver = Ar.GetResolver()
    if resolver == "inherit":
        context = asset_resolver.CreateDefaultContext()
    else:
        context = asset_resolver.CreateDefaultContextForAsset(path)
    try:
        mask_paths = (mask or "").replace(",", " ").split()
        if not mask_paths:
            return Usd.Stage.Open(root, session, context)
        population = Usd.StagePopulationMask()
        for prim_path in mask_paths:
            if not Sdf.Path.IsValidPathString(prim_path) or not prim_path.startswith("/"):
                raise UsageError(f"--mask: {prim_path!r} is not the absolute path of a prim.")
            population.Add(Sdf.Path(prim_path))
        stage = Usd.Stage.OpenMasked(root, session, context, population)
    except Tf.ErrorException as error:
        raise InputError(f"{path} cannot be opened as a stage: {reason(error)}.") from None
    for prim_path in mask_paths if log else ():
        if not stage.GetPrimAtPath(prim_path):
            log.warn(prim_path, "mask", "--mask names it, but there is no such prim")
    return stage
