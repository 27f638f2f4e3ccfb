"""Keeps a session's prims in step with a stage: walks it and sends what is new or has changed.

The walk follows USD's rules: invisible subtrees are left out, purposes are inherited. What point
instancers and native instances place is walked once a prototype, and is part of an instancer of
the session. In native instances only what differs between them (what they inherit, skeletons, what
a render pass says) is looked at in each, and prims that it concerns are split. For the next frame
only what may vary in time is read and sent again; after an edit of the stage, everything.
"""

from collections.abc import Generator
from dataclasses import dataclass, field, replace

import numpy as np
from pxr import Kind, Tf, Usd, UsdGeom, UsdLux, UsdShade, UsdSkel

from .guard import FAULTS, warn_unreadable
from .inherited import Inherited, digest
from .instances import read_point_instancer
from .log import SceneLog
from .motion import Motion, MotionReader, Timing
from .passes import PassCollections
from .places import NONE, Natives, Place, PointInstancer, PointPart, run_nested, short_prefix
from .primvars import SHADED, instance_primvars, read_primvars
from .prototypes import Holders
from .session import Session
from .shapes import Shape, find_reader
from .shutter import Shutter
from .skel import Skinning
from .subsets import warn_of_unused
from .transforms import Level, TransformReader
from .typed import get_or_fallback, get_or_ignore, might_vary, token

VISIBILITIES = ("inherited", "invisible")
PURPOSES = ("default", "render", "proxy", "guide")

Walk = Generator["Walk", None, bool | None]
"""A walk that yields walks of what is nested in it, see run_nested."""


@dataclass
class _Sent:
    """What the session has of one prim."""

    prim: int
    shape: Shape | None = None
    shape_varies: bool = True
    primvars_vary: bool = True
    primvars: set[str] = field(default_factory=set)
    levels: list[Level] | None = None
    part: tuple[int, int] = NONE
    matte: bool = False
    motion: Motion = field(default_factory=Motion)
    double_sided: bool = False


