"""The parts of the page that are tables and lists."""

import math
from html import escape

from analysis.paper.verdicts import (
    HOLDS,
    NO_DATA,
    NOT_JUDGED,
    NOT_PRINTED,
    ONE_SEED,
    cell_verdicts,
    claims,
)
from analysis.tables.table import Table
from analysis.tables.writers import Record, gain_texts, paper_text, short_of


def html_table(header: list[str], rows: list[list[str]]) -> str:
    """A plain table of text; the first cell of each line heads it."""
    return table_of(header, [[head, *map(escape, cells)] for head, *cells in rows])


def table_of(header: list[str], rows: list[list[str]], attributes: str = "") -> str:
    """A table whose header and first cells are text, and whose other cells are HTML."""
    heads = "".join(f'<th scope="col">{escape(title)}</th>' for title in header)
    body = "".join(
        f'<tr><th scope="row">{escape(head)}</th>'
        + "".join(f"<td>{cell}</td>" for cell in cells)
        + "</tr>"
        for head, *cells in rows
    )
    return (
        f'<div class="scroll" tabindex="0"><table{attributes}><thead><tr>{heads}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def scores_html(table: Table) -> str:
    """Each cell: our score, its interval, the paper's, and the verdict."""
    verdicts = cell_verdicts(table)
    cells = {
        (cell["row"], cell["method"]): _score_cell(table, cell, verdict)
        for cell, verdict in zip(table.scores.to_dict("records"), verdicts, strict=True)
    }
    heads = "".join(
        f'<th scope="col">{escape(title)}</th>'
        for title in ["Task", *(table.labels[method] for method in table.methods)]
    )
    body = "".join(
        f'<tr><th scope="row">{escape(row)}</th>'
        + "".join(f"<td>{cells.get((row, method), '')}</td>" for method in table.methods)
        + "</tr>"
        for row in table.rows
    )
    return (
        f'<div class="scroll" tabindex="0"><table class="scores"><thead><tr>{heads}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _score_cell(table: Table, cell: Record, verdict: str) -> str:
    if math.isnan(cell["score"]):
        html = f'<span class="score">–</span><span class="aside">{NO_DATA}</span>'
    else:
        html = (
            f'<span class="score">{cell["score"]:.3f} ± {cell["variance"]:.3f}</span>'
            f'<span class="aside">[{cell["ci_low"]:.3f}, {cell["ci_high"]:.3f}]</span>'
        )
    if verdict != NOT_PRINTED:
        html += f'<span class="aside">paper {paper_text(cell)}</span>'
    if verdict not in (NOT_PRINTED, NOT_JUDGED):
        html += f'<span class="verdict {verdict.replace(" ", "-")}">{verdict}</span>'
    short = short_of(table, cell["row"], cell["method"])
    return html + (f'<span class="partial-cell">{short}</span>' if short else "")


def claims_html(table: Table) -> str:
    """The paper's claims with their verdicts."""
    found = claims(table)
    if not found:
        return ""
    items = "".join(
        f'<li><span class="verdict {claim.verdict.replace(" ", "-")}">{claim.judgement}</span> '
        f"{escape(claim.text)}"
        f'<span class="aside" style="white-space: normal">{escape(claim.detail)}</span></li>'
        for claim in found
    )
    held = sum(claim.verdict == HOLDS for claim in found)
    whose = f" {ONE_SEED}" if any(claim.seeds == 1 for claim in found) else ""
    return (
        f"<h3>The paper's claims: {held} of {len(found)} hold{whose}</h3>"
        f'<ul class="claims">{items}</ul>'
    )


def gains_html(table: Table) -> str:
    """Paired gains, folded away."""
    if table.gains.empty:
        return ""
    header = ["Task", "Method", "over", "Gain", "95 % interval", "Relative", "Pairs", "Seeds"]
    lines = [gain_texts(table, gain) for gain in table.gains.to_dict("records")]
    return f"<details><summary>Paired gains</summary>{html_table(header, lines)}</details>"
