"""Parts of every report in one file: its templates, and its pictures as text."""

import base64
from io import BytesIO

import jinja2


def templates(package: str) -> jinja2.Environment:
    """Return the environment of the templates in the folder `templates` of a package, by its dotted name."""
    return jinja2.Environment(
        loader=jinja2.PackageLoader(package, "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def png(figure) -> bytes:  # noqa: ANN001 (matplotlib's, which takes long to import)
    """Return a figure as a PNG."""
    data = BytesIO()
    figure.savefig(data, format="png", dpi=110)
    return data.getvalue()


def data_uri(picture: bytes) -> str:
    """Return a PNG or a JPEG as a data URI."""
    kind = "png" if picture.startswith(b"\x89PNG") else "jpeg"
    return f"data:image/{kind};base64," + base64.b64encode(picture).decode()
