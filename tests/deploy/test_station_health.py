"""When the installer takes a started station to be well."""

import http.server
import json
import threading
from contextlib import contextmanager

import pytest


@contextmanager
def answering(answers):
    """The port of a server that gives these answers: `{path: (status, body)}`."""

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            status, body = answers[self.path]
            self.send_response(status)
            self.end_headers()
            self.wfile.write(json.dumps(body).encode())

        def log_message(self, format, *args):  # noqa: A002 (the base's name)
            pass

    with http.server.HTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05})
        thread.start()
        try:
            yield server.server_port
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture
def wait(installer, tmp_path, monkeypatch):
    """Wait for a station of version 0.2.0 with these dependencies, which accepts no trigger."""
    health, layout = installer("health"), installer("layout").Layout(tmp_path)

    def run(dependencies, *, was_ready, **options):
        answers = {
            "/livez": (200, {"live": True}),
            "/version": (200, {"fruit-station": "0.2.0"}),
            "/readyz": (503, {"ready": False, "why": "no recipe", "dependencies": dependencies}),
        }
        with answering(answers) as port:
            shown = json.dumps({"metrics": {"host": "127.0.0.1", "port": port}})
            monkeypatch.setattr(health, "station", lambda *_words: shown)
            health.wait_until_healthy(layout, tmp_path, "0.2.0", was_ready=was_ready, limit_s=1.0, **options)

    return run


ARM = {"name": "arm", "state": "fault", "detail": "no answer", "remedy": "switch it on"}
RECORDS = {"name": "records", "state": "ok", "detail": "", "remedy": ""}
NOT_OPEN = {"name": "records", "state": "fault", "detail": "no room for a copy", "remedy": "free space"}


def test_a_station_that_was_not_ready_need_not_be_but_has_to_use_its_records(wait, installer):
    wait([ARM, RECORDS], was_ready=False)
    failed = installer("messages").Failed
    with pytest.raises(failed, match="it cannot use its records: no room for a copy; free space"):
        wait([ARM, NOT_OPEN], was_ready=False)
    wait([ARM, NOT_OPEN], was_ready=False, needs_records=False)


def test_a_station_that_was_ready_has_to_be_again(wait, installer):
    with pytest.raises(installer("messages").Failed, match="it was ready before and is not now: no recipe"):
        wait([ARM, RECORDS], was_ready=True)
