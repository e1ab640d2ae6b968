"""Settings of methods and planners, in the fields that are made for whatever is registered.

Type checkers do not know these fields; here they are told by the types of what they hold.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

from stitching.bounds import Bounded

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Owner = TypeVar("Owner", bound=DataclassInstance)
else:
    Owner = TypeVar("Owner")
Section = TypeVar("Section", bound=Bounded)


def section(owner: object, kind: type[Section]) -> Section:
    """`section(spec, MBStitchSettings)` is `spec.mb_stitch`."""
    (found,) = (value for value in vars(owner).values() if type(value) is kind)
    return found


def with_sections(owner: Owner, *sections: Bounded) -> Owner:
    """`with_sections(spec, settings)` is `replace(spec, mb_stitch=settings)` of MB-Stitch's."""
    return replace(owner, **fields_of(owner, *sections))


def fields_of(owner: object, *sections: Bounded) -> dict[str, Any]:
    """Sections by the names of their fields, to be replaced with others that must fit them."""
    names = {type(value): name for name, value in vars(owner).items()}
    return {names[type(one)]: one for one in sections}
