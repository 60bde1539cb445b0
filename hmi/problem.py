"""What a person is told when a request cannot be served."""


class Problem(Exception):  # noqa: N818 (what it is called where it is shown)
    """A refusal with a text of the catalogue; rendered as a page, and as JSON below `/api/`.

    Args:
        status: of HTTP.
        key: of the catalogue, `problem.what`.
        values: what the text's braces stand for; of a role, `role` is its name in the language.
    """

    def __init__(self, status: int, key: str, **values: object) -> None:
        super().__init__(key)
        self.status, self.key, self.values = status, key, values
