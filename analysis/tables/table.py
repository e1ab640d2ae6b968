"""A table of a run: every cell's score, and the gains of one method over another."""

from collections import Counter
from collections.abc import Container
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from analysis.paper.numbers import paper_scores
from analysis.paper.orders import Cells, by_order, order_duels
from analysis.paper.tasks import paper_tasks
from analysis.schema import RunSpec, TableEntry
from analysis.statistics import arrange, estimate, generator, paired_gain
from analysis.tables.distribution import Distribution, cell_distributions
from analysis.tables.rows import column_labels, place_tasks

SCORE_COLUMNS = [
    "row", "method", "score", "variance", "std", "ci_low", "ci_high", "episodes", "seeds",
    "paper_score", "paper_error",
]  # fmt: skip
TASK_COLUMNS = ["row", "method", "seed", "task", "score"]
GAIN_COLUMNS = [
    "row", "method", "baseline", "gain", "ci_low", "ci_high", "relative_gain", "pairs", "seeds",
]  # fmt: skip


@dataclass(frozen=True)
class Table:
    """A table with all that is printed beside it."""

    spec: RunSpec
    entry: TableEntry
    scores: pd.DataFrame  # SCORE_COLUMNS, one row a cell
    task_scores: pd.DataFrame  # TASK_COLUMNS: mean scores of tasks, under the models of a seed
    gains: pd.DataFrame  # GAIN_COLUMNS
    leads: pd.DataFrame  # GAIN_COLUMNS: the paper's leader of each row over its best other
    orders: pd.DataFrame  # GAIN_COLUMNS: Table 4's leaders by order of skills, no line elsewhere
    expected: dict[tuple[str, str], int]  # (row, method) -> episodes of a complete cell
    labels: dict[str, str]  # method -> how the table's head calls it
    other_tasks: dict[str, tuple[int, int]]  # row of others than the paper's -> how many, and its

    @property
    def rows(self) -> list[str]:
        return list(dict.fromkeys(self.scores["row"]))

    @property
    def methods(self) -> list[str]:
        return list(dict.fromkeys(self.scores["method"]))

    @property
    def seed_scores(self) -> pd.DataFrame:
        """A line for each row, method and seed: the means that a score is the mean of."""
        by_seed = self.task_scores.groupby(["row", "method", "seed"], sort=False)["score"]
        return by_seed.mean().reset_index()

    @cached_property
    def distributions(self) -> dict[tuple[str, str], Distribution]:
        """(row, method) -> how scores differ from task to task, where tasks are many."""
        return cell_distributions(self.task_scores, self.entry.id)

    @property
    def missing(self) -> dict[tuple[str, str], int]:
        """(row, method) -> episodes that are asked for and not there, where there are any."""
        played = self.scores.set_index(["row", "method"])["episodes"]
        short = {cell: asked - int(played[cell]) for cell, asked in self.expected.items()}
        return {cell: episodes for cell, episodes in short.items() if episodes > 0}

    @property
    def fewest_seeds(self) -> int:
        """Of all cells that have an episode: what the weakest interval rests on."""
        seeds = self.scores["seeds"]
        return int(seeds[seeds > 0].min()) if (seeds > 0).any() else len(self.spec.seeds)


def build_table(episodes: pd.DataFrame, spec: RunSpec, entry: TableEntry) -> Table:
    """Gathers episodes into cells, and compares the methods within each row."""
    places = place_tasks(spec, entry)
    cells = _cells(episodes, places)
    orders, long_task = by_order(cells), spec.task_label(spec.long_task)
    tasks_of_cell = Counter(zip(places["row"], places["column"], strict=True))
    other_tasks = _other_tasks(places, spec, entry)
    scores = score_table(cells, entry, other_tasks)
    labels = column_labels(spec)
    gain_pairs, lead_pairs = _gain_pairs(cells, entry), _lead_pairs(scores)
    # Most leads are gains as well: each is worked out once.
    gains = gain_table(cells, list(dict.fromkeys(gain_pairs + lead_pairs)), entry)
    return Table(
        spec=spec,
        entry=entry,
        scores=scores,
        task_scores=task_table(cells),
        gains=_only(gains, gain_pairs),
        leads=_only(gains, lead_pairs),
        orders=gain_table(orders, order_duels(orders, entry.paper, long_task), entry),
        expected={
            cell: tasks * len(spec.seeds) * spec.episodes for cell, tasks in tasks_of_cell.items()
        },
        labels={method: labels.get(method, method) for method in scores["method"].unique()},
        other_tasks=other_tasks,
    )


