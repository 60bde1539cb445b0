"""Tokens of the HTTP API: who made and withdrew them is in the audit trail, and they may expire."""

import time

from click.testing import CliRunner

from hmi.api.tokens import ApiTokens, RefusedTokens
from hmi.web.roles import Role
from station.cli import cli


def test_a_tokens_life_is_in_the_audit_trail(tmp_path):
    station = CliRunner(env={"STATION_HOME": str(tmp_path)})

    def run(*arguments):
        return station.invoke(cli, arguments)

    token = run("api-token", "add", "MES", "--role", "operator", "--days", "30", "--by", "Ada").output.strip()
    assert run("api-token", "add", "MES", "--by", "Eve").exit_code != 0, "the name is in use: no row, no token"
    assert ApiTokens(tmp_path / "hmi").holder(token) == ("MES", Role.OPERATOR)
    assert ", expires " in run("api-token", "list").output
    assert run("api-token", "remove", "MES", "--by", "Ida").exit_code == 0
    assert ApiTokens(tmp_path / "hmi").holder(token) is None
    output = run("audit", "show", "--action", "token.").output
    assert "token.added  token MES  by Ada (command line)" in output
    assert "new: days 30, role operator" in output
    assert "token.removed  token MES  by Ida (command line)" in output
    assert "Eve" not in output
    assert run("audit", "verify").exit_code == 0


def test_an_expired_token_is_refused(tmp_path, monkeypatch):
    tokens = ApiTokens(tmp_path)
    short, forever = tokens.add("short", Role.VIEWER, 1), tokens.add("forever", Role.VIEWER)
    assert tokens.holder(short) == ("short", Role.VIEWER)
    tomorrow_ns = time.time_ns() + 86_400_000_000_000
    monkeypatch.setattr(time, "time_ns", lambda: tomorrow_ns)
    assert tokens.holder(short) is None
    assert tokens.holder(forever) == ("forever", Role.VIEWER)


def test_refused_tokens_fill_no_audit_trail():
    now = 0.0
    refused = RefusedTokens(lambda: now)
    rows = [number for number in (refused.count() for _ in range(30_000)) if number is not None]
    assert rows == [1, 10, 100, 1000, 10_000]
    now = 3601.0
    assert refused.count() == 1
