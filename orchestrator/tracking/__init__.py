"""The MLflow view of a run directory: the directory is the truth, the view can always be rebuilt.

One parent run a reproduction and one child run a (method, seed), found again by their tags, so
that publishing is idempotent: whatever a kill left half done, the next publish completes.
MLflow is imported inside functions, because that takes seconds and most commands need none of it.
"""

from orchestrator.tracking.killing import mark_killed
from orchestrator.tracking.live import Live
from orchestrator.tracking.publishing import PublishOutcome, publish
from orchestrator.tracking.stores import default_uri

__all__ = ["Live", "PublishOutcome", "default_uri", "mark_killed", "publish"]
