"""Messages of commands of the PLC and of operators: why one was not done."""

from station.messages.message import Listed, Nested, Number, define

MODE_UNKNOWN = define(
    "command.mode_unknown", "mode {mode}: expected 1 (production), 2 (maintenance) or 3 (manual)", mode=Number()
)
MODE_KEPT = define(
    "command.mode_kept", "{activity} at the panel needs this mode: let it end, or abort it there", activity=Nested()
)
MODE_NOT_STORED = define(
    "command.mode_not_stored",
    "mode {mode} is set, but is lost at the next start: the home folder cannot be written; make it writable",
    mode=Number(),
)
JOGGING = define("command.jogging", "jogging")
RECIPE_UNKNOWN = define("command.recipe_unknown", "recipe {number}: expected one of {known}")
NO_RECIPES = define("command.no_recipes", "recipe {number}: there is no recipe to choose; see `station recipes check`")
RECIPE_UNKNOWN_BECAUSE = define(
    "command.recipe_unknown_because", "{refusal}; {problems}", refusal=Nested(), problems=Listed("; ")
)
RECIPE_TOO_WIDE = define(
    "command.recipe_too_wide", "recipe {number}: its fruit are wider than the jaws open, {widest_mm} mm"
)
RECIPE_NOT_STORED = define(
    "command.recipe_not_stored",
    "recipe {number} is active, but is lost at the next start: the home folder cannot be written; make it writable",
)
STARTED_MEANWHILE = define("command.started_meanwhile", "the station was started again meanwhile")
STOPPED_MEANWHILE = define("command.stopped_meanwhile", "the station was stopped again meanwhile")
STOP_NOT_STORED = define(
    "command.stop_not_stored",
    "the station is stopped, but starts by itself next time: the home folder cannot be written; make it writable",
)
ENDING = define("command.ending", "the station is ending")
CONFIRM_STOP = define(
    "command.confirm_stop",
    "a person has to confirm this stop at the cell, with `station devices recover`, before the reset: {stop}",
    stop=Nested(),
)
BUSY_CALL_OFF = define("command.busy_call_off", "an inspection is under way: abort it first")
BUSY = define("command.busy", "an inspection is under way: wait for its end")
JUDGED = define("command.judged", "the inspection is already judged")
ANOTHER_FRUIT = define(
    "command.another_fruit", "fruit {sequence} is done, and nothing was ended: another one is inspected by now, or none"
)
TOO_SLOW = define(
    "command.too_slow", "{command} did not come to its end within {limit_s} s: {activity}", activity=Nested()
)
NOTHING_TO_RECOVER = define("command.nothing_to_recover", "there is nothing to recover from any more")
NO_NUMBER = define("command.no_number", "{command}: {argument} is no number")
