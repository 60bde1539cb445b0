"""Open pages while the station or the pages' own process hangs or is killed, or their stream's connection dies."""

import contextlib
import re
import socket
import threading
import time

import pytest

from tests.chromium import follow


class Cable:
    """The way to the pages' port. A connection whose stream is cut stays open and carries nothing; new ones work."""

    def __init__(self, port, far_port):
        self._far_port, self._streams, self._silent = far_port, set(), set()
        self._listener, self._sockets = socket.create_server(("127.0.0.1", port)), []
        self._threads = []
        self._begin(self._accept)

    def _begin(self, work, *arguments):
        self._threads.append(threading.Thread(target=work, args=arguments))
        self._threads[-1].start()

    def _accept(self):
        with contextlib.suppress(OSError):  # closed
            while True:
                near, _ = self._listener.accept()
                far = socket.create_connection(("127.0.0.1", self._far_port))
                self._sockets += near, far
                self._begin(self._carry, near, far)
                self._begin(self._carry, far, near)

    def _carry(self, source, target):
        with contextlib.suppress(OSError):
            while data := source.recv(2**16):
                if data.startswith(b"GET /live?"):
                    self._streams |= {source, target}
                if source not in self._silent:
                    target.sendall(data)
            if source not in self._silent:
                target.shutdown(socket.SHUT_WR)

    def cut_streams(self):
        cut = self._streams - self._silent
        self._silent |= cut
        return len(cut)

    def close(self):
        self._listener.shutdown(socket.SHUT_RDWR)
        self._threads[0].join()
        for each in self._sockets:
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        for each in (self._listener, *self._sockets):
            each.close()


@pytest.mark.timeout(240)
def test_the_station_hangs_and_is_killed_under_an_open_page(ready, panel):
    viewer = panel()
    viewer.open("/")
    viewer.until(".station-state", "Ready")
    page_made = viewer.page.evaluate("document.body.dataset.made = 'once'")
    hung = ready.process("service")
    hung.suspend()
    viewer.page.locator("body.stale").wait_for()
    hung.kill()
    assert re.search(r"No data for \d+ s", viewer.text(".stale-line"))
    assert viewer.page.evaluate("document.querySelector('[data-live]').inert")
    viewer.page.locator("body:not(.stale)").wait_for()
    assert viewer.text(".stale-line") == ""
    assert viewer.page.evaluate("document.body.dataset.made") == page_made, "it recovers without being loaded anew"
    ready.choose("blueberry")
    viewer.until(".station-state", "Blueberry")


@pytest.mark.timeout(240)
def test_a_persons_stop_and_the_last_fruit_outlive_a_killed_station(ready, operator, eventually):
    ready.twin(do="fruit", kind="blueberry", seed=1, bruised=True)
    soft = ready.end(ready.begin())
    assert soft.outcome != "PASS", "only of others every image is stored"
    operator.open("/")
    # So slow a gripper that the fruit is still under way when the station is killed.
    ready.twin(do="set", device="gripper", fault="delayed", amount=0.5)
    lost = ready.begin()
    operator.hold("[data-hold]:has-text('Stop')")
    before = ready.until(lambda state: state.stopping)
    ready.process("service").kill()
    ready.twin(do="clear", device="gripper")

    def stopped_again(state):
        return state.boot != before.boot and state.state == "stopped"

    after = ready.until(stopped_again)
    assert after.stopping
    counted = before.lot_counts.model_copy(update={"unjudged": before.lot_counts.unjudged + 1})
    assert after.lot_counts == counted, "the fruit under way is counted with what became of it"
    operator.until(".run-activity", "Stopped")
    time.sleep(1.0)
    assert stopped_again(ready.state()), "it does not begin by itself"
    follow(operator.page.locator(f".tile[href='/fruit/{soft.sequence}']"))
    operator.until("h1", f"Fruit {soft.sequence}")
    eventually(lambda: operator.page.locator(".fruit-picture").evaluate("picture => picture.naturalWidth") == 480)
    assert operator.page.locator(".fruit-curve circle").count() > 1
    operator.open("/")
    follow(operator.page.locator(f".tile[href='/fruit/{lost}']"))
    operator.page.wait_for_url(f"**/history/{lost}")
    operator.until("main", "No result")
    operator.open("/")
    follow(operator.page.get_by_role("button", name="Start"))
    ready.until(lambda state: state.ready)
    operator.until(".run-activity", "Ready")


@pytest.mark.timeout(240)
def test_the_pages_are_killed_under_a_running_line(ready, panel):
    viewer = panel()
    viewer.open("/")
    viewer.until(".station-state", "Ready")
    sequence = ready.begin()
    boot = viewer.page.evaluate("document.body.dataset.boot")
    killed = ready.process("hmi")
    killed.kill()
    outcome = ready.end(sequence)
    assert outcome.outcome in {"PASS", "FAIL"}, outcome
    viewer.page.locator(f"body:not([data-boot='{boot}'])").wait_for()
    viewer.page.locator("body:not(.stale)").wait_for()
    viewer.page.locator(f".run-fruit a.fruit-more[href$='/{sequence}']").wait_for()
    assert ready.process("hmi").pid != killed.pid


@pytest.mark.timeout(240)
def test_a_stream_whose_connection_went_silent_is_opened_again(ready, panel, unused_port):
    with contextlib.closing(Cable(unused_port, ready.configuration.hmi.port)) as cable:
        viewer = panel(f"http://127.0.0.1:{unused_port}")
        viewer.open("/")
        viewer.until(".station-state", "Ready")
        page_made = viewer.page.evaluate("document.body.dataset.made = 'once'")
        assert cable.cut_streams()
        viewer.page.locator("body.stale").wait_for()
        viewer.page.locator("body:not(.stale)").wait_for(timeout=10_000)
        assert viewer.page.evaluate("document.body.dataset.made") == page_made, "it recovers without being loaded anew"


@pytest.mark.timeout(240)
@pytest.mark.parametrize("hangs", [False, True])
def test_an_order_given_while_the_pages_are_away_keeps_the_page_and_works_once_they_are_back(
    ready, people, panel, unused_port, hangs
):
    person = panel(f"http://127.0.0.1:{unused_port}")
    button = person.page.get_by_role("button", name="Change to Raspberry")
    with contextlib.closing(Cable(unused_port, ready.configuration.hmi.port)):
        person.log_in("Ana", "7391")
        person.open("/change/3")
        person.until(".station-state", "Ready")
    with contextlib.closing(socket.socket()) as silent:
        silent.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        silent.bind(("127.0.0.1", unused_port))
        if hangs:
            silent.listen()
        person.page.locator("body.stale").wait_for()
        button.click()
        person.page.wait_for_timeout(4000)  # twice as long as the page waits for an answer
        assert person.page.url.endswith("/change/3")
        assert re.search(r"No data for \d+ s", person.text(".stale-line"))
        assert person.page.locator("form[data-sent]").count() == 0
    with contextlib.closing(Cable(unused_port, ready.configuration.hmi.port)):
        person.page.locator("body:not(.stale)").wait_for()
        assert ready.until(lambda _: True).recipe.number != 3, "what was not sent is not carried out later"
        follow(button)
        person.until("main", "The station is ready")
        assert ready.until(lambda _: True).recipe.number == 3
