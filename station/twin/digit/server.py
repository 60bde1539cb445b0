"""The twin's DIGIT on the wire: 30 frames a second over TCP, drawn only while a client watches."""

import asyncio
import contextlib
import logging
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

import numpy as np

from station.twin.clock import Clock
from station.twin.contact import Footprint
from station.twin.digit.codec import Image
from station.twin.digit.sensor import Colour, Condition, DigitSensor
from station.twin.digit.spoil import FRAME_FAULTS, spoiled
from station.twin.digit.wire import packed, read_request
from station.twin.faults import CommonFault, FaultBoard
from station.twin.gel import SENSOR_SHAPE
from station.twin.ports import stop_listening
from station.twin.world import Touch, World

FRAMES_PER_S = 30.0
GEL_FAULTS = ("gel_torn", "gel_worn", "led_dead", "lens_fogged", "dirt")
# Three seconds of frames, and so the longest delay that the fault `delayed` can make.
_REMEMBERED = 90
_BRIGHTEST = 15
_DEAD: dict[int, Colour] = {1: "red", 2: "green", 3: "blue"}
_SLOWEST = 10.0
_LONGEST_PERIOD_S = 60.0
_SLICE_S = 0.05
"""How soon a fault that was cleared lets go of the drawing."""
_MOST_SPECKS = 200
_REQUEST_DEADLINE_S = 5.0
_LOG = logging.getLogger(__name__)


def digit_faults() -> FaultBoard:
    """The switches of the twin's DIGIT.

    | fault | meaning | amount |
    |---|---|---|
    | off | every connection is cut at once | none |
    | intermittent | every connection is cut each time a period has passed | the period, s |
    | stuck | the same pixels under new sequence numbers | none |
    | garbage | random bytes | none |
    | wrong | frames of the 320x240 mode | none |
    | slow | the frame rate divided by the amount; a frame a minute comes at least | times; ten where it is 1 or less |
    | delayed | frames come late | s, at most 3 |
    | gel_torn | a tear across the gel | none |
    | gel_worn | the coating reflects less | 0 to 1 |
    | led_dead | one LED is off | 1 red, 2 green, 3 blue |
    | lens_fogged | the image blurs towards a grey veil | 0 to 1 |
    | dirt | particles stick on the gel | specks, at most 200 |
    | frame_torn, frame_shifted, frame_black, frame_saturated | whole frames are spoiled | none |
    """
    return FaultBoard("camera", (*GEL_FAULTS, *FRAME_FAULTS))


@dataclass(frozen=True, slots=True)
class _Captured:
    """A frame with its truth."""

    sequence: int
    captured_s: float
    image: Image
    touch: Touch | None
    footprint: Footprint | None


