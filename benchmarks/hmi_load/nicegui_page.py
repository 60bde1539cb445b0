"""Page Run made with NiceGUI: the peer of the station's own pages, with the same figures, charts and picture.

Run as a program: `nicegui_page.py CONFIGURATION PORT`, with the packages of `nicegui.lock` on the path. It polls the
station by the pages' own gateway, as often as the page Run is updated, and draws by the same charts: what differs is
how elements and their changes come to a browser. NiceGUI's server and settings are its defaults.
"""

import base64
import sys
from pathlib import Path

from fastapi.responses import Response
from nicegui import app, ui  # pyrefly: ignore[missing-import] (an environment of its own has it)

from hmi.run import charts
from hmi.web.gateway import Gateway
from hmi.web.translation import Locale
from station.channel.panel_run import Fruit, GetPicture, Picture
from station.charts.spark import spark
from station.settings.configuration import load_configuration
from station.settings.hmi import panel_endpoint

HOST = "127.0.0.1"
TILES = 10
"""Of the latest fruit, as the page Run has them."""

site = load_configuration(Path(sys.argv[1]))
gateway = Gateway(panel_endpoint(site.hmi, site.home), site.hmi.refresh_s)
locale = Locale("en")


@app.get("/fruit/{sequence}/picture.jpg")
async def picture(sequence: int) -> Response:
    """Send a fruit's picture, which a browser caches."""
    found = await gateway.request(GetPicture(sequence=sequence), Picture)
    headers = {"cache-control": "private, max-age=31536000, immutable"}
    return Response(base64.b64decode(found.jpeg), media_type="image/jpeg", headers=headers)


class Page:
    """One browser's page: its elements, filled in from the gateway."""

    def __init__(self) -> None:
        ui.add_css("svg.chart, svg.spark { fill: none; stroke: #333 } svg text { fill: #333; stroke: none }")
        with ui.row():
            with ui.card():
                self.state, self.activity = ui.label(), ui.label()
            with ui.card().style("width: 560px"):
                self.outcome, self.reason, self.area = ui.label(), ui.label(), ui.label()
                self.picture, self.curve = (
                    ui.image().classes("fruit-picture").style("width: 240px"),
                    ui.html(sanitize=False),
                )
            with ui.card().style("width: 380px"):
                self.recipe, self.counts, self.rate = ui.label(), ui.label(), ui.label()
                self.trend = ui.html(sanitize=False)
        with ui.row():
            self.tiles = [(ui.label(), ui.html(sanitize=False)) for _ in range(TILES)]
        self.shown: tuple[str, int | None] | None = None
        ui.timer(site.hmi.refresh_s, self.fill)

    def fill(self) -> None:
        """Write what the station sent last; NiceGUI sends what has changed."""
        state, last = gateway.state, gateway.last
        if state is None:
            return
        self.state.text = "ready" if state.ready else state.packml_state or "unknown"
        self.activity.text = locale.sentence(state.activity)
        self.recipe.text = locale.title(state.recipe.title) if state.recipe else "no recipe"
        counts = state.lot_counts
        self.counts.text = f"{counts.passed} passed, {counts.failed} failed, {counts.unjudged} not judged"
        if last is not None and self.shown != (state.boot, last.short.sequence):
            self.shown = state.boot, last.short.sequence
            self.fill_fruit(last)

    def fill_fruit(self, last: Fruit) -> None:
        """Write the last fruit, and what is counted over the latest."""
        fruit = gateway.recent.fruit
        self.outcome.text = last.short.outcome
        self.reason.text = ", ".join(last.short.reasons)
        self.area.text = f"{locale.number(last.short.area_mm2, 1)} mm²"
        self.picture.source = f"/fruit/{last.short.sequence}/picture.jpg"
        self.curve.content = str(charts.curve(last, locale))
        self.trend.content = str(charts.trend(fruit, locale))
        rejected = sum(each.outcome != "PASS" for each in fruit) / len(fruit) if fruit else None
        self.rate.text = f"{locale.percent(rejected)} of the last {len(fruit)} rejected"
        for (title, line), each in zip(self.tiles, fruit, strict=False):
            title.text = f"{each.sequence} {each.outcome} {locale.number(each.area_mm2)} mm²"
            line.content = str(spark(each.areas_mm2, 60, 24))


@ui.page("/")
def run() -> None:
    """Show the page."""
    Page()


app.on_startup(gateway.__aenter__)
app.on_shutdown(gateway.__aexit__)
ui.run(host=HOST, port=int(sys.argv[2]), show=False, reload=False, title="Run")
