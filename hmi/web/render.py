"""Template rendering of pages and live parts."""

from collections.abc import Mapping
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from hmi.web.assets import Assets
from hmi.web.folders import FOLDERS, HMI
from hmi.web.translation import Locale


class Renderer:
    """Templates of all pages' folders, by their unique file names; inserted values are text, never markup.

    In every template: `t(key, **values)` a text of the catalogue, `w` the `Locale` with numbers and times,
    `static(name)` a file's address.
    """

    def __init__(self, assets: Assets) -> None:
        self._environment = Environment(
            loader=FileSystemLoader([HMI / folder for folder in FOLDERS]),
            autoescape=True,
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
            auto_reload=False,
            extensions=["jinja2.ext.do"],
        )
        self._environment.globals["static"] = assets.address  # pyrefly: ignore[unsupported-operation] (any value may be one)

    def render(self, template: str, locale: Locale, values: Mapping[str, Any]) -> Markup:
        """Render the template of a file name.

        Raises:
            jinja2.UndefinedError: a value is missing.
        """
        filled = self._environment.get_template(template).render({**values, "t": locale.text, "w": locale})
        return Markup(filled)  # noqa: S704 (a template's output, escaped as it was filled in)
