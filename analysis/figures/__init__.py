"""All figures of a run, drawn without a display and with reproducible bytes."""

from dataclasses import dataclass
from pathlib import Path

from analysis.figures.curves import draw_curves
from analysis.figures.maze import draw_showcase
from analysis.figures.pairs import draw_pairs
from analysis.figures.scores import draw_scores
from analysis.figures.style import house_style, save
from analysis.run import Run
from analysis.tables import Table


@dataclass(frozen=True)
class Drawn:
    """A figure on disk: <name>.svg and <name>.png, and what it shows, in words."""

    name: str
    caption: str
    table: str  # id of the table it belongs to, "" if to the whole run


def draw_figures(run: Run, tables: list[Table], folder: Path) -> list[Drawn]:
    """Draws what the run has data for, in the order of the report."""
    drawn = []
    with house_style():
        for table in tables:
            name = f"{table.entry.id}-scores"
            save(draw_scores(table), folder, name)
            caption = (
                f"{table.entry.title}: our scores (filled, with 95 % intervals) and the paper's "
                f"(hollow). Scale {run.spec.scale}, {len(run.spec.seeds)} seed(s)."
            )
            drawn.append(Drawn(name, caption, table.entry.id))
        if run.showcase:
            save(draw_showcase(run.showcase, run.spec.methods), folder, "showcase")
            drawn.append(Drawn("showcase", SHOWCASE_CAPTION, ""))
        pair = _first_and_last_method(run)
        if pair:
            save(draw_pairs(run.segments, run.spec, pair), folder, "pairs")
            drawn.append(Drawn("pairs", PAIRS_CAPTION, ""))
        if run.training:
            save(draw_curves(run.training), folder, "curves")
            drawn.append(Drawn("curves", "Training, one line for each trained model.", ""))
    return drawn


SHOWCASE_CAPTION = (
    "As Figure 1 of the paper: demonstrated skills (left), then whole episodes, the skill in "
    "charge by colour, stitching dashed. Paths are drawn a little apart."
)
PAIRS_CAPTION = (
    "How often the second skill succeeds once the first has, by ordered pair, over all seeds."
)


def _first_and_last_method(run: Run) -> tuple[str, str] | None:
    """The two methods worth a matrix each: both played most ordered pairs of skills."""
    seconds = run.segments[run.segments["depth"] == 2]
    pairs = seconds.groupby("method")["prefix"].nunique()
    skills = len(run.spec.skills)
    most = skills * (skills - 1) / 2
    methods = [method for method in run.spec.methods if pairs.get(method, 0) > most]
    return (methods[0], methods[-1]) if len(methods) > 1 else None
