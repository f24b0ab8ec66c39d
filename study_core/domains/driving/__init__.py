"""The paper's driving task, `driving-v1`."""

from study_core.domains.driving.domain import DRIVING_V1

__all__ = ["DRIVING_V1"]
