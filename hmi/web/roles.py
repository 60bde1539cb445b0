"""Roles and rights at the panel."""

from enum import StrEnum


class Role(StrEnum):
    """A person's role at the panel."""

    VIEWER = "viewer"
    """A person who is not logged in."""
    OPERATOR = "operator"
    QUALITY = "quality"
    MAINTENANCE = "maintenance"
    ADMIN = "admin"


class Right(StrEnum):
    """An action that needs a role."""

    RUN = "run"
    """Start, stop and abort; lots; recover after a stop."""
    CHANGE_FRUIT = "change_fruit"
    HANDLE_ALARMS = "handle_alarms"
    """Acknowledge and shelve."""
    EDIT_RECIPES = "edit_recipes"
    """Drafts, import and export."""
    APPROVE_RECIPES = "approve_recipes"
    """Never of one's own draft, which the station itself checks."""
    MAINTAIN = "maintain"
    """Mode, jog, lights, calibration and verification."""
    MANAGE_PEOPLE = "manage_people"
    CONFIGURE = "configure"
    """See and edit `station.yaml`."""


_OPERATING = frozenset({Right.RUN, Right.CHANGE_FRUIT, Right.HANDLE_ALARMS})

RIGHTS: dict[Role, frozenset[Right]] = {
    Role.VIEWER: frozenset(),
    Role.OPERATOR: _OPERATING,
    Role.QUALITY: _OPERATING | {Right.EDIT_RECIPES, Right.APPROVE_RECIPES},
    Role.MAINTENANCE: _OPERATING | {Right.MAINTAIN},
    Role.ADMIN: frozenset(Right),
}
"""A viewer may read everything; a change needs one of these."""


def least_role(right: Right) -> Role:
    """Return the lowest role that has a right."""
    return next(role for role in Role if right in RIGHTS[role])
