"""What the API reference takes from the code beside docstrings."""

from __future__ import annotations

import io
import tokenize
from typing import Any

from griffe import Attribute, Class, Docstring, Extension


class Fields(Extension):
    """Comments behind the fields of a class, with their shapes and units, are a table of fields."""

    def on_class_members(self, *, cls: Class, **_: Any) -> None:
        fields = [field for field in cls.attributes.values() if "property" not in field.labels]
        lines = [f"    {field.name}: {comment}" for field in fields if (comment := behind(field))]
        if lines:
            cls.docstring = cls.docstring or Docstring("", parent=cls, parser="google")
            cls.docstring.value += "\n".join(["\n", "Attributes:", *lines])


def behind(field: Attribute) -> str:
    """The comment at the end of a field's last line; empty where there is none."""
    tokens = tokenize.generate_tokens(io.StringIO(field.source).readline)
    comments = [token.string for token in tokens if token.type == tokenize.COMMENT]
    return comments[-1].lstrip("# ") if comments else ""