@dataclass
class _SentInstancer:
    """What the session has of one instancer."""

    instancer: int
    levels: list[Level] | None = None
    part: tuple[int, int] = NONE
    motion: Motion = field(default_factory=Motion)
    prototypes: list[int] = field(default_factory=list)
    """Those that have instances."""
    varies: bool = True
    primvars: set[str] = field(default_factory=set)
    primvars_vary: bool = True


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
        self._instancers: dict[str, _SentInstancer] = {}
        self._native_numbers: dict[str, dict[str, int]] = {}
        self._skinning = Skinning(log)
        self._primvar_names = SHADED
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

    def ask_for_primvars(self, names: tuple[str, ...]) -> None:
        """Which primvars the next sync sends."""
        if names != self._primvar_names:
            self._primvar_names = names
            for sent in (*self._sent.values(), *self._instancers.values()):
                sent.primvars_vary = True

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
        self._skel_roots = Holders(UsdSkel.Root)
        self._inherited = Inherited(shutter, self._primvar_names)
        self.has_hidden = False
        self._ignored = {"lights": 0, "materials": 0}
        run_nested(self._walk([(stage.GetPseudoRoot(), "default")], Place()))
        for key in self._sent.keys() - self._seen:
            self._session.remove(self._sent.pop(key).prim)
        for key in self._instancers.keys() - self._seen:
            self._session.remove(self._instancers.pop(key).instancer)
        if any(self._ignored.values()):
            counts = " and ".join(f"{n} {what}" for what, n in self._ignored.items() if n)
            text = f"{counts} of the stage are not used yet: displayColor and the camera light are"
            self._log.say(20, "", "unsupported-shading", text)

    def _forget_what_was_read(self) -> None:
        for sent in self._sent.values():
            sent.shape = None
            sent.shape_varies = sent.primvars_vary = True
        for sent in self._instancers.values():
            sent.varies = sent.primvars_vary = True
        self._skinning.forget()

    # The walk ------------------------------------------------------------------------------------

    def _walk(self, roots: list[tuple[Usd.Prim, str]], place: Place) -> Walk:
        """Emits subtrees, each with the purpose that it inherits; native instances come last."""
        groups: dict[tuple, list[Usd.Prim]] = {}
        if not roots:
            return
        predicate = Usd.PrimDefaultPredicate
        if not predicate(roots[0][0]):
            # Prototypes of point instancers may be classes, or below an `over`.
            predicate = Usd.PrimIsActive & Usd.PrimIsLoaded
        predicate = Usd.TraverseInstanceProxies(predicate)
        self._skinning.enter(roots[0][0], predicate)
        stack = list(reversed(roots))
        while stack:
            prim, purpose = stack.pop()
            if self._pass and not place.natives and self._prunes(prim, place):
                continue
            imageable = UsdGeom.Imageable(prim)
            if imageable:
                if self._is_invisible(imageable):
                    self.has_hidden = True
                    continue
                purpose = self._purpose(imageable, purpose)
                try:
                    if prim.IsA(UsdSkel.Root):
                        self._enter_skeletons(prim, place, predicate)
                    if (yield from self._visit(prim, purpose, place)):
                        continue
                except FAULTS as error:
                    self._leave_out(prim, error)
                    if prim.IsA(UsdGeom.PointInstancer):
                        continue  # its prototypes are no prims by themselves
            elif prim.IsA(UsdShade.Material):
                self._ignored["materials"] += 1
                continue
            elif prim.GetTypeName() and not prim.GetPrimTypeInfo().GetSchemaTypeName():
                text = f"{prim.GetTypeName()} is no type that USD knows here; it is not rendered"
                self._log.warn(prim.GetPath(), "unknown-type", text)
            if prim.IsInstance() and place.natives:
                place.natives.nested.append((prim, purpose))
                continue
            if prim.IsInstance():
                key = (prim.GetPrototype().GetPath(), purpose, self._home(prim, place) is place)
                groups.setdefault(key, []).append(prim)
                continue
            children = prim.GetFilteredChildren(predicate)
            stack += [(child, purpose) for child in reversed(children)]
        for (prototype, purpose, _), members in groups.items():
            home = self._home(members[0], place)
            yield from self._walk_natives(str(prototype), purpose, members, home)

    def _is_invisible(self, imageable: UsdGeom.Imageable) -> bool:
        attribute, time = imageable.GetVisibilityAttr(), self._shutter.time
        authored = attribute.HasAuthoredValue()
        return authored and token(attribute, VISIBILITIES, time, self._log) == "invisible"

    def _purpose(self, imageable: UsdGeom.Imageable, inherited: str) -> str:
        """The prim's own purpose, where it has one."""
        attribute, time = imageable.GetPurposeAttr(), Usd.TimeCode.Default()
        if not attribute.HasAuthoredValue() or get_or_ignore(attribute, time, self._log) is None:
            return inherited
        return token(attribute, PURPOSES, time, self._log)

    def _home(self, prim: Usd.Prim, place: Place) -> Place:
        """The place that a prim's levels end in, which may ignore native instances around it."""
        while place.outer and self._transforms.resets_below(prim, place.below):
            place = place.outer
        return place

    def _enter_skeletons(self, root: Usd.Prim, place: Place, predicate) -> None:
        """Reads the bindings below a SkelRoot, in each of the native instances that it is in."""
        self._skinning.enter(root, predicate)
        if place.natives:
            for proxy in self._proxies(root, place.natives).values():
                self._skinning.enter(proxy, predicate)

    def _proxies(self, prim: Usd.Prim, natives: Natives) -> dict[int, Usd.Prim]:
        """What `prim`, which is in the first of native instances, is in each of them."""
        first = natives.first
        return {
            number: self._in_instance(prim, first, member.GetPath())
            for number, member in natives.members.items()
        }

    def _in_instance(self, prim: Usd.Prim, first: Usd.Prim, other) -> Usd.Prim:
        """What `prim` in the instance `first` is in the instance at the path `other`."""
        return self._stage.GetPrimAtPath(prim.GetPath().ReplacePrefix(first.GetPath(), other))

    def _walk_natives(
        self, prototype: str, purpose: str, members: list[Usd.Prim], place: Place
    ) -> Walk:
        """Emits native instances of one prototype."""
        predicate = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
        if len(members) == 1:
            # It stands for itself.
            children = members[0].GetFilteredChildren(predicate)
            yield self._walk([(child, purpose) for child in children], place)
            return
        key = short_prefix(f"{place.prefix}<{prototype} {purpose}>")
        # An instance that comes and goes keeps its number.
        numbers = self._native_numbers.setdefault(key, {})
        by_number = {numbers.setdefault(str(p.GetPath()), len(numbers)): p for p in members}
        natives = Natives(self, place, key, by_number, len(numbers))
        first = natives.first
        everything = natives.everything()
        inside = replace(place, part=everything, top=None, below=first, prefix=key, outer=place)
        # Each instance may be another where a skeleton or a render pass looks at it.
        alike = not self._pass and not self._has_skeletons(first)
        what = {n: self._outside_of(p, None if alike else n) for n, p in by_number.items()}
        if len(set(what.values())) > 1:
            inside = replace(inside, natives=natives)
        children = first.GetFilteredChildren(predicate)
        yield self._walk([(child, purpose) for child in children], inside)
        # Instances and instancers in them are walked once for all that are alike.
        for number, kind, part in natives.classes(what) if natives.nested else ():
            instance = by_number[number]
            path = instance.GetPath()
            paths = [
                (p.GetPath().ReplacePrefix(first.GetPath(), path), o) for p, o in natives.nested
            ]
            roots = [(self._stage.GetPrimAtPath(path), own) for path, own in paths]
            prefix = f"{key}#{digest(kind)}"
            there = replace(inside, part=part, below=instance, prefix=prefix, natives=None)
            yield self._walk(roots, there)

    def _has_skeletons(self, prim: Usd.Prim) -> bool:
        """Whether a SkelRoot is above `prim`, or below it."""
        return bool(UsdSkel.Root.Find(prim)) or self._skel_roots.below(prim)

    def _outside_of(self, instance: Usd.Prim, number: int | None) -> tuple:
        """What prims in a native instance may get from outside of it."""
        return self._inherited.below(instance), self._motion.of(instance), number

    def _visit(self, prim: Usd.Prim, purpose: str, place: Place) -> Walk:
        """Emits one imageable prim; returns True where its children are not to be visited."""
        if self._draw_modes and (prim.IsModel() or prim.HasAPI(UsdGeom.ModelAPI)):
            self._check_draw_mode(prim)
        if prim.IsA(UsdGeom.PointInstancer):
            if place.natives:
                place.natives.nested.append((prim, purpose))
            elif purpose in self._purposes and self._shows(prim, place):
                yield from self._walk_instancer(UsdGeom.PointInstancer(prim), purpose, place)
            return True
        if prim.HasAPI(UsdLux.LightAPI):
            self._ignored["lights"] += 1
        if not prim.IsA(UsdGeom.Gprim) or purpose not in self._purposes:
            return False
        if not place.natives and not self._shows(prim, place):
            return False
        if find_reader(prim) is None:
            self._log.warn(
                prim.GetPath(), "unsupported", f"{prim.GetTypeName()} is not supported yet"
            )
            self.has_hidden = True
            return False
        home = self._home(prim, place)
        if home.natives:
            self._emit_in_natives(prim, home)
        else:
            levels = self._levels(prim, home.top, home.below)
            self._emit(place.prefix + str(prim.GetPath()), prim, levels, home)
        return False

    def _emit_in_natives(self, prim: Usd.Prim, place: Place) -> None:
        """A prim in native instances that may differ: once for all of those that are alike."""
        natives = place.natives
        proxies = self._proxies(prim, natives)
        kinds = {}
        for number, proxy in proxies.items():
            if self._pass and (self._prunes(proxy, place, True) or not self._shows(proxy, place)):
                continue
            skinned = self._skinning.of(proxy)
            bound = skinned.shared_by(natives.members[number]) if skinned else None
            matte = self._is_matte(proxy, place)
            kinds[number] = (self._inherited.by(proxy), matte, bound, self._motion.of(proxy))
        path = str(prim.GetPath().MakeRelativePath(natives.first.GetPath()))
        for number, kind, part in natives.classes(kinds):
            proxy, instance = proxies[number], natives.members[number]
            levels = self._levels(proxy, below=instance)
            key = f"{place.prefix}{path}#{digest(kind)}"
            self._emit(key, proxy, levels, replace(place, part=part))

    def _prunes(self, prim: Usd.Prim, place: Place, with_parents: bool = False) -> bool:
        """Whether the render pass leaves the prim out with all below it."""
        path = prim.GetPath()
        pruned = self._pass.prunes(path, place.instancers)
        if pruned or (with_parents and self._pass.prunes_with_parents(path)):
            self.has_hidden = True
            return True
        return False

    def _is_matte(self, prim: Usd.Prim, place: Place) -> bool:
        return bool(self._pass) and self._pass.is_matte(prim.GetPath(), place.instancers)

    def _shows(self, prim: Usd.Prim, place: Place) -> bool:
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

    def _walk_instancer(self, instancer, purpose, place: Place) -> Walk:
        """Emits the prototypes of a point instancer that have instances."""
        prim, path = instancer.GetPrim(), instancer.GetPath()
        if path in place.instancers:
            self._log.warn(path, "instancer-loop", "it is among its own prototypes; left out there")
            return
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        point = PointInstancer(self, prim, self._home(prim, place), f"{place.prefix}{path}")
        sent = self._instancers.get(point.key)
        if sent and not sent.varies:
            used = sent.prototypes
        else:
            shutter = self._timing(prim).shutter
            point.arrays = read_point_instancer(instancer, len(targets), shutter, self._log)
            used = point.arrays.used_prototypes()
            if not len(used) and point.arrays.points_nowhere():
                count, known = point.arrays.count, len(targets)
                text = f"{count} of {count} protoIndices point at none of its {known} prototypes"
                self._log.warn(path, "topology", f"{text}; it is not rendered")
        if not len(used):
            self.has_hidden = True
        names = frozenset(instance_primvars(prim, self._primvar_names))
        for number in used:
            target = targets[number]
            if self._pass and self._pass.prunes_with_parents(target):
                continue
            prototype = self._stage.GetPrimAtPath(target)
            if not prototype or not prototype.IsActive():
                what = "is not active" if prototype else "does not exist"
                self._log.warn(path, "prototype", f"its prototype {target} {what}")
                continue
            inside = Place(
                part=PointPart(point, int(number)),
                top=prototype,
                prefix=short_prefix(f"{point.key}[{number}]"),
                instancers=(*place.instancers, path),
                given=((target, names), *place.given),
            )
            yield self._walk([(prototype, purpose)], inside)

    # Instancers ----------------------------------------------------------------------------------

    def send_point_instancer(self, point: PointInstancer) -> int:
        """The instancer of the session; gets what it does not have yet."""
        motion = self._motion.of(point.prim)
        sent = self._send_instancer(point.key, str(point.prim.GetPath()), point.place, motion)
        if point.arrays is not None:
            self._session.set_instances(sent.instancer, point.arrays)
            sent.prototypes = [int(number) for number in point.arrays.used_prototypes()]
            sent.varies = point.arrays.varies
        if sent.primvars_vary:
            self._send_instance_primvars(point.prim, sent)
        transforms = self._timing(point.prim).transforms
        levels = transforms.levels(point.prim, point.place.top, point.place.below)
        if sent.levels is None or not _same_levels(sent.levels, levels):
            self._session.set_transform(sent.instancer, levels)
            sent.levels = levels
        return sent.instancer

    def _send_instance_primvars(self, prim: Usd.Prim, sent: _SentInstancer) -> None:
        names = instance_primvars(prim, self._primvar_names)
        shutter = self._timing(prim).shutter
        try:
            primvars, varies = read_primvars(prim, shutter, names, self._log)
        except FAULTS as error:
            warn_unreadable(self._log, prim.GetPath(), error, "its primvars are ignored")
            primvars, varies = {}, True
        for name in sorted(sent.primvars.union(primvars)):
            self._session.set_primvar(sent.instancer, name, primvars.get(name))
        sent.primvars, sent.primvars_vary = set(primvars), varies

    def motion_of(self, prim: Usd.Prim) -> Motion:
        """What the prim says about its blur."""
        return self._motion.of(prim)

    def send_natives(self, natives: Natives, key: str, partition, motion: Motion) -> int:
        """The instancer of the session for native instances; sent once a frame."""
        known = key in self._seen
        path = str(natives.first.GetPath())
        sent = self._send_instancer(key, path, natives.place, motion)
        if not known:
            arrays = natives.read(partition, self._motion.timing(motion))
            self._session.set_instances(sent.instancer, arrays)
        return sent.instancer

    def _send_instancer(self, key: str, path: str, place: Place, motion: Motion) -> _SentInstancer:
        sent = self._instancers.get(key)
        if sent is None:
            sent = _SentInstancer(self._session.create("instancer", path))
            self._instancers[key] = sent
        self._seen.add(key)
        part = place.resolve(motion)
        if sent.part != part:
            self._session.set_part(sent.instancer, *part)
            sent.part = part
        if sent.motion != motion:
            self._session.set_motion(sent.instancer, motion)
            sent.motion = motion
        return sent

    def _check_draw_mode(self, prim) -> None:
        model = UsdGeom.ModelAPI(prim)
        mode = model.ComputeModelDrawMode()
        apply = model.GetModelApplyDrawModeAttr()
        if apply.HasAuthoredValue():
            applies = get_or_fallback(apply, self._shutter.time, self._log)
        else:  # components are drawn as if it were true
            applies = Kind.Registry.IsA(Usd.ModelAPI(prim).GetKind(), Kind.Tokens.component)
        if applies and mode not in ("default", "inherited", ""):
            text = f"draw mode {mode} is not supported yet; its geometry is rendered in full"
            self._log.warn(prim.GetPath(), "draw-mode", text)

    # One mesh ------------------------------------------------------------------------------------

    def _emit(self, key: str, prim: Usd.Prim, levels: list[Level], place: Place) -> None:
        """Sends what the session does not have yet of one prim; a faulty one is left out."""
        try:
            self._send(key, prim, levels, place)
            self._send_matte(key, self._is_matte(prim, place))
            self._send_motion(key, self._motion.of(prim))
            if key in self._sent:
                self._session.complete(self._sent[key].prim)
        except FAULTS as error:
            self._seen.discard(key)
            self._leave_out(prim, error)

    def _send(self, key: str, prim: Usd.Prim, levels: list[Level], place: Place) -> None:
        sent = self._sent.get(key)
        if sent is None or sent.shape_varies:
            sent = self._send_shape(key, sent, prim)
            if sent is None:
                return
        self._seen.add(key)
        session, shutter = self._session, self._timing(prim).shutter
        if sent.primvars_vary:
            names = self._primvar_names
            primvars, varies = read_primvars(prim, shutter, names, self._log, place.gives)
            skinned = self._skinning.of(prim)
            if skinned:
                skinned.turn_normals(primvars, sent.shape)
            for name in sorted(sent.primvars.union(primvars)):
                session.set_primvar(sent.prim, name, primvars.get(name))
            sent.primvars = set(primvars)
            sent.primvars_vary = varies or any(p.varies for p in primvars.values())
        if sent.levels is None or not _same_levels(sent.levels, levels):
            session.set_transform(sent.prim, levels)
            sent.levels = levels
        part = place.resolve(self._motion.of(prim))
        if sent.part != part:
            session.set_part(sent.prim, *part)
            sent.part = part

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
            if shape.kind != "mesh":
                warn_of_unused(prim, self._log)
            sent = _Sent(self._session.create(shape.kind, str(prim.GetPath())))
            self._sent[key] = sent
            # A prim that comes and goes keeps its number.
            pick_id = self._pick_ids.setdefault(key, len(self._pick_ids))
            self._session.set_pick_id(sent.prim, pick_id)
            self.prim_paths[pick_id] = str(prim.GetPath())
        shape.send(self._session, sent.prim, before)
        attribute = UsdGeom.Gprim(prim).GetDoubleSidedAttr()
        double_sided = bool(get_or_fallback(attribute, self._shutter.time, self._log))
        if sent.double_sided != double_sided:
            self._session.set_double_sided(sent.prim, double_sided)
            sent.double_sided = double_sided
        # What is never read again need not be kept.
        keep = shape.varies or self._skinning.of(prim)
        sent.shape_varies = shape.varies or might_vary(attribute)
        sent.shape = shape if keep else None
        return sent


def _same_levels(a: list[Level], b: list[Level]) -> bool:
    return len(a) == len(b) and all(
        np.array_equal(x.times, y.times) and np.array_equal(x.matrices, y.matrices)
        for x, y in zip(a, b, strict=True)
    )
