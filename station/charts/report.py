"""Parts of every report in one file: its templates, and its pictures as text."""

import base64

import jinja2


def templates(package: str) -> jinja2.Environment:
    """Return the environment of the templates in a package's folder `templates`.

    Args:
        package: its dotted name.
    """
    return jinja2.Environment(
        loader=jinja2.PackageLoader(package, "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def data_uri(picture: bytes) -> str:
    """Return a picture as a data URI.

    Args:
        picture: the content of a PNG or a JPEG.
    """
    kind = "png" if picture.startswith(b"\x89PNG") else "jpeg"
    return f"data:image/{kind};base64," + base64.b64encode(picture).decode()
