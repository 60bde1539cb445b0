"""Parts that all pages use."""

from dataclasses import dataclass

from hmi.assets import Assets
from hmi.gateway import Gateway
from hmi.live import Live
from hmi.login_limiter import LoginRateLimiter
from hmi.render import Renderer
from hmi.sessions import Sessions
from hmi.user_store import UserStore
from station.settings.hmi import HmiSettings


@dataclass(frozen=True, slots=True)
class Hmi:
    """The process's parts; `request.app.state.hmi`."""

    settings: HmiSettings
    gateway: Gateway
    sessions: Sessions
    people: UserStore
    pins: LoginRateLimiter
    assets: Assets
    renderer: Renderer
    live: Live
    boot: str
