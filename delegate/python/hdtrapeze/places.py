"""Where the walk is: the stage's root, a prototype of a point instancer, or native instances.

A `Place` says where levels of transforms end, and which prototype of which instancer of the
session the prims there are part of. Instancers of the session are made when the first prim needs
them: native instances have one for each motion that is asked for, since it reads their transforms.
"""

from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from pxr import Sdf, Usd

from .inherited import digest
from .instances import Instances, native_instances
from .motion import Motion

NONE = (0, 0)
"""The part of prims that are part of nothing."""

LONGEST_PREFIX = 400


class Part(Protocol):
    """The prototype of an instancer."""

    def known(self, motion: Motion) -> tuple[int, int] | None:
        """What `resolve` gave for this motion; None where it was not asked for yet."""

    def outer(self, motion: Motion) -> "tuple[Place, Motion]":
        """Where the instancer is, and the motion that it is resolved with there."""

    def resolve(self, motion: Motion) -> tuple[int, int]:
        """Instancer and prototype number, for a prim with this motion; sends what is not there."""


@dataclass(frozen=True)
class Place:
    """Where the walk is."""

    part: Part | None = None
    top: Usd.Prim | None = None
    """Levels end at this prim, its own included (the root of a point instancer's prototype)..."""
    below: Usd.Prim | None = None
    """...or below this one (a native instance)."""
    prefix: str = ""
    """Of keys of what is sent."""
    instancers: tuple[Sdf.Path, ...] = ()
    """Point instancers that place what is here, the outermost first."""
    outer: "Place | None" = None
    """Around native instances: where what ignores its parents is (resetXformStack)."""
    natives: "Natives | None" = None
    """Native instances that may differ in what they inherit; the walk is in the first of them."""
    given: tuple[tuple[Sdf.Path, frozenset[str]], ...] = ()
    """The roots of the prototypes around, the innermost first, and names of the primvars that their
    instancers give."""

    def resolve(self, motion: Motion) -> tuple[int, int]:
        """The part of a prim with this motion."""
        # The outermost first, so that no depth of nesting becomes a depth of calls.
        waiting, place, wanted = [], self, motion
        while place.part and place.part.known(wanted) is None:
            waiting.append((place.part, wanted))
            place, wanted = place.part.outer(wanted)
        for part, wanted in reversed(waiting):
            part.resolve(wanted)
        return self.part.resolve(motion) if self.part else NONE

    def gives(self, name: str, source: Sdf.Path) -> bool:
        """Whether instancers give a prim here the primvar, although it inherits one from `source`.

        A value of an instance counts as if it were authored at the root of the prototype.
        """
        for root, names in self.given:
            if source.HasPrefix(root):
                return False
            if name in names:
                return True
        return False


def run_nested(walk: Generator) -> None:
    """Runs a generator that yields others, each to be run before it goes on, at any depth."""
    stack, error = [walk], None
    while stack:
        try:
            below = stack[-1].throw(error) if error else next(stack[-1])
        except StopIteration:
            stack.pop()
            error = None
        except Exception as raised:  # for the one that yielded it to handle
            stack.pop()
            if not stack:
                raise
            error = raised
        else:
            stack.append(below)
            error = None


def short_prefix(key: str) -> str:
    """A prefix for keys of what is inside; it does not grow with each level."""
    return key if len(key) < LONGEST_PREFIX else f"#{digest(key)}/"


@dataclass
class PointPart:
    """A prototype of a point instancer."""

    instancer: "PointInstancer"
    number: int

    def known(self, motion: Motion) -> tuple[int, int] | None:
        """See Part."""
        return (self.instancer.id, self.number) if self.instancer.id else None

    def outer(self, motion: Motion) -> tuple[Place, Motion]:
        """See Part."""
        return self.instancer.place, self.instancer.motion()

    def resolve(self, motion: Motion) -> tuple[int, int]:
        """See Part. A point instancer has its own motion."""
        return self.instancer.resolve(), self.number


