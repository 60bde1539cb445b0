"""Messages of readiness: why no trigger is accepted, and what to do."""

from station.messages.message import Listed, Number, define

ENDING = define("readiness.ending", "The station is ending: start it again.")
STOPPED_BY_PERSON = define(
    "readiness.stopped_by_person", "A person has stopped the station at the panel: start it there."
)
NO_PROGRESS = define(
    "readiness.no_progress", "No progress of {parts}: restart the station if it stays so.", parts=Listed()
)
PART_AGE = define("readiness.part_age", "{part} for {age_s} s", age_s=Number(0))
RECIPE_CHANGING = define("readiness.recipe_changing", "The recipe is being changed: wait a moment.")
NO_RECIPE = define("readiness.no_recipe", "No recipe is active: choose one by its number ({numbers}).")
NO_RECIPE_AT_ALL = define(
    "readiness.no_recipe_at_all", "No recipe is active, and there is none to choose: see `station recipes check`."
)
NOT_PRODUCTION = define(
    "readiness.not_production",
    "The station is not in production mode: set it on the page Maintenance, or mode 1 from the PLC.",
)
SEE_DEVICES = define("readiness.see_devices", "see the detail, and `station devices check`")
SEE_DETAIL = define("readiness.see_detail", "see the detail")
PLC_NOT_HEARD = define("readiness.plc_not_heard", "the PLC interface has sent nothing yet")
START_PLC = define("readiness.start_plc", "start it: `station plc run`")
