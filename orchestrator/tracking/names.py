"""Names and texts within what MLflow takes."""

from __future__ import annotations

import json
import re
from typing import Any

LONGEST_TEXT = 500  # of a param or tag: what every MLflow version takes
LONGEST_KEY = 250


def experiment_name(benchmark: str) -> str:
    """The MLflow experiment that holds all runs and sweeps of a benchmark."""
    return f"skillstitch/{benchmark}"


def allowed_name(text: str) -> str:
    """MLflow takes letters, digits and "_-. :/" in names: "mic → lig" becomes "mic to lig"."""
    words = re.sub(r"[^\w\-. :/]", " ", text.replace("→", "to")).split()
    return " ".join(words).replace(" /", "/")[:LONGEST_KEY]


def metric_name(text: str) -> str:
    """The same without spaces: "table1/2 goals/mic → lig" becomes "table1/2_goals/mic_to_lig"."""
    return allowed_name(text.replace(":", " ")).replace(" ", "_")


def run_name(*parts: str) -> str:
    """ "table1 · quick · 3f2a": parts that are empty are left out."""
    return " · ".join(part for part in parts if part)


def short_id(run_id: str) -> str:
    """The part of a run's id that its MLflow runs are named by."""
    return run_id[:4]


def short_text(value: Any) -> str:
    """A value as text that MLflow takes, cut where it is too long."""
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= LONGEST_TEXT else f"{text[: LONGEST_TEXT - 1]}…"