@dataclass
class PointInstancer:
    """A point instancer in one place."""

    sync: object
    prim: Usd.Prim
    place: Place
    key: str
    arrays: Instances | None = None
    """What the session does not have yet."""
    id: int = 0
    """The instancer of the session; 0 where it was not asked for yet."""

    def motion(self) -> Motion:
        """Its own motion."""
        return self.sync.motion_of(self.prim)

    def resolve(self) -> int:
        """Its instancer of the session; sent when first asked for."""
        if not self.id:
            self.id = self.sync.send_point_instancer(self)
        return self.id


@dataclass
class Natives:
    """Native instances of one prototype in one place, by number.

    `members` are those that are there now, `count` is the number that there ever were.
    """

    sync: object
    place: Place
    key: str
    members: dict[int, Usd.Prim]
    count: int
    nested: list[tuple[Usd.Prim, str]] = field(default_factory=list)
    """Instances and instancers in the first of them, with the purposes that they inherit."""
    _partitions: dict[bytes, int] = field(default_factory=dict)
    _levels: dict = field(default_factory=dict)
    _ids: dict[tuple[bytes, Motion], int] = field(default_factory=dict)

    @property
    def first(self) -> Usd.Prim:
        """The instance that the walk is in."""
        return next(iter(self.members.values()))

    def everything(self) -> "NativePart":
        """All instances."""
        return NativePart(self, np.zeros(self.count, dtype=np.int32), 0)

    def classes(self, kinds: dict[int, object]) -> list[tuple[int, object, "NativePart"]]:
        """The instances by kind: number of a first one, kind, and the part of each.

        `kinds` has it by number; instances that it lacks are in no class.
        """
        first: dict[object, int] = {}
        order: dict[object, int] = {}
        partition = np.full(self.count, -1, dtype=np.int32)
        for number, kind in kinds.items():
            first.setdefault(kind, number)
            partition[number] = order.setdefault(kind, len(order))
        partition[partition < 0] = len(order)  # a prototype that nothing is part of
        return [(first[kind], kind, NativePart(self, partition, i)) for kind, i in order.items()]

    def resolve(self, partition: np.ndarray, motion: Motion) -> int:
        """The instancer of the session that has the prototypes of `partition`."""
        known = self.known(partition, motion)
        if known:
            return known
        name = self._partitions.setdefault(partition.tobytes(), len(self._partitions))
        blur = "" if motion == Motion() else f"{motion.blur_scale:g},{motion.nonlinear_samples}"
        sent = self.sync.send_natives(self, f"{self.key}#{name}{blur}", partition, motion)
        self._ids[partition.tobytes(), motion] = sent
        return sent

    def known(self, partition: np.ndarray, motion: Motion) -> int | None:
        """What `resolve` gave before."""
        return self._ids.get((partition.tobytes(), motion))

    def read(self, partition: np.ndarray, timing) -> Instances:
        """Arrays of the session's instancer."""
        shutter, transforms = timing.shutter, timing.transforms
        if shutter not in self._levels:
            place = self.place
            self._levels[shutter] = {
                number: transforms.levels(prim, place.top, place.below)
                for number, prim in self.members.items()
            }
        return native_instances(self._levels[shutter], self.count, partition, shutter)


@dataclass
class NativePart:
    """One class of native instances."""

    natives: Natives
    partition: np.ndarray
    number: int

    def known(self, motion: Motion) -> tuple[int, int] | None:
        """See Part."""
        known = self.natives.known(self.partition, motion)
        return (known, self.number) if known else None

    def outer(self, motion: Motion) -> tuple[Place, Motion]:
        """See Part."""
        return self.natives.place, motion

    def resolve(self, motion: Motion) -> tuple[int, int]:
        """See Part."""
        return self.natives.resolve(self.partition, motion), self.number
