"""The initiation sets of all skills, ready to be asked how far a robot is from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch


@dataclass(frozen=True)
class Initiation:
    """What `stitching.data.initiation` finds in demonstrations, for every skill."""

    columns: list[int]  # of an observation, that make the robot's pose
    scale: torch.Tensor  # (pose,) what they are divided by
    states: list[torch.Tensor]  # by skill: (P, observation); none where nothing is known
    others: list[list[int]]  # by skill: columns of the objects that it is not about
    radii: list[float]  # ε by skill

    @classmethod
    def of(cls, arrays: dict[str, np.ndarray]) -> Initiation:
        """From the artifact: columns, scale, radii, "states.<skill>", "others.<skill>"."""
        radii = arrays["radii"].tolist()
        return cls(
            arrays["columns"].tolist(),
            torch.from_numpy(arrays["scale"]),
            [torch.from_numpy(arrays[f"states.{skill}"]) for skill in range(len(radii))],
            [arrays[f"others.{skill}"].tolist() for skill in range(len(radii))],
            radii,
        )

    def distances(self, states: torch.Tensor, skill: int) -> torch.Tensor:
        """To the nearest pose of the set: (..., observation) → (...); 0 where it is empty."""
        if not len(self.states[skill]):
            return torch.zeros(states.shape[:-1])
        return self._gaps(states.flatten(0, -2), skill).amin(dim=1).unflatten(0, states.shape[:-1])

    def _gaps(self, states: torch.Tensor, skill: int) -> torch.Tensor:
        """Between poses, to each of the set: (n, observation) → (n, P)."""
        here, there = (each[:, self.columns] / self.scale for each in (states, self.states[skill]))
        # Without the matrix product, which is inexact near zero and taken by the number of rows.
        return torch.cdist(here, there, compute_mode="donot_use_mm_for_euclid_dist")

    def among_known_objects(self, states: torch.Tensor, skill: int) -> torch.Tensor:
        """The same robots among other objects: (n, observation) → (n, observation).

        Those that the skill is not about are as in that state of the set whose pose is nearest.
        """
        placed = states.clone()
        nearest = self.states[skill][self._gaps(states, skill).argmin(dim=1)]
        placed[:, self.others[skill]] = nearest[:, self.others[skill]]
        return placed

    def outside(self, states: torch.Tensor, skill: int) -> torch.Tensor:
        """Which states are farther than ε from the set, (n, observation) → (n,) bool."""
        return self.distances(states, skill) > self.radii[skill]
