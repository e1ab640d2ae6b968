"""Which artifacts and blocks are alike, so that what one took tells what another will take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from orchestrator.work.recipes import Recipe, digest

SEEDS = ("seed", "root_seed")


@dataclass
class Likeness:
    """Names artifacts by all that they are made of but their seeds, and their inputs likewise.

    Nothing is listed that would matter: what a recipe says, but for seeds, all does. The code does
    not: it changes often, and what things cost seldom with it.
    """

    recipes: Mapping[str, Recipe]  # by key
    _names: dict[str, str] = field(default_factory=dict)

    def of(self, key: str) -> str:
        """The same for all artifacts that are alike; what nobody knows how to make is by itself."""
        if key not in self._names:
            recipe = self.recipes.get(key)
            self._names[key] = key if recipe is None else self._name(recipe)
        return self._names[key]

    def _name(self, recipe: Recipe) -> str:
        params = {name: value for name, value in recipe.params.items() if name not in SEEDS}
        inputs = {role: self.of(key) for role, key in recipe.inputs.items()}
        return digest({"kind": recipe.kind, "params": params, "inputs": inputs})
