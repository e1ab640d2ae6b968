"""Single-Policy: one policy for a whole task, instead of skills (paper 4.3.1, Table 4)."""

from __future__ import annotations

from dataclasses import dataclass

from stitching.bounds import Episodes
from stitching.envs.protocol import Benchmark
from stitching.methods.no_stitch import NoStitch
from stitching.methods.protocol import Method, MethodSettings
from stitching.models.iql import IQLConfig


@dataclass(frozen=True)
class SinglePolicySettings(MethodSettings):
    """One policy that is not told which skill is asked for: it takes no skill's vector."""

    task: str = ""  # what its demonstrations show, in this order and uncut: "a>b>c"
    episodes: Episodes = 240  # demonstrations
    training: IQLConfig = IQLConfig()

    @property
    def order(self) -> list[str]:
        """The skills of its task."""
        return self.task.split(">")

    def check(self, benchmark: Benchmark, agent: IQLConfig) -> None:
        """Refuse a task that the benchmark does not have."""
        if self.training.alters:
            raise ValueError("training: only the agent learns with swap and corrections")
        names = [skill.name for skill in benchmark.skills]
        if not set(self.order) <= set(names) or len(set(self.order)) < len(self.order):
            raise ValueError(
                f"task: {self.task!r} is no task; join skills by '>', each once, of "
                f"{', '.join(names)}"
            )


SINGLE_POLICY = Method("Single-Policy", SinglePolicySettings, NoStitch, policy="single-policy")
