"""A table as Markdown, CSV and LaTeX, always beside the paper's numbers."""

import math
from collections.abc import Hashable, Mapping
from typing import Any

import pandas as pd

from analysis.paper.verdicts import (
    NO_DATA,
    NOT_JUDGED,
    NOT_PRINTED,
    cell_verdicts,
    claims,
    error_reading,
    explanation,
)
from analysis.tables.table import Table

Record = Mapping[Hashable, Any]
"""One line of a score or gain table, by column."""

BOOTSTRAP = (
    "a bootstrap over seeds, and within a seed over each first skill's episodes, drawn together "
    "for all tasks that begin with it (tasks are fixed)"
)
INTERVALS = (
    "Scores are means over all tasks of a cell ± variance over seeds (ddof = 0) with 95 % "
    f"intervals from {BOOTSTRAP}."
)


def to_csv(frame: pd.DataFrame) -> str:
    """Six decimals, so that the bytes do not hang on the last bit of a float."""
    return frame.to_csv(index=False, float_format="%.6f", lineterminator="\n")


def describe(table: Table) -> list[str]:
    """Sentences that belong beside every form of a table: scale, seeds, completeness."""
    spec = table.spec
    seeds = f"{len(spec.seeds)} seed{'s' if len(spec.seeds) > 1 else ''}"
    lines = [
        f"Scale: {spec.scale}. {seeds} ({', '.join(map(str, spec.seeds))}), "
        f"{spec.episodes} episodes per task, method and seed.",
        f"{INTERVALS} {seed_note(table.fewest_seeds)}",
    ]
    if table.fewest_seeds < len(spec.seeds):
        lines[-1] += f" That is so for some cells here: not all have {seeds}."
    if table.other_tasks:
        rows = (
            f"{row} ({here} here, {paper} there)"
            for row, (here, paper) in table.other_tasks.items()
        )
        lines.append(
            f"Not beside the paper's numbers, which are means over other tasks: {', '.join(rows)}."
        )
    if table.missing:
        asked, missing = sum(table.expected.values()), sum(table.missing.values())
        lines.insert(
            0,
            f"Partial table: {asked - missing:,} of {asked:,} episodes are there "
            f"({len(table.missing)} of {len(table.expected)} cells are short, "
            "each marked with its n).",
        )
    return lines


def seed_note(seeds: int) -> str:
    """What the number of seeds allows an interval to say.

    A percentile interval of up to four seeds can hardly leave the range of their means. That range
    leaves out the median of what they are drawn from only if all lie on one side of it.
    """
    if seeds == 1:
        return (
            "With one seed the intervals cover other episodes of these trained models, and not "
            "other training runs: those may differ by far more."
        )
    if seeds < 5:
        return (
            f"With only {seeds} seeds the intervals are rough: the more training runs differ, the "
            f"nearer to {100 * (1 - 2 ** (1 - seeds)):.0f} % is what they really cover."
        )
    if seeds < 10:
        return f"With only {seeds} seeds the intervals are rough, and if anything too narrow."
    return f"The intervals rest on {seeds} seeds."


def cell_text(cell: Record) -> str:
    """ "0.584 ± 0.000 [0.55, 0.61]" """
    if math.isnan(cell["score"]):
        return "–"
    return (
        f"{cell['score']:.3f} ± {cell['variance']:.3f} "
        f"[{cell['ci_low']:.3f}, {cell['ci_high']:.3f}]"
    )


def paper_text(cell: Record) -> str:
    """ "0.584 ± 0.000", or a dash where the paper prints nothing."""
    if math.isnan(cell["paper_score"]):
        return "–"
    return f"{cell['paper_score']:.3f} ± {cell['paper_error']:.3f}"


def short_of(table: Table, row: str, method: str) -> str:
    """ "n = 80 of 100" for a partial cell, else nothing."""
    missing = table.missing.get((row, method), 0)
    asked = table.expected.get((row, method), 0)
    return f"n = {asked - missing} of {asked}" if missing else ""


def to_markdown(table: Table) -> str:
    """Scores, gains, claims, and how to read them."""
    head = [f"# {table.entry.title}", "", *(f"{line}\n" for line in describe(table))]
    body = [_markdown_scores(table), "", explanation(table), "", error_reading(table)]
    if not table.gains.empty:
        body += ["", "## Paired gains", "", _markdown_gains(table)]
    found = claims(table)
    if found:
        body += ["", "## The paper's claims", ""]
        body += [f"- {claim.text}: **{claim.judgement}**. {claim.detail}." for claim in found]
    return "\n".join([*head, *body]).rstrip() + "\n"


