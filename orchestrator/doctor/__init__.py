"""What `skillstitch doctor` looks at: whether this machine can do the work, and if not, why.

Each check reads one thing of the machine and hands it to a pure function that judges it.
"""

from orchestrator.doctor.diagnosis import diagnose
from orchestrator.doctor.finding import Finding, as_lines, as_table, has_faults

__all__ = ["Finding", "as_lines", "as_table", "diagnose", "has_faults"]
