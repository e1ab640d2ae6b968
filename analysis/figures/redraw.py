"""Score figures of kept results, drawn anew: `python -m analysis.figures.redraw results/table2 …`.

Results of earlier versions have no segments beside them, so their report cannot be built again.
The numbers of this figure are all in `scores.csv`, and those of each seed in `seeds.csv`, if it is
there.
"""

import argparse
from pathlib import Path

import pandas as pd

from analysis.figures.scores import draw_scores
from analysis.figures.style import house_style, save
from analysis.schema import RunError


def redraw_scores(folder: Path) -> str:
    """Draw `figures/<table>-scores` of a folder that an export wrote; returns the figure's name.

    Methods are called what the table's Markdown calls them. Raises RunError where the folder holds
    no exported table.
    """
    scores, markdown = folder / "scores.csv", folder / "table.md"
    for needed in (scores, markdown):
        if not needed.is_file():
            raise RunError(f"no {needed.name} in {folder}: give the folder of an exported table")
    cells = pd.read_csv(scores)
    lines = markdown.read_text(encoding="utf-8").splitlines()
    head = next((line for line in lines if line.startswith("| Task |")), "")
    methods = list(dict.fromkeys(cells["method"]))
    labels = [label.strip() for label in head.split("|")[2:-1]]
    if len(labels) != len(methods):
        raise RunError(f"{markdown} names other methods than {scores}: export the table again")
    seeds = folder / "seeds.csv"
    of_seeds = pd.read_csv(seeds) if seeds.is_file() else None
    name = f"{folder.resolve().name}-scores"
    with house_style():
        figure = draw_scores(cells, dict(zip(methods, labels, strict=True)), of_seeds)
        save(figure, folder / "figures", name)
    return name


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Draw score figures of exported tables anew.")
    parser.add_argument("folders", nargs="+", type=Path, help="e.g. results/table2")
    for each in parser.parse_args().folders:
        print(each / "figures" / redraw_scores(each))
