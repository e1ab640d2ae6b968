"""The initiation sets of all skills: how far a robot is from them, and what brings it nearer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from stitching.data.corrections import STEPS_BACK

FAINTEST = 0.02  # of the strongest effect of actions on a pose: what is weaker is left alone


@dataclass(frozen=True)
class Steering:
    """`stitching.data.robot`'s model, x' = x + A x + B a + c, and what brings a pose about."""

    robot: list[int]  # columns of an observation: x
    drift: torch.Tensor  # (robot, robot) A
    effect: torch.Tensor  # (robot, action) B
    offset: torch.Tensor  # (robot,) c
    pose: list[int]  # which of x make the pose
    back: torch.Tensor  # (action, pose) B⁺ of the pose, without what is as good as noise

    @classmethod
    def of(cls, arrays: dict[str, np.ndarray]) -> Steering:
        """From the artifact: columns, scale, "robot.columns", ….drift, ….effect and ….offset."""
        robot = arrays["robot.columns"].tolist()
        pose = [robot.index(column) for column in arrays["columns"].tolist()]
        drift, effect, offset = (
            torch.from_numpy(arrays[f"robot.{name}"]) for name in ("drift", "effect", "offset")
        )
        scale = torch.from_numpy(arrays["scale"])
        back = torch.linalg.pinv(effect[pose] / scale[:, None], rtol=FAINTEST) / scale
        return cls(robot, drift, effect, offset, pose, back)

    def towards(self, states: torch.Tensor, poses: torch.Tensor, horizon: int) -> torch.Tensor:
        """Actions that bring robots nearer to poses, as far as the model knows.

        a_t = clip(B⁺ ((p − x_t) / 3 − A x_t − c), −1, 1), p being the pose: with every action a
        third of what is left, or as much as an action can. All at once would arrive too fast.

        states: (n, observation). poses: (n, pose). Returns (n, horizon, action).
        """
        x, steps = states[:, self.robot], []
        for _ in range(horizon):
            drift = x @ self.drift.T + self.offset
            wanted = (poses - x[:, self.pose]) / STEPS_BACK - drift[:, self.pose]
            action = (wanted @ self.back.T).clamp(-1, 1)
            x = x + drift + action @ self.effect.T
            steps.append(action)
        return torch.stack(steps, dim=1)


@dataclass(frozen=True)
class Initiation:
    """What `stitching.data.initiation` finds in demonstrations, for every skill."""

    columns: list[int]  # of an observation, that make the robot's pose
    scale: torch.Tensor  # (pose,) what they are divided by
    states: list[torch.Tensor]  # by skill: (P, observation); none where nothing is known
    others: list[list[int]]  # by skill: columns of the objects that it is not about
    radii: list[float]  # ε by skill
    steering: Steering | None = None  # none where actions are discrete

    @classmethod
    def of(cls, arrays: dict[str, np.ndarray]) -> Initiation:
        """From the artifact: columns, scale, radii, "states.<skill>", "others.<skill>".

        And the robot's model, where it has one: see `Steering.of`.
        """
        radii = arrays["radii"].tolist()
        return cls(
            arrays["columns"].tolist(),
            torch.from_numpy(arrays["scale"]),
            [torch.from_numpy(arrays[f"states.{skill}"]) for skill in range(len(radii))],
            [arrays[f"others.{skill}"].tolist() for skill in range(len(radii))],
            radii,
            Steering.of(arrays) if "robot.effect" in arrays else None,
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

    def among_known_objects(
        self, states: torch.Tensor, nearest: torch.Tensor, skill: int
    ) -> torch.Tensor:
        """The same robots among other objects: (n, observation) → (n, observation).

        Those that the skill is not about are as in the states that are `nearest`.
        """
        placed = states.clone()
        placed[:, self.others[skill]] = nearest[:, self.others[skill]]
        return placed

    def towards(
        self, states: torch.Tensor, nearest: torch.Tensor, horizon: int
    ) -> torch.Tensor | None:
        """`Steering.towards` the poses of what is `nearest`: (n, horizon, action), or None."""
        if self.steering is None:
            return None
        return self.steering.towards(states, nearest[:, self.columns], horizon)

    def nearest(self, states: torch.Tensor, skill: int) -> torch.Tensor:
        """The states of the set whose poses are nearest: (n, observation) → (n, observation)."""
        return self.states[skill][self._gaps(states, skill).argmin(dim=1)]

    def outside(self, states: torch.Tensor, skill: int) -> torch.Tensor:
        """Which states are farther than ε from the set, (n, observation) → (n,) bool."""
        return self.distances(states, skill) > self.radii[skill]
