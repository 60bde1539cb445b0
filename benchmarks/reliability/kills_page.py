"""The page of the kills during inspections, and the form in which they are stored."""

from collections import Counter
from collections.abc import Iterable, Sequence

from pydantic import BaseModel, ConfigDict

PROCESSES = ("arm", "hmi", "plc", "service")

_HEAD = """# Kills during inspections

`./run bench kills --wire N` adds N kills to this page: whole stations with the simulated cell and a PLC on the wire. In
each round one fruit, sound or bruised, is inspected, and one to three processes are killed (SIGKILL), one after the
other: the first at a random moment within 4 s of the accepted trigger (*inspection*), within 3 s of the result, while
the jaws open, the arm carries the fruit or leaves (*release*), or with nothing under way (*idle*); there the trigger
follows at once. The others come within 3 s of the kill before, while what was killed starts again (*again*). In two of
five rounds the arm first stops protectively, or a person stops the station at the panel. Where the station then needs a
person, up to two more processes are killed before the person comes (*held*).

After each round: one outcome for each trigger, the same in the records, and acknowledged; no PASS for a bruised fruit,
no FAIL for a sound one. What only a person may end is still held after each kill, nothing moves in it, and the person's
recovery and reset make it ready again. The arm carries the fruit to its place in three of four stations; there a kill
of the service or of the arm's process with a judged fruit between the jaws has to be held too, and the jaws stay
closed. The supervisor's processes are killed at most five times a minute each: it gives up what ends more often. After
20 rounds the station ends; `station records check` then has to find no fault and nothing to put right, and every
inspection has an outcome that the PLC acknowledged, and is in the outbox. `--seed S` repeats a station's plan, not its
moments. [Kills of the records alone](records-kills.md) have a page of their own.

A trigger that arrives before the station has noticed the kill gets no inspection: the PLC reads a refusal, or no answer
in time, and diverts the fruit.
"""


class _Stored(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Kill(_Stored):
    """One process killed."""

    process: str
    moment: str
    state: str
    """PackML's, as the PLC read it last before the kill."""


class Round(_Stored):
    """One fruit, the kills in its time, and what came of it."""

    seed: int
    number: int
    """Of the round, since the station with this seed was started."""
    placing: str
    """The service's setting."""
    bruised: bool
    """The fruit."""
    kills: tuple[Kill, ...]
    """Empty where what is wrong came before the first."""
    outcome: str
    """The PLC's decision; empty where nothing was triggered."""
    held: str
    """What a person had to end afterwards; empty for nothing."""
    took_s: float
    wrong: tuple[str, ...]


class Station(_Stored):
    """Contents of one station's records after all its rounds."""

    seed: int
    inspections: int
    images: int
    audit_rows: int
    wrong: tuple[str, ...]


class Made(_Stored):
    """All that was ever done."""

    rounds: tuple[Round, ...] = ()
    stations: tuple[Station, ...] = ()

    @property
    def kills(self) -> int:
        """Number of kills."""
        return sum(len(each.kills) for each in self.rounds)

    @property
    def bad(self) -> int:
        """Number of rounds and of stations with something wrong."""
        return sum(bool(each.wrong) for each in (*self.rounds, *self.stations))


def markdown(made: Made) -> str:
    """The page.

    Args:
        made: what it is about.
    """
    rounds, stations = made.rounds, made.stations
    count = Counter((kill.moment, kill.state, kill.process) for each in rounds for kill in each.kills)
    places = sorted({(moment, state) for moment, state, _ in count})
    in_all = [str(sum(n for (_, _, name), n in count.items() if name == each)) for each in PROCESSES]
    wrong = Counter(line for each in (*rounds, *stations) for line in each.wrong)
    held = Counter((each.held, sum(kill.moment == "held" for kill in each.kills)) for each in rounds if each.held)
    rows = {name: [held[name, number] for number in range(3)] for name, _ in sorted(held)}
    lines = [
        _HEAD,
        f"{made.kills} kills in {len(rounds)} rounds, {made.bad} times something wrong.",
        "",
        f"| moment | state that the PLC read | {' | '.join(PROCESSES)} |",
        f"| --- | --- |{' --- |' * len(PROCESSES)}",
        *(
            f"| {moment} | {state or 'none'} | {' | '.join(str(count[moment, state, each]) for each in PROCESSES)} |"
            for moment, state in places
        ),
        f"| in all | | {' | '.join(in_all)} |",
        "",
        "| ended by a person afterwards | rounds | with one kill in it | with two |",
        "| --- | --- | --- | --- |",
        *(f"| {name} | {sum(numbers)} | {numbers[1]} | {numbers[2]} |" for name, numbers in rows.items()),
        "",
        *_table("outcome", "fruits", Counter(each.outcome for each in rounds if each.outcome)),
        *_table("wrong", "times", wrong or Counter({"nothing": 0})),
        _records(stations),
        "",
        "Seeds, each with its kills: " + _seeds(rounds),
        "",
    ]
    return "\n".join(lines)


def _table(what: str, number: str, counts: Counter[str]) -> Iterable[str]:
    yield from (f"| {what} | {number} |", "| --- | --- |")
    yield from (f"| {name} | {times} |" for name, times in sorted(counts.items()))
    yield ""


def _records(stations: Sequence[Station]) -> str:
    inspections, images = sum(each.inspections for each in stations), sum(each.images for each in stations)
    rows = sum(each.audit_rows for each in stations)
    return (
        f"Records checked: of {len(stations)} stations, {inspections} inspections, {images} images, {rows} audit rows."
    )


def _seeds(rounds: Iterable[Round]) -> str:
    kills = Counter[int]()
    for each in rounds:
        kills[each.seed] += len(each.kills)
    return ", ".join(f"{seed} ({number})" for seed, number in sorted(kills.items()))
