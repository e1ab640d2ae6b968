"""The report as one self-contained HTML page: everything it shows is inside the file."""

import json
from html import escape
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.figures.drawn import Drawn
from analysis.page.distribution import distribution_html
from analysis.page.figures import figure_html, named_figures
from analysis.page.frame import asset, badges_html, framed
from analysis.page.origin import TITLE as AGAIN
from analysis.page.origin import origin_section
from analysis.page.profile import TITLE as PROFILE_TITLE
from analysis.page.profile import profile_section
from analysis.page.sources import section_links, source_html
from analysis.page.studies import (
    forecast_section,
    models_section,
    pairs_section,
    rates_section,
    stitches_section,
)
from analysis.page.tables import claims_html, gains_html, html_table, scores_html
from analysis.paper.verdicts import error_reading, explanation
from analysis.run import Run
from analysis.studies.data import undemonstrated, undemonstrated_note
from analysis.tables.skills import permutation_scores, single_skill_rates
from analysis.tables.table import Table
from analysis.tables.writers import BOOTSTRAP, describe, seed_note

OF_PAIRS = ("forecast",)
OF_MODELS = ("diagnosis", "diagnosis-values")
OF_STITCHES = ("stitch-outcomes",)
"""Figures that stand beside what they are about, and not with those of the whole run."""

PERMUTATION_COLUMNS: list[dict[str, Any]] = [
    {"title": "Task", "digits": None},
    {"title": "Skills", "digits": 0},
    {"title": "Method", "digits": None},
    {"title": "Score", "digits": 3, "share": True},
    {"title": "All skills", "digits": 3, "share": True},
    {"title": "Mean steps", "digits": 1},
    {"title": "Episodes", "digits": 0},
]
"""`digits` after the point of numbers, None for text; `share` draws a bar from 0 to 1."""


def render_page(
    run: Run,
    episodes: pd.DataFrame,
    tables: list[Table],
    studies: dict[str, pd.DataFrame],
    drawn: list[Drawn],
    figures: Path,
) -> str:
    """The whole page; `figures` is the folder the figures were drawn into."""
    sections = {
        "data": ("Skills without data", _left_out(run)),
        "quarantine": ("Quarantine", _quarantine(run)),
        **{
            table.entry.id: (table.entry.title, _table_section(table, drawn, figures))
            for table in tables
        },
        "figures": (
            "Figures",
            "".join(
                figure_html(figure, figures)
                for figure in drawn
                if not figure.table and figure.name not in OF_PAIRS + OF_MODELS + OF_STITCHES
            ),
        ),
        "profile": (PROFILE_TITLE, profile_section(studies.get("profile"), run.spec)),
        "rates": ("What there is to stitch", rates_section(studies.get("rates"))),
        "pairs": ("Pairs of skills", pairs_section(run, studies.get("pair-groups"))),
        "forecast": (
            "A forecast of pairs",
            forecast_section(studies.get("forecast")) + named_figures(OF_PAIRS, drawn, figures),
        ),
        "models": (
            "Are the models right?",
            models_section(run, studies.get("models")) + named_figures(OF_MODELS, drawn, figures),
        ),
        "stitches": (
            "When does stitching hurt?",
            stitches_section(run, studies) + named_figures(OF_STITCHES, drawn, figures),
        ),
        "skills": ("Single skills", _single_skills(run)),
        "every-task": ("Every permutation", _permutation_section(run)),
        "again": (AGAIN, origin_section(run.spec)),
        "provenance": ("Provenance", _provenance(run.provenance)),
        "reading": ("How to read this", _reading(run, tables)),
    }
    linked = {
        name: (title, content + section_links(name, studies) if content else "")
        for name, (title, content) in sections.items()
    }
    data = _permutation_data(run, episodes)
    scripts = [
        f'<script type="application/json" id="permutation-data">{data}</script>',
        f"<script>\n{asset('report.js')}\n</script>",
    ]
    title, badges = run.spec.title, _badges(run, tables)
    return framed(title, run.spec.benchmark, badges, linked, "\n".join(scripts))


def _badges(run: Run, tables: list[Table]) -> str:
    seeds = len(run.spec.seeds)
    badges = [
        f"scale: {run.spec.scale}",
        f"{seeds} seed{'s' if seeds > 1 else ''}",
        f"{run.spec.episodes} episodes a task, method and seed",
        f"{len(run.spec.tasks):,} tasks",
    ]
    return badges_html(badges, partial=any(table.missing for table in tables))


def _left_out(run: Run) -> str:
    note = undemonstrated_note(undemonstrated(run))
    return f'<p class="notice">{escape(note)}</p>' if note else ""


def _quarantine(run: Run) -> str:
    if not run.quarantine:
        return ""
    lines = [
        [
            block["method"] or "first skill, shared",
            str(block["seed"]),
            run.spec.task_label(block["prefix"]),
            str(len(block["episodes"])),
            block["error"],
        ]
        for block in run.quarantine
    ]
    return (
        '<p class="notice">These blocks of episodes failed again and again and were set aside. '
        "Every task that goes through such a block is shown without any of the block's episodes, "
        "those that had failed before it included: what is missing then does not depend on how "
        "an episode went. They count neither as successes nor as failures.</p>"
        + html_table(["Method", "Seed", "Skills", "Episodes", "Last error"], lines)
    )


