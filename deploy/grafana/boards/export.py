"""Content of the dashboards' files."""

import json
from pathlib import Path

from grafana_foundation_sdk.cog.encoder import JSONEncoder

from deploy.grafana.boards import fleet, line, quality, station

FOLDER = Path(__file__).resolve().parents[1] / "dashboards"
BOARDS = {"line": line, "station": station, "quality": quality, "fleet": fleet}


def exported(folder: Path = FOLDER) -> dict[Path, str]:
    """Return each file's text."""
    return {
        folder / f"{name}.json": json.dumps(
            module.dashboard().build(), cls=JSONEncoder, indent=2, sort_keys=True, ensure_ascii=False
        )
        + "\n"
        for name, module in BOARDS.items()
    }
