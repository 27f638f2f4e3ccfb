"""Where relationships of render settings lead."""

from pxr import Sdf, Tf, Usd

from .log import SceneLog


def targets_of(relationship: Usd.Relationship, log: SceneLog, one: bool = False) -> list[Sdf.Path]:
    """Where a relationship leads, through others; with `one` the log hears of more than one."""
    prim = relationship.GetPrim()
    name = relationship.GetName()
    try:
        targets = relationship.GetForwardedTargets()
    except Tf.ErrorException:
        targets = []
    if not targets and relationship.HasAuthoredTargets() and relationship.GetTargets():
        text = f"its {name} leads nowhere: {relationship.GetTargets()[0]} leads to no prim"
        log.warn(prim.GetPath(), "target", text)
    if one and len(targets) > 1:
        text = f"its {name} has {len(targets)} targets; the first, {targets[0]}, is used"
        log.warn(prim.GetPath(), "target", text)
    return targets


def prim_at(stage: Usd.Stage, target: Sdf.Path) -> Usd.Prim:
    """The prim at a path; no prim for the path of a property."""
    return stage.GetPrimAtPath(target) if target.IsPrimPath() else Usd.Prim()


def warn_target(prim: Usd.Prim, name: str, target: Sdf.Path, kind: str, log: SceneLog) -> bool:
    """Says that a relationship names something that is no prim of that kind.

    False where that is so because --mask leaves it out.
    """
    masked = not prim.GetStage().GetPopulationMask().Includes(target.GetPrimPath())
    why = "which --mask leaves out" if masked else f"which is no {kind}"
    log.warn(prim.GetPath(), "target", f"its {name} names {target}, {why}")
    return not masked
