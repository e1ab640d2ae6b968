"""Scripted demonstrations of several skills in a row, and the datasets cut from them.

The paper does not say where its kitchen data came from. Its tables fit skills cut from people's
demonstrations of four skills in a row, so that is what is made here, for all seven skills.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from stitching.bounds import Amount, Bounded, Count, Episodes, Share, Times
from stitching.data.kitchen.arm import GRIP_OPEN, HOME, Arm
from stitching.data.kitchen.programs import PROGRAMS, Program, Style, perform, relocate, style
from stitching.data.kitchen.segments import Episode, Order, Segment, as_transitions, cut
from stitching.data.transitions import Transitions
from stitching.envs.kitchen import JOINTS, KITCHEN, SKILLS, KitchenVectorEnv
from stitching.streams import stream

SHORT = {name.split()[0]: name for name in SKILLS}
HUMAN_ORDERS = """
kettle-top-hinge-slide kettle-top-light-slide kettle-top-light-hinge kettle-light-hinge-slide
kettle-bottom-top-slide kettle-bottom-top-hinge kettle-bottom-top-light kettle-bottom-light-slide
microwave-top-hinge-slide microwave-top-light-slide microwave-kettle-top-hinge
microwave-kettle-top-slide microwave-kettle-hinge-slide microwave-kettle-light-slide
microwave-kettle-light-hinge microwave-kettle-bottom-hinge microwave-kettle-bottom-light
microwave-light-hinge-slide microwave-bottom-top-hinge microwave-bottom-top-slide
microwave-bottom-top-light microwave-bottom-light-hinge bottom-top-hinge-slide
bottom-top-light-slide
"""


def human_orders() -> tuple[Order, ...]:
    """The 24 orders in which people did four skills for Relay Policy Learning (2019).

    In FrankaKitchen's names: the recordings call "topknob" what it calls the bottom burner.
    """
    return tuple(tuple(SHORT[word] for word in order.split("-")) for order in HUMAN_ORDERS.split())


Source = Literal["orders", "single-skill", "human"]


@dataclass(frozen=True)
class KitchenDataConfig(Bounded):
    """Kitchen's demonstrations: which there are, how many, and how good the demonstrator is."""

    source: Source = "orders"  # several skills in human orders, each alone, or people's recordings
    human: str = ""  # for people's: `file` by an older name
    episodes: Episodes = 24  # demonstrations an order
    # First skill of an order → times as many demonstrations of it.
    first_weights: dict[str, Times] = field(default_factory=dict)
    held_out: Amount = 8  # more of each order, to judge models by
    quality: Share = 0.9  # of the demonstrator: from 1, an expert, down to 0
    qualities: dict[str, Share] = field(default_factory=dict)  # skill → another quality for it
    ease: Amount = 0  # steps in which the first movement gathers speed; people: some 15
    elsewhere: Share = 0.0  # share of later skills that begin at a free pose, not where one ended
    skill_steps: Count = 160  # after which a skill counts as missed and the demonstration ends
    return_home: bool = False  # to the start posture before another skill; people do not
    keep_failures: bool = False  # keep the segment of a missed skill, as one without success
    file: str = ""  # own data in place of these: an .npz file or the id of a Minari dataset

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("first_weights", "qualities"):
            if unknown := sorted(getattr(self, name).keys() - set(SKILLS)):
                known = ", ".join(SKILLS)
                raise ValueError(f"{name}: no skill {unknown[0]!r}; there are {known}")
        if self.file and self.source == "human":
            raise ValueError("file: names the data, and so does human; leave source as it was")

    @property
    def are_own(self) -> bool:
        """Whether all is learned from people's own data, and nothing from scripted ones."""
        return bool(self.file) or self.source == "human"

    @property
    def own(self) -> str:
        """An .npz file or the id of a Minari dataset, where they are; "" where none is named."""
        return self.file or self.human

    def demonstrations(self, order: Order) -> int:
        """How many demonstrations of an order a dataset holds."""
        return round(self.episodes * self.first_weights.get(order[0], 1.0))

    def style(self, skill: str) -> Style:
        """How a demonstrator varies in a skill."""
        return style(self.qualities.get(skill, self.quality))


