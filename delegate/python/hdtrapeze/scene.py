"""Keeps a session's prims in step with a stage: walks it and sends what is new or has changed.

The walk follows USD's rules: invisible subtrees are left out, purposes are inherited, native
instances of one prototype become one mesh with many places, point instancers place the subtrees
of their prototypes. For the next frame only what may vary in time is read and sent again; after
an edit of the stage, everything.
"""

from dataclasses import dataclass, field

import numpy as np
from pxr import Tf, Usd, UsdGeom, UsdLux, UsdShade, UsdSkel

from .guard import FAULTS, warn_unreadable
from .instances import InstancerReader, NativeInstances, Placement, PointInstances
from .log import SceneLog
from .motion import Motion, MotionReader, Timing
from .passes import PassCollections
from .primvars import WIDTHS, inherited_from, read_primvars
from .session import Session
from .shapes import Shape, find_reader
from .shutter import Shutter
from .skel import Skinning
from .transforms import Level, TransformReader


@dataclass
class _Sent:
    """What the session has of one prim."""

    prim: int
    shape: Shape | None = None
    shape_varies: bool = True
    primvars_vary: bool = True
    primvars: set[str] = field(default_factory=set)
    levels: list[Level] | None = None
    instances: tuple | None = None
    matte: bool = False
    motion: Motion = field(default_factory=Motion)
    double_sided: bool = False


@dataclass(frozen=True)
class _Place:
    """Where the walk is: copies, the subtree's top (its transform included), and a key's prefix."""

    placement: Placement | None = None
    top: Usd.Prim | None = None
    prefix: str = ""
    instancers: tuple = ()


