"""Refusal of a request, with its text."""


class Problem(Exception):  # noqa: N818 (the pages' term)
    """A refusal with a text of the catalogue; rendered as a page, and as JSON below `/api/`.

    Args:
        key: of the catalogue, `problem.what`.
        values: values for the text's braces; of a role, `role` is its name in the language.
    """

    def __init__(self, status: int, key: str, **values: object) -> None:
        super().__init__(key)
        self.status, self.key, self.values = status, key, values