def _markdown_scores(table: Table) -> str:
    verdicts = cell_verdicts(table)
    texts = {}
    for verdict, cell in zip(verdicts, table.scores.to_dict("records"), strict=True):
        lines = [cell_text(cell)]
        if verdict != NOT_PRINTED:
            judged = "" if verdict in (NO_DATA, NOT_JUDGED) else f" · {verdict}"
            lines.append(f"paper {paper_text(cell)}{judged}")
        lines.append(short_of(table, cell["row"], cell["method"]))
        texts[cell["row"], cell["method"]] = "<br>".join(filter(None, lines))
    header = ["Task", *(table.labels[method] for method in table.methods)]
    return markdown_table(
        header,
        [[row, *(texts.get((row, m), "") for m in table.methods)] for row in table.rows],
    )


def _markdown_gains(table: Table) -> str:
    header = ["Task", "Method", "over", "Gain", "95 % interval", "Relative", "Pairs", "Seeds"]
    return markdown_table(
        header, [gain_texts(table, gain) for gain in table.gains.to_dict("records")]
    )


def gain_texts(table: Table, gain: Record) -> list[str]:
    """The cells of one line of a gain table."""
    names = [gain["row"], table.labels[gain["method"]], table.labels[gain["baseline"]]]
    if gain["pairs"] == 0:
        return [*names, "–", "–", "–", "0", "0"]
    return [
        *names,
        f"{gain['gain']:+.3f}",
        f"[{gain['ci_low']:+.3f}, {gain['ci_high']:+.3f}]",
        "–" if math.isnan(gain["relative_gain"]) else f"{100 * gain['relative_gain']:+.1f} %",
        f"{gain['pairs']:,}",
        str(gain["seeds"]),
    ]


def markdown_table(header: list[str], rows: list[list[str]]) -> str:
    """Lines of text cells under a header."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


LATEX_SPECIAL = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "→": r"$\rightarrow$", "±": r"$\pm$", "α": r"$\alpha$", "β": r"$\beta$", "–": "--",
    "“": "``", "”": "''",
}  # fmt: skip


def latex(text: str) -> str:
    """Text that LaTeX prints as it stands."""
    return "".join(LATEX_SPECIAL.get(character, character) for character in text)


def to_latex(table: Table) -> str:
    """A booktabs table: each row ours, its interval, and the paper's below."""
    cells = {(cell["row"], cell["method"]): cell for cell in table.scores.to_dict("records")}
    lines = [
        r"% needs \usepackage{booktabs}",
        r"\begin{table}",
        r"  \centering",
        rf"  \caption{{{latex(' '.join([table.entry.title + '.', *describe(table)]))}}}",
        rf"  \label{{tab:{table.entry.id}}}",
        rf"  \begin{{tabular}}{{l{'c' * len(table.methods)}}}",
        r"    \toprule",
        "    " + " & ".join(["Task", *(latex(table.labels[m]) for m in table.methods)]) + r" \\",
        r"    \midrule",
    ]
    for row in table.rows:
        here = [cells.get((row, method)) for method in table.methods]
        lines += [_latex_row(latex(row), [_latex_score(cell) for cell in here])]
        lines += [_latex_row("", [_latex_interval(cell) for cell in here])]
        lines += [_latex_row(r"\quad paper", [_latex_paper(cell) for cell in here])]
        if any(short_of(table, row, method) for method in table.methods):
            lines += [_latex_row("", [short_of(table, row, m) for m in table.methods])]
    lines += [r"    \bottomrule", r"  \end{tabular}", r"\end{table}"]
    return "\n".join(lines) + "\n"


def _latex_row(head: str, cells: list[str]) -> str:
    return "    " + " & ".join([head, *cells]) + r" \\"


def _latex_score(cell: Record | None) -> str:
    if cell is None or math.isnan(cell["score"]):
        return "--"
    return rf"${cell['score']:.3f} \pm {cell['variance']:.3f}$"


def _latex_interval(cell: Record | None) -> str:
    if cell is None or math.isnan(cell["score"]):
        return ""
    return rf"{{\footnotesize $[{cell['ci_low']:.3f}, {cell['ci_high']:.3f}]$}}"


def _latex_paper(cell: Record | None) -> str:
    return "" if cell is None else latex(paper_text(cell))
