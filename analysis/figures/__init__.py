"""All figures of a run, drawn without a display and with reproducible bytes."""

from pathlib import Path

import pandas as pd

from analysis.figures.curves import draw_curves
from analysis.figures.diagnosis import draw_predictions, draw_value_curves
from analysis.figures.distribution import draw_distributions
from analysis.figures.drawn import Drawn
from analysis.figures.forecast import draw_forecast
from analysis.figures.pairs import draw_pairs
from analysis.figures.scores import draw_scores
from analysis.figures.showcase.showcases import draw_showcases
from analysis.figures.stitches import draw_outcomes
from analysis.figures.style import house_style, save
from analysis.run import Run
from analysis.studies.pairs import shown_orders, shown_pairs
from analysis.studies.stitches import begun
from analysis.tables.table import Table
from analysis.tables.writers import seed_note


def draw_figures(
    run: Run, tables: list[Table], folder: Path, forecast: pd.DataFrame | None = None
) -> list[Drawn]:
    """Draws what the run has data for, in the order of the report.

    forecast: the run's `analysis.studies.forecast.forecast_table`, where it has one.
    """
    drawn = []
    with house_style():
        for table in tables:
            name = f"{table.entry.id}-scores"
            save(draw_scores(table.scores, table.labels, table.seed_scores), folder, name)
            dotted = len(table.seed_scores["seed"].unique()) > 1  # of those that were played
            each = " Small dots: the mean of each seed." if dotted else ""
            caption = (
                f"{table.entry.title}: our scores (filled, with 95 % intervals) and the paper's "
                f"(hollow).{each} Scale {run.spec.scale}, {len(run.spec.seeds)} seed(s). "
                f"{seed_note(table.fewest_seeds)}"
            )
            drawn.append(Drawn(name, caption, table.entry.id))
            drawn += _distributions(table, folder)
        drawn += draw_showcases(run, folder)
        pair = _first_and_last_method(run)
        if pair:
            shown = shown_pairs(shown_orders(run.datasets) or [])
            framed = sorted(pair for pair in shown if {*pair} <= {*run.spec.skills})
            save(draw_pairs(run.segments, run.spec, pair, framed), folder, "pairs")
            notes = [(FRAMED, framed), (OWN_FIRSTS, run.spec.own_first_skill & {*pair})]
            caption = PAIRS_CAPTION + "".join(note for note, needed in notes if needed)
            drawn.append(Drawn("pairs", caption, ""))
        if forecast is not None and forecast["trials"].any():
            save(draw_forecast(forecast, run.spec), folder, "forecast")
            drawn.append(Drawn("forecast", FORECAST_CAPTION, ""))
        drawn += _diagnosis(run, folder)
        if any(begun(study) for study in run.stitches.values()):
            save(draw_outcomes(run.stitches), folder, "stitch-outcomes")
            drawn.append(Drawn("stitch-outcomes", OUTCOMES_CAPTION, ""))
        if run.training:
            save(draw_curves(run.training), folder, "curves")
            drawn.append(Drawn("curves", "Training, one line for each trained model.", ""))
    return drawn


PAIRS_CAPTION = (
    "How often the second skill succeeds once the first has, by ordered pair, over all seeds."
)
FRAMED = " Framed: pairs that occur in the data, one right after the other."
OWN_FIRSTS = " Each method's second skills follow its own first ones, so episodes differ."
FORECAST_CAPTION = (
    "How often the second skill succeeds once the first has, without a stitch. Left: the "
    "forecast from held-out demonstrations by the first seed's models. Right: forecast and "
    "played, one circle a pair, all seeds, the larger the more trials; on the "
    "dashed line both are equal."
)
DISTRIBUTION_CAPTION = (
    "Performance profiles (Agarwal et al., 2021): the share of runs, a task under one seed's "
    "models each, whose score is above τ. A line above another at every τ is better."
)
BANDS = " Bands are 95 % intervals from resampling seeds."
PREDICTIONS_CAPTION = (
    "Predictions of the dynamics on held-out demonstrations. Left: root mean square error over "
    "the distance moved; 1 (dashed) is no better than predicting that nothing moves. Right: the "
    "ensemble's disagreement against its mean's error, in standard deviations of the data; ρ is "
    "the rank correlation."
)
VALUE_CURVES_CAPTION = (
    "Value along held-out demonstrations, one thin line each; thick their mean, with the "
    "ensemble's mean spread. ρ is the rank correlation of value with time, averaged over them."
)

OUTCOMES_CAPTION = (
    "Stitches of the first seed's models, coloured by what came of them: each episode was also "
    "played on from the same state without a stitch. Stitches to a task's first skill, where there "
    "are any, and those between two skills have a row each. From left to right: the value of the "
    "skill to come, ensemble mean, along each stitch; distance to the nearest of that skill's own "
    "demonstrated states (1: one standard deviation in every number of them), above the dashed "
    "line the stitch led away from them, dotted how near demonstrations are to one another; what "
    "each plan's first action was to gain in value and did, below the dashed line less than "
    "predicted; and how much the value members and the dynamics members disagreed about the state "
    "predicted, on average over the stitch: the two variances that Eq. 2 subtracts."
)


def _distributions(table: Table, folder: Path) -> list[Drawn]:
    if not table.distributions:
        return []
    name = f"{table.entry.id}-distribution"
    save(draw_distributions(table), folder, name)
    several = any(of.seeds > 1 for of in table.distributions.values())
    return [Drawn(name, DISTRIBUTION_CAPTION + (BANDS if several else ""), table.entry.id)]


def _diagnosis(run: Run, folder: Path) -> list[Drawn]:
    drawn = []
    if run.diagnosis.get("predictions"):
        save(draw_predictions(run.diagnosis["predictions"]), folder, "diagnosis")
        drawn.append(Drawn("diagnosis", PREDICTIONS_CAPTION, ""))
    if run.diagnosis.get("values"):
        save(draw_value_curves(run.diagnosis["values"], run.spec), folder, "diagnosis-values")
        drawn.append(Drawn("diagnosis-values", VALUE_CURVES_CAPTION, ""))
    return drawn


def _first_and_last_method(run: Run) -> tuple[str, str] | None:
    """The two methods worth a matrix each: both played enough ordered pairs of skills.

    Where runs were merged, each of them shows its own.
    """
    if run.spec.parts:
        return None
    seconds = run.segments[run.segments["depth"] == 2]
    pairs = seconds.groupby("method")["prefix"].nunique()
    enough = 2 * len(run.spec.skills)
    methods = [method for method in run.spec.methods if pairs.get(method, 0) > enough]
    return (methods[0], methods[-1]) if len(methods) > 1 else None