def _cells(episodes: pd.DataFrame, places: pd.DataFrame) -> Cells:
    by_node = dict(list(episodes.groupby(["method", "task"], sort=False)))
    nothing = episodes.iloc[:0]
    parts: dict[tuple[str, str], list[pd.DataFrame]] = {}
    for place in places.to_dict("records"):
        node = (place["method"], place["task"])
        parts.setdefault((place["row"], place["column"]), []).append(by_node.get(node, nothing))
    return {cell: pd.concat(played) for cell, played in parts.items()}


def _other_tasks(
    places: pd.DataFrame, spec: RunSpec, entry: TableEntry
) -> dict[str, tuple[int, int]]:
    """Rows that are means over other tasks than the paper's: how many here, and there."""
    printed = paper_tasks(entry.paper)
    return {
        row: (len(tasks), len(printed[row]))
        for (row, _), tasks in places.groupby(["row", "column"], sort=False)["task"]
        if row in printed and set(map(spec.task_label, tasks)) != printed[row]
    }


def score_table(cells: Cells, entry: TableEntry, alone: Container[str] = ()) -> pd.DataFrame:
    """SCORE_COLUMNS: each cell's estimate beside the paper's number.

    NaN where the paper has none, and in the rows of `alone`.
    """
    paper = {cell: numbers for cell, numbers in paper_scores(entry.paper).items()
             if cell[0] not in alone}  # fmt: skip
    records = []
    for (row, method), played in cells.items():
        ours = estimate(arrange(played, "score"), generator("score", entry.id, row, method))
        records.append(
            (row, method, ours.mean, ours.variance, ours.std, ours.low, ours.high,
             ours.episodes, ours.seeds, *paper.get((row, method), (np.nan, np.nan)))
        )  # fmt: skip
    return pd.DataFrame(records, columns=SCORE_COLUMNS)


def task_table(cells: Cells) -> pd.DataFrame:
    """TASK_COLUMNS, for every task of which a seed has an episode."""
    parts = [
        played.groupby(["seed", "task"])["score"]
        .mean()
        .reset_index()
        .assign(row=row, method=method)
        for (row, method), played in cells.items()
    ]
    return pd.concat(parts, ignore_index=True)[TASK_COLUMNS]


def gain_table(cells: Cells, pairs: list[tuple[str, str, str]], entry: TableEntry) -> pd.DataFrame:
    """GAIN_COLUMNS for each (row, method, baseline), over the episodes both have."""
    records = []
    for row, method, baseline in pairs:
        gain = paired_gain(
            cells[row, method],
            cells[row, baseline],
            generator("gain", entry.id, row, method, baseline),
        )
        records.append(
            (row, method, baseline, gain.difference, gain.low, gain.high, gain.relative,
             gain.pairs, gain.seeds)
        )  # fmt: skip
    return pd.DataFrame(records, columns=GAIN_COLUMNS)


def _only(gains: pd.DataFrame, pairs: list[tuple[str, str, str]]) -> pd.DataFrame:
    """The lines of these (row, method, baseline), in this order."""
    by_pair = {gain[:3]: gain for gain in gains.itertuples(index=False, name=None)}
    return pd.DataFrame([by_pair[pair] for pair in pairs], columns=GAIN_COLUMNS)


def _gain_pairs(cells: Cells, entry: TableEntry) -> list[tuple[str, str, str]]:
    """The last method over each other; or, given a baseline, each other method over it."""
    methods = list(dict.fromkeys(method for _, method in cells))
    if entry.baseline:
        duels = [(method, entry.baseline) for method in methods if method != entry.baseline]
    else:
        duels = [(methods[-1], method) for method in methods[:-1]]
    rows = dict.fromkeys(row for row, _ in cells)
    return [
        (row, *duel)
        for row in rows
        for duel in duels
        if all((row, method) in cells for method in duel)
    ]


def _lead_pairs(scores: pd.DataFrame) -> list[tuple[str, str, str]]:
    """(row, the paper's leader, the best here of its others); rows the paper ties are left out."""
    pairs = []
    for row, part in scores.dropna(subset="paper_score").groupby("row", sort=False):
        printed = part["paper_score"]
        leaders = part.loc[printed == printed.max(), "method"].tolist()
        others = part[~part["method"].isin(leaders)].dropna(subset="score")
        if len(leaders) == 1 and not others.empty:
            rival = others["method"].iloc[int(others["score"].argmax())]
            pairs.append((str(row), leaders[0], rival))
    return pairs
