"""Triggers over the wire through proxies that delay, cut, split, repeat and corrupt on every link.

Whole stations with the simulated cell and a PLC on the wire, some side by side, play stories of fruits drawn from
seeds; every other fruit and more has its disturbance. Every fruit is stored at once, so that an interrupted run loses
nothing, and the same command goes on until there are so many triggers. Writes docs/wire.md.
"""

import argparse
import asyncio
import contextlib
import itertools
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import AsyncGenerator, Iterator
from pathlib import Path

import sections
from reliability import link_results
from reliability.link_page import sections_of
from reliability.link_play import play
from reliability.link_results import ALARMS_RETURN, Fruit, Story
from reliability.link_story import FRUITS, LAST_FRUITS, draw
from reliability.rig import running
from reliability.routes import Routes
from reliability.scenario import Expected, Scenario

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "wire.md"
CHART = DOCUMENT.parent / "images" / "wire.svg"
STORIES_FILE = Path(__file__).resolve().parent / "reliability" / "link_stories.json"
TRIGGERS = 2000
LIMIT_MM2 = 50.0
"""Between a sound and a bruised fruit of the twin, as in the kills."""
_SCENARIO = Scenario(name="links", fault=None, expected=Expected(outcomes=("PASS",)))
_END_S, _SIGTERM_EVERY_S = 60.0, 10.0
"""A story that is interrupted ends its station within this time; SIGTERM is repeated, as a cancellation may be lost."""


async def play_here(seed: int, fruits: int) -> bool:
    """Play one story in a station of its own, and print each fruit; whether every law held."""
    place, routes, held = Path(tempfile.mkdtemp()), Routes(), True
    _end_by_sigterm()
    async with (
        running(place, _SCENARIO, "nest", LIMIT_MM2, routes) as rig,
        contextlib.aclosing(play(rig, routes, seed, draw(seed, fruits))) as playing,
    ):
        async for each in playing:
            held = held and not each.broken
            print(f"{type(each).__name__} {each.model_dump_json(exclude_defaults=True)}", flush=True)
    if held:
        shutil.rmtree(place)
    else:
        print(f"what it left: {place}", file=sys.stderr, flush=True)
    return held


async def play_apart(seed: int, fruits: int) -> AsyncGenerator[Story, None]:
    """Play one story in a process of its own, as its proxies take much of a processor; yields it as it grows."""
    command = (sys.executable, __file__, "--story", str(seed), "--fruits", str(fruits))
    process = await asyncio.create_subprocess_exec(*command, stdout=asyncio.subprocess.PIPE, start_new_session=True)
    story = Story(seed=seed)
    try:
        while process.stdout is not None and (line := await process.stdout.readline()):
            name, _, text = line.decode().partition(" ")
            if name == Fruit.__name__:
                fruit = Fruit.model_validate_json(text)
                story = story.model_copy(update={"fruits": (*story.fruits, fruit), "triggers": story.triggers + 1})
                yield story
            elif name == Story.__name__:
                story = Story.model_validate_json(text).model_copy(update={"fruits": story.fruits})
                yield story
        if await process.wait() and not story.all_broken:
            why = f"the story's process ended with {process.returncode}"
            yield story.model_copy(update={"broken": ((ALARMS_RETURN, why),)})
    finally:
        ends_s = time.monotonic() + _END_S
        while process.returncode is None and time.monotonic() < ends_s:
            with contextlib.suppress(ProcessLookupError):
                process.terminate()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_SIGTERM_EVERY_S):
                    await process.wait()


async def play_all(count: int, seed: int, stations: int, fruits: int) -> None:
    """Play stories until so many triggers are stored; those that are stored already count."""
    _end_by_sigterm()
    stories = {story.seed: story for story in link_results.read(STORIES_FILE).stories}
    seeds = (each for each in itertools.count(seed) if each not in stories)

    async def one_after_the_other(seeds: Iterator[int]) -> None:
        while sum(story.triggers for story in stories.values()) < count:
            async with contextlib.aclosing(play_apart(next(seeds), fruits)) as growing:
                async for story in growing:
                    stories[story.seed] = story
                    link_results.write(STORIES_FILE, list(stories.values()))
                    _show(story, sum(each.triggers for each in stories.values()), count)

    await asyncio.gather(*(one_after_the_other(seeds) for _ in range(stations)))


def _end_by_sigterm() -> None:
    """Have SIGTERM end the task as Ctrl-C does, so that a station and its proxies end with it."""
    task = asyncio.current_task()
    if task is not None:
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)


def _show(story: Story, triggers: int, count: int) -> None:
    fruit = story.fruits[-1] if story.fruits else None
    shown = "" if fruit is None else f"{fruit.outcome} {fruit.plan} {', '.join(fruit.signs)}"
    print(f"{triggers:4} of {count}: story {story.seed}: {shown}", file=sys.stderr)
    for number, law, how in story.all_broken:
        if story.ended or (fruit is not None and number == fruit.number):
            print(f"  fruit {number}: {law}: {how}", file=sys.stderr)


def main() -> int:
    """Play, keep, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=TRIGGERS, help="triggers in all, with those that are kept")
    parser.add_argument("--seed", type=int, default=1, help="of the first story")
    parser.add_argument("--stations", type=int, default=2, help="side by side")
    parser.add_argument("--fruits", type=int, default=FRUITS, help=f"of a story, before {LAST_FRUITS} sound ones")
    parser.add_argument("--story", type=int, metavar="SEED", help="play this one again, and keep nothing")
    options = parser.parse_args()
    if options.story is not None:
        with contextlib.suppress(asyncio.CancelledError):
            return 0 if asyncio.run(play_here(options.story, options.fruits)) else 1
        return 1
    with contextlib.suppress(KeyboardInterrupt, asyncio.CancelledError):
        asyncio.run(play_all(options.count, options.seed, options.stations, options.fruits))
    made = link_results.read(STORIES_FILE)
    sections.write(DOCUMENT, sections_of(made, CHART))
    return 1 if any(story.all_broken for story in made.stories) else 0


if __name__ == "__main__":
    sys.exit(main())
