"""Which of a spec's fields a command's help shows: those that most runs need, or all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass

from tyro.constructors import ConstructorRegistry, StructConstructorSpec, StructTypeInfo

from orchestrator.spec.spec import Spec, TableSpec

HELP_ALL = "--help-all"
MORE = f"{HELP_ALL} shows the settings of data, models, planners and methods, too."


@contextmanager
def basics_alone(spec: Spec) -> Iterator[None]:
    """Here tyro makes no options of what has fields itself within a spec."""
    values = (getattr(spec, one.name) for one in fields(spec))
    parts = {type(value) for value in values if is_dataclass(value)} | {TableSpec}
    registry = ConstructorRegistry()

    @registry.struct_rule
    def _without_options(info: StructTypeInfo) -> StructConstructorSpec | None:
        if info.type not in parts:
            return None
        return StructConstructorSpec(instantiate=lambda: info.default, fields=())

    with registry:
        yield
