"""Schema: messages with ids where sentences were, in an inspection's explanation and measures."""

revision = "0008"
down_revision = "0007"


def upgrade() -> None:
    """Change nothing: a sentence that is there is read as it is. An earlier program could not read the messages."""
