"""What can happen to a run, a file a kind."""

from tests.campaign.faults import crowded, damaged, killed, poisonous, torn

FAULTS = (
    *killed.FAULTS,
    *torn.FAULTS,
    *damaged.FAULTS,
    *crowded.FAULTS,
    *poisonous.FAULTS,
)
