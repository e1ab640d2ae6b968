"""Imports that are put off: torch alone takes two CPU seconds, and a plan computes nothing."""

from __future__ import annotations

import importlib
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any


class _StandIn(ModuleType):
    """In the place of a module until something of it is used; the module itself from then on."""

    def __getattr__(self, name: str) -> Any:
        if sys.modules.get(self.__name__) is self:
            del sys.modules[self.__name__]
        return getattr(importlib.import_module(self.__name__), name)


def import_lazily(name: str) -> None:
    """From now on `import name` costs nothing; the first use of something in it does.

    For commands that hardly ever come to such a use.
    """
    if name not in sys.modules:
        stand_in = _StandIn(name)
        stand_in.__spec__ = ModuleSpec(name, None)  # importing it again asks for nothing else
        sys.modules[name] = stand_in
