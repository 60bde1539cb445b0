"""Metrics, progress and audit trail of one start of the station."""

from collections.abc import Mapping
from dataclasses import dataclass

from station.runtime.observability.audit_logger import AuditLogger
from station.runtime.observability.health import Liveness
from station.runtime.observability.metrics import Metrics


@dataclass(frozen=True)
class Observability:
    """Metrics, progress and audit trail of one start, with what identifies it."""

    boot: str
    """This start of the station; another one after each restart."""
    versions: Mapping[str, str]
    """Versions of the programs, by name."""
    metrics: Metrics
    liveness: Liveness
    audit: AuditLogger