class DigitCameraServer:
    """Serves one sensor's frames to any number of clients; a slow client misses frames and delays no other.

    Args:
        world: what the gel feels.
        faults: the switches, from `digit_faults`.
        port: 0 for any that is free.
    """

    def __init__(
        self,
        world: World,
        sensor: DigitSensor,
        clock: Clock,
        faults: FaultBoard,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
    ) -> None:
        self._world, self._sensor, self._clock, self.faults = world, sensor, clock, faults
        self._host, self._asked_port = host, port
        self._server: asyncio.Server | None = None
        self._drawing: asyncio.Task[None] | None = None
        self._clients: set[asyncio.Task[None]] = set()
        self._watching = asyncio.Event()
        self._watchers = 0
        self._fresh = asyncio.Condition()
        self._frames: OrderedDict[int, _Captured] = OrderedDict()
        self._sequence = 0
        self._leds = (_BRIGHTEST, _BRIGHTEST, _BRIGHTEST)
        self._garbage = np.random.default_rng(0)

    @property
    def port(self) -> int:
        """The port that it listens on.

        Raises:
            RuntimeError: it has not been started.
        """
        if self._server is None:
            raise RuntimeError("the camera's server has not been started")
        return self._server.sockets[0].getsockname()[1]

    async def start(self) -> None:
        """Listen; a second call does nothing.

        Raises:
            OSError: the address is in use.
        """
        if self._server is None:
            self._server = await asyncio.start_server(self._accept, self._host, self._asked_port)
            self._drawing = asyncio.create_task(self._draw_for_ever(), name="digit drawing")

    async def stop(self) -> None:
        """Close the port and every connection; a second call does nothing."""
        if self._server is None or self._drawing is None:
            return
        server, self._server = self._server, None
        await stop_listening(server)
        tasks = [self._drawing, *self._clients]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await server.wait_closed()

    async def _draw_for_ever(self) -> None:
        loop = asyncio.get_running_loop()
        due_s = loop.time()
        failing = False
        while True:
            await self._watching.wait()
            try:
                await self._draw()
                failing = False
            except Exception:  # noqa: BLE001 (whatever it is, the next frame is tried)
                # Once for a row of failures: 30 entries a second would fill the log.
                if not failing:
                    _LOG.exception("the twin's camera could not draw frame %d; it goes on", self._sequence)
                failing = True
            while (wait_s := due_s + self._period_s() - loop.time()) > 0:
                await asyncio.sleep(min(wait_s, _SLICE_S))
            # After a pause, as without a client, frames are not made up for in a burst.
            due_s = max(due_s + self._period_s(), loop.time() - 1.0 / FRAMES_PER_S)

    async def _draw(self) -> None:
        captured = await self._capture()
        async with self._fresh:
            self._frames[captured.sequence] = captured
            while len(self._frames) > _REMEMBERED:
                self._frames.popitem(last=False)
            self._fresh.notify_all()

    def _period_s(self) -> float:
        if not self.faults.active(CommonFault.SLOW):
            return 1.0 / FRAMES_PER_S
        amount = self.faults.amount(CommonFault.SLOW)
        return min(_LONGEST_PERIOD_S, (amount if amount > 1.0 else _SLOWEST) / FRAMES_PER_S)

    async def _capture(self) -> _Captured:
        self._sequence += 1
        # Read before the drawing, which takes milliseconds: the frame and its truth are of this moment.
        now_s, touch, last = self._clock.now_s(), self._world.touch(), self._newest()
        if last and self.faults.active(CommonFault.STUCK):
            return _Captured(self._sequence, now_s, last.image, last.touch, last.footprint)
        if touch is None:
            footprint = None
        elif last and last.touch == touch:
            # The same array again: by that the sensor recognises that its clean image is still valid.
            footprint = last.footprint
        else:
            # In a thread: the loop also runs the arm's cycle of 2 ms, which the drawing would delay.
            footprint = await asyncio.to_thread(touch.contact.pressed, touch.squeezed)
        dent = footprint.dent if footprint else None
        image = await asyncio.to_thread(self._sensor.frame, dent, now_s, self._condition())
        return _Captured(self._sequence, now_s, spoiled(image, self.faults, self._sequence), touch, footprint)

    def _condition(self) -> Condition:
        faults = self.faults
        red, green, blue = self._leds
        return Condition(
            dead_led=_DEAD.get(round(_within(0.0, faults.amount("led_dead"), 9.0)), "red")
            if faults.active("led_dead")
            else None,
            torn=faults.active("gel_torn"),
            wear=_within(0.0, faults.amount("gel_worn"), 1.0),
            fog=_within(0.0, faults.amount("lens_fogged"), 1.0),
            dirt=round(_within(0.0, faults.amount("dirt"), _MOST_SPECKS)),
            light=(blue / _BRIGHTEST, green / _BRIGHTEST, red / _BRIGHTEST),
        )

    @property
    def drawn(self) -> int:
        """The number of the newest frame."""
        newest = self._newest()
        return newest.sequence if newest else 0

    def _newest(self) -> _Captured | None:
        return next(reversed(self._frames.values()), None)

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        if task is None:
            return
        self._clients.add(task)
        try:
            async with asyncio.TaskGroup() as group:
                # Its error cancels the serving beside it, so that a fault cuts the connection at once.
                guard = group.create_task(self._cut())
                await self._serve(reader, writer)
                guard.cancel()
        except* (ConnectionError, TimeoutError, asyncio.IncompleteReadError):
            pass
        except* ValueError as errors:
            writer.write(packed("error", message=str(errors.exceptions[0])))
        except* asyncio.CancelledError:
            pass  # only `stop` cancels; asyncio would report the cancelled task of a connection as an error
        finally:
            self._clients.discard(task)
            writer.close()
            with contextlib.suppress(ConnectionError):
                await writer.wait_closed()

    async def _cut(self) -> None:
        """End the connection when a fault says so."""
        loop = asyncio.get_running_loop()
        began_s = loop.time()
        while True:
            intermittent_s = self.faults.amount(CommonFault.INTERMITTENT)
            if self.faults.active(CommonFault.OFF):
                raise ConnectionAbortedError
            if self.faults.active(CommonFault.INTERMITTENT) and loop.time() - began_s > intermittent_s:
                raise ConnectionAbortedError
            await asyncio.sleep(0.02)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        # A client that sends nothing would hold its connection for ever.
        async with asyncio.timeout(_REQUEST_DEADLINE_S):
            request = await read_request(reader)
        match request.get("kind"):
            case "stream":
                await self._stream(writer)
            case "leds":
                levels = self._set_leds(request)
                writer.write(packed("leds", red=levels["red"], green=levels["green"], blue=levels["blue"]))
            case "truth":
                writer.write(self._truth(request.get("sequence")))
            case other:
                raise ValueError(f"{other!r} is no request; expected stream, leds or truth")
        await writer.drain()

    async def _stream(self, writer: asyncio.StreamWriter) -> None:
        self._watchers += 1
        self._watching.set()
        sent = self._sequence
        try:
            while True:
                async with self._fresh:
                    while (captured := self._due(sent)) is None:
                        await self._fresh.wait()
                sent = captured.sequence
                writer.write(self._message(captured))
                await writer.drain()
        finally:
            self._watchers -= 1
            if not self._watchers:
                self._watching.clear()

    def _due(self, sent: int) -> _Captured | None:
        """The newest frame beyond the last one sent that is as old as `delayed` requires."""
        latest_s = self._clock.now_s() - self.faults.amount(CommonFault.DELAYED)
        due = (one for one in reversed(self._frames.values()) if one.captured_s <= latest_s)
        newest = next(due, None)
        return newest if newest and newest.sequence > sent else None

    def _message(self, captured: _Captured) -> bytes:
        if self.faults.active(CommonFault.GARBAGE):
            return self._garbage.bytes(4096)
        image = captured.image
        if self.faults.active(CommonFault.WRONG):
            # `cast` below needs contiguous memory, which a strided view does not have.
            image = np.ascontiguousarray(image[::2, ::2])
        return packed(
            "frame",
            image.data.cast("B"),
            sequence=captured.sequence,
            age_s=self._clock.now_s() - captured.captured_s,
            height=image.shape[0],
            width=image.shape[1],
        )

    def _set_leds(self, request: dict[str, Any]) -> dict[str, int]:
        levels: dict[str, int] = {}
        for colour in ("red", "green", "blue"):
            level = request.get(colour)
            if not isinstance(level, int) or not 0 <= level <= _BRIGHTEST:
                raise ValueError(f"{colour} is {level!r}; expected a whole number from 0 to {_BRIGHTEST}")
            levels[colour] = level
        self._leds = (levels["red"], levels["green"], levels["blue"])
        return levels

    def _truth(self, sequence: object) -> bytes:
        captured = self._frames.get(sequence) if isinstance(sequence, int) else self._newest()
        if captured is None:
            raise ValueError(f"frame {sequence} is not among the last {_REMEMBERED}")
        footprint, touch = captured.footprint, captured.touch
        mask = footprint.true_mask if footprint else np.zeros(SENSOR_SHAPE, np.uint8)
        return packed(
            "truth",
            mask.tobytes(),
            sequence=captured.sequence,
            closing_mm=touch.squeezed.closing_mm if touch else 0.0,
            force_n=touch.squeezed.force_n if touch else 0.0,
            height=mask.shape[0],
            width=mask.shape[1],
        )


def _within(low: float, amount: float, high: float) -> float:
    """An amount inside its limits; the low one where it is no number."""
    # The order of the arguments matters: max returns its first where the other is NaN.
    return min(high, max(low, amount))
