"""How each kind of artifact is made, and whose code decides what is in it."""

from orchestrator.builders.kitchen import KITCHEN_BUILDERS
from orchestrator.builders.long_horizon import LONG_HORIZON_BUILDERS
from orchestrator.builders.maze import MAZE_BUILDERS
from orchestrator.builders.parts import Builder
from orchestrator.builders.robosuite import ROBOSUITE_BUILDERS
from orchestrator.builders.studies import STUDY_BUILDERS
from orchestrator.builders.training import TRAINING_BUILDERS

BUILDERS: dict[str, Builder] = (
    TRAINING_BUILDERS
    | MAZE_BUILDERS
    | KITCHEN_BUILDERS
    | LONG_HORIZON_BUILDERS
    | ROBOSUITE_BUILDERS
    | STUDY_BUILDERS
)

# What decides a block's outcome beside its method and the models: Algorithm 1, what counts,
BLOCK_CODE = ("stitching.rollout", "stitching.envs.first_times")
# and how they are set up, without the method's code that these import for other purposes.
BLOCK_SETUP = ("orchestrator.builders.models", "orchestrator.methods", "orchestrator.worker")
