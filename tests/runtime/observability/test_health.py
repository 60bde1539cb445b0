"""Health over real sockets."""

import asyncio
import json
import os
import signal
import socket
import threading
import urllib.error
import urllib.request

import pytest

from station.channel.panel_maintenance import PartHealth
from station.messages.message import verbatim
from station.runtime.observability.health import HealthServer, Liveness, Readiness
from station.serving.server import AddressError

NOT_READY = Readiness(
    ready=False,
    why=verbatim("the camera does not answer; plug it in"),
    dependencies=(
        PartHealth(name="arm", state="ok", age_s=0.1),
        PartHealth(name="camera", state="fault", age_s=4.2, detail=verbatim("no frame"), remedy=verbatim("plug it in")),
        PartHealth(
            name="plc", state="unknown", age_s=None, detail=verbatim("never heard"), remedy=verbatim("start it")
        ),
    ),
)


@pytest.fixture
def liveness(clock):
    return Liveness(clock)


@pytest.fixture
def readiness():
    return [NOT_READY]


@pytest.fixture
def server(metrics, liveness, readiness):
    def make(host="127.0.0.1", port=0):
        return HealthServer(host, port, metrics, liveness, lambda: readiness[0], {"version": "0.1.0", "boot": "b"})

    return make


def get(port, path, method="GET"):
    request = urllib.request.Request(f"http://127.0.0.1:{port}{path}", method=method)
    try:
        with urllib.request.urlopen(request, timeout=30) as answer:
            return answer.status, answer.headers["content-type"], answer.read().decode()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.headers["content-type"], error.read().decode()


@pytest.fixture
def served(server, scenario):
    """Send requests to a running server in a thread of the test's own."""

    def get_all(*questions):
        async def steps():
            health = server()
            port = await health.start()
            try:
                return [await asyncio.to_thread(get, port, *question) for question in questions]
            finally:
                await health.close()
                await health.close()

        return scenario(steps)

    return get_all


def test_metrics_are_served(served, metrics):
    metrics.frame("torn", 3)
    ((status, content_type, body),) = served(("/metrics",))
    assert status == 200
    assert content_type.startswith("text/plain; version=")
    assert 'station_frames_total{state="torn"} 3.0' in body


def test_not_ready_is_503_with_each_dependencys_remedy(served, readiness):
    ((status, content_type, body),) = served(("/readyz",))
    assert (status, content_type) == (503, "application/json")
    data = json.loads(body)
    assert data["why"] == str(NOT_READY.why)
    assert data["dependencies"][1] == {
        "name": "camera",
        "state": "fault",
        "age_s": 4.2,
        "detail": "no frame",
        "detail_message": {"id": "text.verbatim", "parameters": {"text": "no frame"}},
        "remedy": "plug it in",
        "remedy_message": {"id": "text.verbatim", "parameters": {"text": "plug it in"}},
    }
    assert data["dependencies"][2]["age_s"] is None
    readiness[0] = Readiness(ready=True, why=None, dependencies=())
    assert served(("/readyz",))[0][0] == 200


def test_alive_only_while_everything_watched_makes_progress(served, liveness, clock):
    assert served(("/livez",))[0][0] == 200
    liveness.watch("cycle", within_s=2.0)
    liveness.watch("records", within_s=60.0)
    clock.now_s += 1.9
    assert json.loads(served(("/livez",))[0][2]) == {
        "live": True,
        "stuck_s": {},
        "progress_age_s": {"cycle": 1.9, "records": 1.9},
    }
    clock.now_s += 1.0
    liveness.progress("records")
    status, _, body = served(("/livez",))[0]
    assert status == 503
    assert json.loads(body)["stuck_s"] == {"cycle": 2.9}
    liveness.progress("cycle")
    assert liveness.stuck() == {}
    liveness.progress("another")
    assert liveness.stuck() == {}


def test_version_and_what_is_not_there(served):
    version, missing, write = served(("/version",), ("/nothing",), ("/metrics", "POST"))
    assert json.loads(version[2]) == {"version": "0.1.0", "boot": "b"}
    assert (missing[0], write[0]) == (404, 405)


def test_a_port_in_use_is_one_clear_sentence(server, scenario):
    async def steps():
        first = server()
        port = await first.start()
        with pytest.raises(AddressError) as caught:
            await server(port=port).start()
        assert str(caught.value) == (
            f"metrics and health cannot be served on 127.0.0.1:{port}: another program listens there; "
            "stop it, or set another metrics.port"
        )
        await first.close()
        again = server(port=port)
        assert await again.start() == port
        await again.close()

    scenario(steps)


@pytest.mark.parametrize(
    ("host", "message"), [("192.0.2.1", "no address of this machine"), ("no such host", "metrics.host")]
)
def test_an_address_of_another_machine_is_told(server, scenario, host, message):
    async def steps():
        with pytest.raises(AddressError, match=message):
            await server(host=host).start()

    scenario(steps)


def test_closing_does_not_wait_for_a_client_that_keeps_its_connection(server, scenario):
    async def steps():
        health = server()
        port = await health.start()
        with socket.create_connection(("127.0.0.1", port), timeout=30) as silent:
            await health.close()
            silent.settimeout(30)
            assert await asyncio.to_thread(silent.recv, 1) == b""

    scenario(steps)


def test_signals_stay_the_stations(server, scenario):
    async def steps():
        heard = asyncio.Event()
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, heard.set)
        health = server()
        port = await health.start()
        os.kill(os.getpid(), signal.SIGTERM)
        await heard.wait()
        assert (await asyncio.to_thread(get, port, "/version"))[0] == 200
        await health.close()
        asyncio.get_running_loop().remove_signal_handler(signal.SIGTERM)

    scenario(steps)


def test_many_ask_at_once_and_no_thread_serves_them(server, scenario):
    async def steps():
        health = server()
        before = threading.active_count()
        port = await health.start()

        async def get_version():
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(b"GET /version HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
            answer = await reader.read()
            writer.close()
            await writer.wait_closed()
            return answer

        answers = await asyncio.gather(*(get_version() for _ in range(20)))
        assert all(answer.startswith(b"HTTP/1.1 200") for answer in answers)
        assert threading.active_count() == before
        await health.close()

    scenario(steps)


@pytest.mark.parametrize("sent", [b"", b"GET /readyz HTTP/1.1\r\nHost: x\r\n"])
def test_silent_and_half_asking_clients_close_the_door_to_nobody(server, scenario, sent):
    async def steps():
        health = server()
        port = await health.start()
        crowd = []
        for _ in range(250):
            crowd.append(await asyncio.open_connection("127.0.0.1", port, local_addr=("127.0.0.9", 0)))
            crowd[-1][1].write(sent)
        assert (await asyncio.to_thread(get, port, "/readyz"))[0] == 503
        assert (await asyncio.to_thread(get, port, "/metrics"))[0] == 200
        assert health.flooded_by == "127.0.0.9"
        for _, writer in crowd:
            writer.close()
        await health.close()

    scenario(steps)