def _table_section(table: Table, drawn: list[Drawn], figures: Path) -> str:
    notes = [*describe(table), explanation(table), error_reading(table)]
    return "".join(
        [
            f'<p class="notice">{escape(notes.pop(0))}</p>' if table.missing else "",
            scores_html(table),
            source_html(table),
            *(f'<p class="note">{escape(note)}</p>' for note in notes if note),
            *(figure_html(figure, figures) for figure in drawn if figure.table == table.entry.id),
            distribution_html(table),
            claims_html(table),
            gains_html(table),
        ]
    )


def _single_skills(run: Run) -> str:
    rates = single_skill_rates(run.segments, run.spec)
    if rates.empty:
        return ""
    shared = ", ".join(run.spec.sharing_first_skills) if run.spec.own_first_skill else "all methods"
    lines = [
        [
            run.spec.skill_label(rate["skill"]),
            run.spec.methods.get(rate["method"], shared),
            f"{rate['successes']:,} of {rate['trials']:,}",
            f"{rate['rate']:.3f}",
            f"[{rate['low']:.3f}, {rate['high']:.3f}]",
        ]
        for rate in rates.to_dict("records")
    ]
    return (
        '<p class="note">How often each skill succeeds when it comes first, over all seeds, with '
        "Wilson's 95 % interval. It takes episodes as independent and covers other episodes of the "
        "models trained here; other training runs may differ by far more.</p>"
        + html_table(["Skill", "Played by", "Successes", "Rate", "95 % interval"], lines)
    )


def _permutation_section(run: Run) -> str:
    options = "".join(
        f'<option value="{escape(label)}">{escape(label)}</option>'
        for label in run.spec.methods.values()
    )
    heads = "".join(
        f'<th scope="col" class="{"text" if column["digits"] is None else "number"}">'
        f'<button type="button">{column["title"]}</button></th>'
        for column in PERMUTATION_COLUMNS
    )
    return (
        '<div class="controls">'
        '<label>Tasks with<input id="permutation-filter" type="search" autocomplete="off" '
        'placeholder="words of skill names"></label>'
        f'<label>Method<select id="permutation-method"><option value="">all</option>{options}'
        '</select></label><span id="permutation-count" class="note" aria-live="polite"></span>'
        '</div><div class="scroll" tabindex="0"><table id="permutations">'
        f"<thead><tr>{heads}</tr></thead><tbody></tbody></table></div>"
        '<p><button type="button" id="permutation-more">Show more</button></p>'
        "<noscript>This table needs JavaScript; permutations.csv beside this page holds the same "
        "numbers.</noscript>"
    )


def _permutation_data(run: Run, episodes: pd.DataFrame) -> str:
    """JSON that cannot end the script element it stands in."""
    spec = run.spec
    rows = [
        [spec.task_label(row["task"]), row["length"], spec.methods[row["method"]],
         round(row["score"], 4), round(row["complete"], 4), round(row["steps"], 2),
         row["episodes"]]
        for row in permutation_scores(episodes, spec).to_dict("records")
    ]  # fmt: skip
    data = {"columns": PERMUTATION_COLUMNS, "rows": rows}
    return json.dumps(data, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")


def _provenance(provenance: dict[str, Any]) -> str:
    lines = [[name, value] for name, value in _flatten(provenance)]
    return html_table(["What", "Value"], lines) if lines else ""


def _flatten(value: Any, name: str = "") -> list[tuple[str, str]]:
    """Nested dictionaries as dotted names."""
    if not isinstance(value, dict):
        text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
        return [(name, text)]
    return [
        pair
        for key, inner in value.items()
        for pair in _flatten(inner, f"{name}.{key}" if name else str(key))
    ]


def _reading(run: Run, tables: list[Table]) -> str:
    fewest = min((table.fewest_seeds for table in tables), default=len(run.spec.seeds))
    paragraphs = [
        "A score is accomplished skills divided by skills in the task, in order: once a skill is "
        "missed, nothing after it counts.",
        f"Intervals come from 1,000 resamples: {BOOTSTRAP}. A seed retrains everything and serves "
        "every task, so it is the unit that matters; tasks with a common beginning are the same "
        "episodes for so long, so they are not resampled one by one. "
        f"{seed_note(fewest)}",
        "Gains are paired: methods meet the same random numbers of the environment in the same "
        "(seed, task, episode), methods that do not stitch to first skills share those, and the "
        "interval is that of the difference.",
        "Environments, data and unpublished details are our own: agreement with the paper means "
        "the same effect under the same protocol, not the same random numbers.",
    ]
    return "".join(f'<p class="note">{escape(paragraph)}</p>' for paragraph in paragraphs)
