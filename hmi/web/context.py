"""Parts that all pages use."""

from dataclasses import dataclass
from pathlib import Path

from hmi.api.tokens import ApiTokens, RefusedTokens
from hmi.jobs.queue import Jobs
from hmi.past.past import Past
from hmi.web.assets import Assets
from hmi.web.gateway import Gateway
from hmi.web.live import Live
from hmi.web.login_limiter import LoginRateLimiter
from hmi.web.render import Renderer
from hmi.web.sessions import Sessions
from hmi.web.user_store import UserStore
from station.settings.hmi import HmiSettings


@dataclass(frozen=True, slots=True)
class Hmi:
    """The process's parts; `request.app.state.hmi`."""

    settings: HmiSettings
    gateway: Gateway
    past: Past
    jobs: Jobs
    sessions: Sessions
    people: UserStore
    pins: LoginRateLimiter
    tokens: ApiTokens
    refused_tokens: RefusedTokens
    assets: Assets
    renderer: Renderer
    live: Live
    boot: str
    ball_recipe: str
    """Name of the calibration ball's recipe, which is no fruit to choose."""
    configuration_file: Path | None
    """The `station.yaml` in use; None where the defaults are."""
