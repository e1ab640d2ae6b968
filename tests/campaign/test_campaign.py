"""A few trials of every fault; `make campaign` does all of them."""

import pytest

from tests.campaign.faults import FAULTS
from tests.campaign.ground import Fault, Ground, NotTriedError

CASES = [
    pytest.param(
        fault,
        trial,
        id=f"{fault.name}, {trial}",
        marks=[pytest.mark.ray, pytest.mark.slow, pytest.mark.timeout(240)]
        if fault.needs_ray
        else [],
    )
    for fault in FAULTS
    for trial in fault.tested
]


@pytest.fixture(scope="module")
def ground(tmp_path_factory: pytest.TempPathFactory) -> Ground:
    return Ground(tmp_path_factory.mktemp("campaign"))


@pytest.mark.parametrize(("fault", "trial"), CASES)
def test_a_fault_is_survived(ground: Ground, fault: Fault, trial: int) -> None:
    try:
        assert fault.harm(ground, trial)
    except NotTriedError as error:
        pytest.skip(str(error))


def test_every_fault_has_a_name_of_its_own() -> None:
    assert len({fault.name for fault in FAULTS}) == len(FAULTS)
