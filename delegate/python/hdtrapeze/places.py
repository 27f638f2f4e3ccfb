"""Where the walk is: the stage's root, a prototype of a point instancer, or native instances.

A `Place` says where levels of transforms end, and which prototype of which instancer of the
session the prims there are part of. Instancers of the session are made when the first prim needs
them: native instances have one for each motion that is asked for, since it reads their transforms.
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from pxr import Sdf, Usd

from .instances import Instances, native_instances
from .motion import Motion

NONE = (0, 0)
"""The part of prims that are part of nothing."""


class Part(Protocol):
    """The prototype of an instancer."""

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

    def resolve(self, motion: Motion) -> tuple[int, int]:
        """The part of a prim with this motion."""
        return self.part.resolve(motion) if self.part else NONE


@dataclass
class PointPart:
    """A prototype of a point instancer."""

    instancer: "PointInstancer"
    number: int

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
    _id: int = 0

    def resolve(self) -> int:
        """Its instancer of the session; sent when first asked for."""
        if not self._id:
            self._id = self.sync.send_point_instancer(self)
        return self._id


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
        name = self._partitions.setdefault(partition.tobytes(), len(self._partitions))
        blur = "" if motion == Motion() else f"{motion.blur_scale:g},{motion.nonlinear_samples}"
        return self.sync.send_natives(self, f"{self.key}#{name}{blur}", partition, motion)

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

    def resolve(self, motion: Motion) -> tuple[int, int]:
        """See Part."""
        return self.natives.resolve(self.partition, motion), self.number
