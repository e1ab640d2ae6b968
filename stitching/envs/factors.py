"""Which numbers of an observation belong together: the robot's pose, and each object."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

NO_OBJECT = -1


@dataclass(frozen=True)
class Object:
    """One object's columns of an observation."""

    positions: tuple[int, ...]
    velocities: tuple[int, ...] = ()

    @property
    def columns(self) -> list[int]:
        return [*self.positions, *self.velocities]


@dataclass(frozen=True)
class Factors:
    """Parts of an observation that can change one without the other.

    Numbers that relate two parts, such as the gripper's distance from a door, belong to no object.
    """

    pose: tuple[int, ...]  # columns that say where the robot is, velocities left out
    objects: dict[str, Object] = field(default_factory=dict)  # by name
    own: dict[str, str] = field(default_factory=dict)  # skill → the object its goal is about

    @property
    def names(self) -> tuple[str, ...]:
        """The objects in the order in which others number them, which no file's order decides."""
        return tuple(sorted(self.objects))

    def others_than(self, skill: str) -> list[int]:
        """Columns of all objects but the one that a skill is about, where it is about one."""
        others = [name for name in self.names if name != self.own.get(skill)]
        return [column for name in others for column in self.objects[name].columns]

    def object_of(self, size: int) -> np.ndarray:
        """The number of the object that each of `size` columns belongs to, (size,) int64.

        NO_OBJECT (−1) where a column belongs to none.
        """
        numbers = np.full(size, NO_OBJECT)
        for number, name in enumerate(self.names):
            numbers[self.objects[name].columns] = number
        return numbers
