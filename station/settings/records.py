"""Records settings: storage of inspections and images."""

from station.settings.model import Settings, setting


class RecordsSettings(Settings):
    """Records in the home folder's `records`."""

    deadline_s: float = setting(
        2.0,
        title="Deadline",
        description="Longest wait until a trigger or an outcome is on the disk; then it is refused or NO_RESULT.",
        unit="s",
        gt=0.0,
        le=30.0,
    )
    free_reserve_mb: int = setting(
        200,
        title="Free reserve",
        description=(
            "With less space than this (megabytes) left on the disk no inspection is started; with less than twice as "
            "much, images are removed as beyond their quota."
        ),
        unit="MB",
        ge=1,
        le=1_000_000,
    )
    images_quota_mb: int = setting(
        5_000,
        title="Images' quota",
        description=(
            "Space for images (megabytes). Beyond it the oldest of accepted fruit are removed first, then the oldest "
            "of rejected; 0 stores none. An inspection's images take about 1.5 MB."
        ),
        unit="MB",
        ge=0,
        le=10_000_000,
    )
    accepted_share: float = setting(
        0.02,
        title="Share of accepted fruit",
        description="Share of the PASS fruit whose images are stored, evenly spread; images of all other "
        "fruit are always stored.",
        ge=0.0,
        le=1.0,
    )
    images_queue: int = setting(
        4,
        title="Images' queue",
        description="Inspections whose images may wait for the disk; more are dropped, with a log line.",
        ge=1,
        le=64,
    )
