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


def short_text(value: Any) -> str:
    """A value as text that MLflow takes, cut where it is too long."""
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= LONGEST_TEXT else f"{text[: LONGEST_TEXT - 1]}…"