class SceneSync:
    """One stage in one session."""

    def __init__(
        self,
        session: Session,
        log: SceneLog,
        purposes: list[str],
        draw_modes: bool,
        collections: PassCollections | None = None,
    ):
        self._session = session
        self._log = log
        self._purposes = {"default", *purposes}
        self._draw_modes = draw_modes
        self._pass = collections if collections and collections.has_any else None
        self._sent: dict[str, _Sent] = {}
        self._skinning = Skinning(log)
        self._stage: Usd.Stage | None = None
        self._notice = None
        self._pick_ids: dict[str, int] = {}
        self.prim_paths: dict[int, str] = {}
        """Prim path of each primId."""
        self.has_hidden = False
        """Whether the last walk met anything invisible, empty, or left out with a warning."""

    @property
    def mesh_count(self) -> int:
        """Meshes that the session has now."""
        return len(self._sent)

    def sync(self, stage: Usd.Stage, shutter: Shutter, transforms: TransformReader) -> None:
        """Brings the session to the state of `stage` at the frame of `shutter`."""
        if stage != self._stage:
            self._stage = stage
            self._forget_what_was_read()
            self._notice = Tf.Notice.Register(
                Usd.Notice.ObjectsChanged, lambda *_: self._forget_what_was_read(), stage
            )
        self._shutter = shutter
        self._transforms = transforms
        self._motion = MotionReader(shutter, transforms, self._log)
        self._skinning.begin_frame(shutter, transforms)
        self._seen: set[str] = set()
        self.has_hidden = False
        self._ignored = {"lights": 0, "materials": 0}
        self._walk(stage.GetPseudoRoot(), "default", _Place())
        for key in self._sent.keys() - self._seen:
            self._session.remove(self._sent.pop(key).prim)
        if any(self._ignored.values()):
            counts = " and ".join(f"{n} {what}" for what, n in self._ignored.items() if n)
            text = f"{counts} of the stage are not used yet: displayColor and the camera light are"
            self._log.say(20, "", "unsupported-shading", text)

    def _forget_what_was_read(self) -> None:
        for sent in self._sent.values():
            sent.shape = None
            sent.shape_varies = sent.primvars_vary = True
        self._skinning.forget()

    # The walk ------------------------------------------------------------------------------------

    def _walk(self, root: Usd.Prim, purpose: str, place: _Place) -> None:
        """Emits the subtree of `root`; native instances in it are gathered and come last."""
        groups: dict[tuple, list] = {}
        predicate = Usd.PrimDefaultPredicate
        if not predicate(root):
            # Prototypes of point instancers may be classes, or below an `over`.
            predicate = Usd.PrimIsActive & Usd.PrimIsLoaded
        predicate = Usd.TraverseInstanceProxies(predicate)
        self._skinning.enter(root, predicate)
        stack = [(root, purpose, None)]
        while stack:
            prim, purpose, instance = stack.pop()
            if self._pass and self._pass.prunes(prim.GetPath(), place.instancers):
                self.has_hidden = True
                continue
            imageable = UsdGeom.Imageable(prim)
            if imageable:
                visibility = imageable.GetVisibilityAttr().Get(self._shutter.time)
                if visibility == UsdGeom.Tokens.invisible:
                    self.has_hidden = True
                    continue
                if imageable.GetPurposeAttr().HasAuthoredValue():
                    purpose = imageable.GetPurposeAttr().Get()
                try:
                    if prim.IsA(UsdSkel.Root):
                        self._skinning.enter(prim, predicate)
                    if self._visit(prim, purpose, instance, place, groups):
                        continue
                except FAULTS as error:
                    self._leave_out(prim, error)
            elif prim.IsA(UsdShade.Material):
                self._ignored["materials"] += 1
                continue
            below = prim if prim.IsInstance() else instance
            children = prim.GetFilteredChildren(predicate)
            stack += [(child, purpose, below) for child in reversed(children)]
        for key, members in groups.items():
            self._emit_group(key, members, place)

    def _visit(self, prim, purpose, instance, place, groups) -> bool:
        """Emits one imageable prim; True where its children are not to be visited."""
        if self._draw_modes and prim.HasAPI(UsdGeom.ModelAPI):
            self._check_draw_mode(prim)
        if prim.IsA(UsdGeom.PointInstancer):
            if purpose in self._purposes and self._shows(prim, place):
                self._emit_instancer(UsdGeom.PointInstancer(prim), purpose, place)
            return True
        if prim.HasAPI(UsdLux.LightAPI):
            self._ignored["lights"] += 1
        if not prim.IsA(UsdGeom.Gprim) or purpose not in self._purposes:
            return False
        if not self._shows(prim, place):
            return False
        if find_reader(prim) is None:
            self._log.warn(
                prim.GetPath(), "unsupported", f"{prim.GetTypeName()} is not supported yet"
            )
            self.has_hidden = True
            return False
        if instance and not self._transforms.resets_below(prim, instance):
            prototype = prim.GetPrimInPrototype().GetPath()
            matte = self._is_matte(prim, place)
            skinned = self._skinning.of(prim)
            bound = skinned.shared_by(instance) if skinned else None
            motion = self._motion.of(prim)
            key = (prototype, inherited_from(UsdGeom.Gprim(prim)), matte, bound, motion)
            groups.setdefault(key, []).append((prim, instance))
        else:
            levels = self._levels(prim, place.top)
            self._emit(place.prefix + str(prim.GetPath()), prim, levels, place.placement, place)
        return False

    def _is_matte(self, prim: Usd.Prim, place: _Place) -> bool:
        return bool(self._pass) and self._pass.is_matte(prim.GetPath(), place.instancers)

    def _shows(self, prim: Usd.Prim, place: _Place) -> bool:
        """Whether the render pass shows the prim's geometry."""
        if self._pass is None or self._pass.shows(prim.GetPath(), place.instancers):
            return True
        self.has_hidden = True
        return False

    def _levels(self, prim, top=None, below=None) -> list[Level]:
        """Levels of a gprim, which its skeleton may place."""
        skinned = self._skinning.of(prim)
        timing = self._timing(prim)
        if skinned:
            skinned.use(timing.shutter, timing.transforms)
            skinned.place()
        return timing.transforms.levels(prim, top, below)

    def _timing(self, prim: Usd.Prim) -> Timing:
        """What the prim's own motion is read with."""
        return self._motion.timing(self._motion.of(prim))

    def _leave_out(self, prim: Usd.Prim, error: Exception) -> None:
        warn_unreadable(self._log, prim.GetPath(), error, "not rendered")
        self.has_hidden = True

    def _emit_group(self, key, members, place: _Place) -> None:
        """Meshes that share a prototype's prim: one mesh with many places, or simply one."""
        prim, instance = members[0]
        if len(members) == 1:
            levels = self._levels(prim, place.top)
            self._emit(place.prefix + str(prim.GetPath()), prim, levels, place.placement, place)
            return
        transforms = self._timing(prim).transforms
        levels = [transforms.levels(inst, place.top) for _, inst in members]
        placement = NativeInstances(levels, place.placement)
        own = self._levels(prim, below=instance)
        # Prototype paths may differ from one opening of a stage to the next, not within one.
        self._emit(f"{place.prefix}{key}", prim, own, placement, place)

    def _emit_instancer(self, instancer, purpose, place: _Place) -> None:
        path = instancer.GetPath()
        if path in place.instancers:
            self._log.warn(path, "instancer-loop", "it is among its own prototypes; left out there")
            return
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        reader = InstancerReader(instancer, self._shutter, self._log)
        if not len(reader.indices):
            return
        visible = reader.visible()
        wrong = (reader.indices < 0) | (reader.indices >= len(targets))
        if wrong.any():
            count = f"{int(wrong.sum())} protoIndices"
            text = f"{count} point at none of its {len(targets)} prototypes; left out"
            self._log.warn(path, "topology", text)
        levels = self._transforms.levels(instancer.GetPrim(), place.top)
        for number, target in enumerate(targets):
            chosen = np.flatnonzero((reader.indices == number) & visible)
            if not len(chosen):
                continue
            if self._pass and self._pass.prunes_with_parents(target):
                continue
            prototype = self._stage.GetPrimAtPath(target)
            if not prototype:
                self._log.warn(path, "prototype", f"its prototype {target} does not exist")
                continue
            placement = PointInstances(reader, chosen, levels, place.placement)
            prefix = f"{place.prefix}{path}[{number}]"
            self._walk(
                prototype, purpose, _Place(placement, prototype, prefix, (*place.instancers, path))
            )

    def _check_draw_mode(self, prim) -> None:
        model = UsdGeom.ModelAPI(prim)
        mode = model.ComputeModelDrawMode()
        if model.GetModelApplyDrawModeAttr().Get() and mode not in ("default", "inherited", ""):
            text = f"draw mode {mode} is not supported yet; its geometry is rendered in full"
            self._log.warn(prim.GetPath(), "draw-mode", text)

    # One mesh ------------------------------------------------------------------------------------

    def _emit(
        self, key: str, prim: Usd.Prim, levels: list[Level], placement, place: _Place
    ) -> None:
        """Sends what the session does not have yet of one mesh; a faulty one is left out."""
        try:
            self._send(key, prim, levels, placement)
            self._send_matte(key, self._is_matte(prim, place))
            self._send_motion(key, self._motion.of(prim))
            if key in self._sent:
                self._session.complete(self._sent[key].prim)
        except FAULTS as error:
            self._seen.discard(key)
            self._leave_out(prim, error)

    def _send(self, key: str, prim: Usd.Prim, levels: list[Level], placement) -> None:
        sent = self._sent.get(key)
        if sent is None or sent.shape_varies:
            sent = self._send_shape(key, sent, prim)
            if sent is None:
                return
        self._seen.add(key)
        session, shutter = self._session, self._timing(prim).shutter
        if sent.primvars_vary:
            primvars = read_primvars(UsdGeom.Gprim(prim), shutter, self._log)
            skinned = self._skinning.of(prim)
            if skinned:
                skinned.turn_normals(primvars, sent.shape)
            for name in WIDTHS:
                if name in primvars or name in sent.primvars:
                    session.set_primvar(sent.prim, name, primvars.get(name))
            sent.primvars = set(primvars)
            sent.primvars_vary = any(primvar.varies for primvar in primvars.values())
        if sent.levels is None or not _same_levels(sent.levels, levels):
            session.set_transform(sent.prim, levels)
            sent.levels = levels
        instances = None
        if placement is not None:
            instances = (*placement.samples(shutter), placement.ids)
        if not _same_arrays(sent.instances, instances):
            if instances is None:
                session.clear_instances(sent.prim)
            else:
                session.set_instances(sent.prim, *instances)
            sent.instances = instances

    def _send_matte(self, key: str, matte: bool) -> None:
        sent = self._sent.get(key)
        if sent and sent.matte != matte:
            self._session.set_matte(sent.prim, matte)
            sent.matte = matte

    def _send_motion(self, key: str, motion: Motion) -> None:
        sent = self._sent.get(key)
        if sent and sent.motion != motion:
            self._session.set_motion(sent.prim, motion)
            sent.motion = motion

    def _send_shape(self, key: str, sent: _Sent | None, prim: Usd.Prim) -> _Sent | None:
        """Geometry; None for a prim that has none."""
        before = sent.shape if sent else None
        shape = find_reader(prim)(prim, self._timing(prim).shutter, self._log, before)
        self._skinning.deform(prim, shape, before)
        if shape.is_empty:
            self.has_hidden = True  # nothing to say, nothing to draw
            return None
        if sent is None:
            sent = _Sent(self._session.create(shape.kind, str(prim.GetPath())))
            self._sent[key] = sent
            # A prim that comes and goes keeps its number.
            pick_id = self._pick_ids.setdefault(key, len(self._pick_ids))
            self._session.set_pick_id(sent.prim, pick_id)
            self.prim_paths[pick_id] = str(prim.GetPath())
        shape.send(self._session, sent.prim, before)
        double_sided = bool(UsdGeom.Gprim(prim).GetDoubleSidedAttr().Get())
        if sent.double_sided != double_sided:
            self._session.set_double_sided(sent.prim, double_sided)
            sent.double_sided = double_sided
        # What is never read again need not be kept.
        keep = shape.varies or self._skinning.of(prim)
        sent.shape = shape if keep else None
        sent.shape_varies = shape.varies
        return sent


def _same_arrays(a: tuple | None, b: tuple | None) -> bool:
    if a is None or b is None:
        return a is b
    return all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


def _same_levels(a: list[Level], b: list[Level]) -> bool:
    return len(a) == len(b) and all(
        np.array_equal(x.times, y.times) and np.array_equal(x.matrices, y.matrices)
        for x, y in zip(a, b, strict=True)
    )
