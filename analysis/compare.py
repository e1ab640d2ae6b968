"""Two runs side by side: the same rows and methods, episode against episode."""

from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from analysis.episodes import episodes_from_segments
from analysis.run import load_run, load_run_spec
from analysis.schema import RunError, RunSpec
from analysis.statistics import generator, paired_gain
from analysis.tables.rows import place_tasks
from analysis.tables.writers import BOOTSTRAP, seed_note

COLUMNS = [
    "table", "row", "method", "score_a", "score_b", "b_minus_a", "ci_low", "ci_high",
    "pairs", "seeds",
]  # fmt: skip


class NothingToCompareError(RunError):
    """Two runs without one episode in common."""


def compare(run_a: Path, run_b: Path) -> pd.DataFrame:
    """COLUMNS, one row for each cell that both runs have; the interval is that of B − A.

    Everything is over the episodes (seed, task, episode) that both runs played, so `score_a` may
    differ from the run's own table. Cells without a common episode are left out. Raises
    NothingToCompareError where none is common, or the runs draw from other random numbers.
    """
    a, b = load_run(run_a), load_run(run_b)
    _check_common_random_numbers(a.spec, b.spec)
    episodes_a = episodes_from_segments(a.segments, a.spec, a.quarantine)
    episodes_b = episodes_from_segments(b.segments, b.spec, b.quarantine)
    key = ["method", "seed", "task", "episode"]
    if episodes_a[key].merge(episodes_b[key], on=key).empty:
        raise NothingToCompareError(_what_differs(a.spec, b.spec))
    records = []
    for entry in a.spec.tables:
        places = place_tasks(a.spec, entry)
        for (row, column), part in places.groupby(["row", "column"], sort=False):
            nodes = part[["method", "task"]]
            rng = generator("compare", entry.id, str(row), str(column))
            gain = paired_gain(nodes.merge(episodes_b), nodes.merge(episodes_a), rng)
            if gain.pairs > 0:
                records.append(
                    (entry.id, row, column, gain.score_second, gain.score_first, gain.difference,
                     gain.low, gain.high, gain.pairs, gain.seeds)
                )  # fmt: skip
    return pd.DataFrame(records, columns=COLUMNS)


def _check_common_random_numbers(a: RunSpec, b: RunSpec) -> None:
    """Episodes of the same seed and number are the same only by the same root seed."""
    of_a, of_b = _root_seeds(a), _root_seeds(b)
    if of_a and of_b and not of_a.keys() & of_b.keys():
        raise NothingToCompareError(
            f"nothing to compare: {a.name} is played in {_some(of_a)}, {b.name} in {_some(of_b)}"
        )
    for benchmark in sorted(of_a.keys() & of_b.keys()):
        if of_a[benchmark] != of_b[benchmark]:
            raise NothingToCompareError(
                f"nothing to compare: the root seeds of {benchmark} differ, "
                f"{_some(of_a[benchmark])} in {a.name} and {_some(of_b[benchmark])} in {b.name}: "
                "the same number is another episode there"
            )


def _root_seeds(spec: RunSpec) -> dict[str, list[object]]:
    """Benchmark → root seeds, of all parts."""
    seeds: dict[str, set[object]] = {}
    for path, benchmark in spec.settings.items():
        whole, _, last = path.rpartition(".")
        if last == "benchmark":
            seed = spec.settings.get(f"{whole}.root_seed" if whole else "root_seed")
            seeds.setdefault(str(benchmark), set()).add(seed)
    return {benchmark: sorted(each, key=str) for benchmark, each in seeds.items()}


def settings_apart(run_a: Path, run_b: Path) -> pd.DataFrame:
    """What was asked differently of two runs: field, a, b. Missing where one has no such field."""
    a, b = (load_run_spec(run).settings for run in (run_a, run_b))
    paths = sorted(path for path in a.keys() | b.keys() if a.get(path) != b.get(path))
    rows = [(path, a.get(path, "–"), b.get(path, "–")) for path in paths]
    return pd.DataFrame(rows, columns=["field", "a", "b"])


def settings_markdown(settings: pd.DataFrame, name_a: str, name_b: str) -> str:
    """The fields that differ, one a line."""
    if settings.empty:
        return "Both runs were asked for the same.\n"
    missing = "“–”: that run has no such field; another version of skillstitch may have written it."
    lines = [missing, ""] if (settings == "–").any(axis=None) else []
    lines += [f"| Field | A: {name_a} | B: {name_b} |", "|" + " --- |" * 3]
    lines += [f"| {row.field} | {row.a} | {row.b} |" for row in settings.itertuples()]
    return "\n".join(lines) + "\n"


def _what_differs(a: RunSpec, b: RunSpec) -> str:
    """Names the first reason why no episode is common, and what would help."""
    for what, of_a, of_b in (
        ("method", a.methods, b.methods),
        ("seed", a.seeds, b.seeds),
        ("task", a.tasks, b.tasks),
    ):
        if not set(of_a) & set(of_b):
            return (
                f"nothing to compare: {a.name} and {b.name} have no {what} in common "
                f"({_some(of_a)} against {_some(of_b)})"
            )
    return (
        f"nothing to compare: {a.name} and {b.name} have no finished episode in common; "
        "resume the one that is incomplete"
    )


def _some(names: Iterable[object]) -> str:
    shown = [str(name) for name in names]
    return ", ".join(shown[:4]) + (", …" if len(shown) > 4 else "")


def comparison_markdown(comparison: pd.DataFrame, name_a: str, name_b: str) -> str:
    """The comparison as text, one table for each table of the runs."""
    lines = [
        f"# A: {name_a}, B: {name_b}",
        "",
        f"Paired over the (seed, task, episode) both runs played; 95 % intervals from {BOOTSTRAP}. "
        f"{seed_note(int(comparison['seeds'].min()))} Above zero, B scores higher. A difference is "
        "marked “apart” if its interval leaves out zero.",
    ]
    for table, part in comparison.groupby("table", sort=False):
        lines += ["", f"## {table}", "", f"| Task | Method | A: {name_a} | B: {name_b} | B − A | "
                  "95 % interval | Pairs | Seeds | |", "|" + " --- |" * 9]  # fmt: skip
        for cell in part.to_dict("records"):
            apart = cell["ci_low"] > 0 or cell["ci_high"] < 0
            lines.append(
                f"| {cell['row']} | {cell['method']} | {cell['score_a']:.3f} | "
                f"{cell['score_b']:.3f} | {cell['b_minus_a']:+.3f} | "
                f"[{cell['ci_low']:+.3f}, {cell['ci_high']:+.3f}] | {cell['pairs']:,} | "
                f"{cell['seeds']} | {'apart' if apart else ''} |"
            )
    return "\n".join(lines) + "\n"