class Demonstrator:
    """The demonstrator of one episode, going through an order of skills."""

    def __init__(self, order: Order, config: KitchenDataConfig, rng: np.random.Generator) -> None:
        self._todo, self._config, self._rng = list(order), config, rng
        self._style: Style  # of the present skill
        self._done = np.zeros(len(SKILLS), dtype=bool)
        self._last: Program | None = None
        self._moves: Iterator[np.ndarray] | None = None
        self._relocation: Iterator[np.ndarray] = iter(())
        self._steps = self._acted = 0  # of the present skill, and of the whole demonstration
        self.relocating = False  # whether the last action belongs to no skill

    def act(self, arm: Arm, achieved: np.ndarray) -> np.ndarray | None:
        """Next action (9,) for what `arm` sees and the goals (7,) that hold; None at the end."""
        self._done |= achieved
        while self._todo and self._done[SKILLS.index(self._todo[0])]:
            done = PROGRAMS[self._todo.pop(0)]
            if self._moves is not None:  # else it came about by accident, and the hand is elsewhere
                self._last = done
            self._moves, self._steps = None, 0
        if not self._todo or self._steps == self._config.skill_steps:
            return None
        if self._moves is None:
            self._style = self._config.style(self._todo[0])
            if self._last is not None and self._rng.random() < self._config.elsewhere:
                self._relocation = relocate(arm, self._last, self._rng)
                self._last = None
            self._moves = perform(
                PROGRAMS[self._todo[0]],
                arm,
                self._style,
                self._rng,
                last=self._last,
                return_home=self._config.return_home,
            )
        action = next(self._relocation, None)
        self.relocating = action is not None
        if action is None:
            action = next(self._moves)
            self._steps += 1
        self._acted += 1
        if self._acted < self._config.ease:
            still = arm.bend(np.zeros_like(HOME), GRIP_OPEN)
            action = still + self._acted / self._config.ease * (action - still)
        noise = self._style.noise * self._rng.standard_normal(JOINTS)
        return np.clip(action + noise, -1, 1).astype(np.float32)


def demonstrate(env: KitchenVectorEnv, demonstrators: Sequence[Demonstrator]) -> list[Episode]:
    """Let each demonstrator go on from its episode's state, until it is done or gives up.

    Physics that diverge end their episode before the step that did it.
    """
    arm, rows = Arm(), np.arange(len(demonstrators))
    seen = [[row] for row in env.observe(rows)]
    done = [[row] for row in _achieved(env, rows)]
    states = [[row] for row in env.snapshot(rows)]
    acted: list[list[np.ndarray]] = [[] for _ in demonstrators]
    relocating: list[list[bool]] = [[] for _ in demonstrators]
    while len(rows):
        moves = {}
        for row in rows.tolist():
            arm.see(seen[row][-1])
            action = demonstrators[row].act(arm, done[row][-1])
            if action is not None:
                moves[row] = action
        if not moves:
            break
        rows = np.array(list(moves))
        env.step(rows, np.stack(list(moves.values())))
        rows = rows[~env.diverged[rows]]
        after = zip(
            rows.tolist(),
            env.observe(rows),
            _achieved(env, rows),
            env.snapshot(rows),
            strict=True,
        )
        for row, observation, achieved, state in after:
            acted[row].append(moves[row])
            relocating[row].append(demonstrators[row].relocating)
            seen[row].append(observation)
            done[row].append(achieved)
            states[row].append(state)
    return [
        Episode(
            np.array(o),
            np.array(a, dtype=np.float32).reshape(-1, JOINTS),
            np.array(d),
            np.array(s),
            np.array(r, dtype=bool),
        )
        for o, a, d, s, r in zip(seen, acted, done, states, relocating, strict=True)
    ]


def _achieved(env: KitchenVectorEnv, rows: np.ndarray) -> np.ndarray:
    """Which of the goals hold: (n, 7)."""
    return np.stack([env.achieved(rows, skill) for skill in range(len(SKILLS))], axis=1)


def orders(config: KitchenDataConfig) -> tuple[Order, ...]:
    """What scripted demonstrators are asked to do; beside people's data, what judges models."""
    single = config.source == "single-skill"
    asked = tuple((name,) for name in SKILLS) if single else human_orders()
    return tuple(order for order in asked if config.demonstrations(order))


def play(
    config: KitchenDataConfig, order: Order, seed: int, episodes: Sequence[int] | None = None
) -> list[list[Segment]]:
    """The demonstrations of one order, each cut into its skills.

    An episode depends on the configuration, the seed, its order and its number alone.
    """
    numbers = range(config.demonstrations(order)) if episodes is None else episodes
    labels = [("demonstrations", "kitchen", seed, "-".join(order), e) for e in numbers]
    env = KITCHEN.vector_env()
    env.reset([stream("environment", *label) for label in labels])
    demonstrators = [Demonstrator(order, config, stream("hand", *label)) for label in labels]
    return [cut(episode, order) for episode in demonstrate(env, demonstrators)]


def kept(config: KitchenDataConfig, demonstrations: list[list[Segment]]) -> list[Segment]:
    """The segments that a dataset holds, in order."""
    return [s for one in demonstrations for s in one if s.success or config.keep_failures]


def held_out(config: KitchenDataConfig, seed: int) -> tuple[Transitions, np.ndarray]:
    """Demonstrations of every order that no model has seen, and the state each skill began in.

    The skills that succeeded (E episodes), and their snapshots (E, snapshot) float64.
    """

    def numbers(order: Order) -> range:
        shown = config.demonstrations(order)
        return range(shown, shown + config.held_out)

    segments = [
        segment
        for order in orders(config)
        for one in play(config, order, seed, numbers(order))
        for segment in one
        if segment.success
    ]
    return as_transitions(segments), np.array([s.episode.snapshots[s.start] for s in segments])
