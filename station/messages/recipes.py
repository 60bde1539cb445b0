"""Messages of recipes: states of their files, refusals of changes, and what a person has to do."""

from station.messages.message import Listed, Nested, Number, define

# Reasons that the station itself gives in a recipe's history and in the audit trail.
REASON_ADOPTED = define("recipe.reason.adopted", "it was there when the recipes' history began")
REASON_USED = define("recipe.reason.used", "the station inspected by it until now")
REASON_SHIPPED = define("recipe.reason.shipped", "shipped with the station's software")
OWN_REASONS = (REASON_ADOPTED, REASON_USED, REASON_SHIPPED)

# At the start of a lot.
MOVED = define(
    "recipe.moved",
    "recipe {recipe} has the PLC's number {now} now, and no longer {before}; choose a recipe again",
    now=Number(),
    before=Number(),
)
ANOTHER = define(
    "recipe.another", "the PLC's number {number} is {now} now, and no longer {before}; choose a recipe again"
)
GONE = define(
    "recipe.gone", "recipe {recipe} with the PLC's number {number} is no longer in force; choose a recipe again"
)
STORED_ONES = define("recipe.stored_ones", "the recipes in force are those stored in {folder}: {why}", why=Nested())

# Differences of two recipes.
CHANGE = define("recipe.change", "{path}: {old} → {new}")
CHANGES = define("recipe.changes", "{changes}", changes=Listed("; "))
NO_CHANGE = define("recipe.no_change", "no value differs")

# Status of a revision.
DRAFT = define("recipe.draft", "a draft")
APPROVED = define("recipe.approved", "approved")
RETIRED = define("recipe.retired", "retired")
MISSING = define("recipe.missing", "gone")

# State of a file.
STAYS = define("recipe.stays", "revision {revision} stays in force", revision=Number())
NONE_IN_FORCE = define("recipe.none_in_force", "none is in force")
FILE_BROKEN = define(
    "recipe.file_broken",
    "{problems}; {stays}: repair the file, or `station recipes revert {recipe}`",
    problems=Listed("; "),
    stays=Nested(),
)
FILE_GONE = define(
    "recipe.file_gone",
    "recipe {recipe}: its file is gone; {stays}: put it back, or `station recipes revert {recipe}`",
    stays=Nested(),
)
NOT_ACCEPTED = define(
    "recipe.not_accepted",
    "recipe {recipe}: its approved revision {revision} is not accepted any more: {why}",
    revision=Number(),
    why=Nested(),
)
FILE_IS_DRAFT = define(
    "recipe.file_is_draft",
    "recipe {recipe}: {file} is an unapproved draft; {stays}; {todo}",
    stays=Nested(),
    todo=Nested(),
)
FILE_IS_CHANGED = define(
    "recipe.file_is_changed",
    "recipe {recipe}: {file} is an unapproved draft ({changes}); {stays}; {todo}",
    changes=Nested(),
    stays=Nested(),
    todo=Nested(),
)
DO_APPROVE = define(
    "recipe.do_approve",
    "revision {revision} of {author} waits for another person: `station recipes approve`",
    revision=Number(),
)
DO_SUBMIT = define("recipe.do_submit", "`station recipes submit {recipe}`, or revert it")

# Refusals of changes.
SAME = define(
    "recipe.same",
    "recipe {recipe}: the file is the same as revision {revision}, which is approved already; change it first",
    revision=Number(),
)
NOT_FOR_INSPECTIONS = define(
    "recipe.not_for_inspections",
    "recipe {recipe}: segmentation.method is paper, which gives no confidence, so no fruit would pass; set it to "
    "robust, and use paper in `station analyze` and `station study`",
)
ANOTHER_WAITS = define(
    "recipe.another_waits",
    "recipe {recipe}: revision {revision} of {author} waits for approval; let it be approved or rejected first",
    revision=Number(),
)
ANOTHER_WAITS_DIFFERS = define(
    "recipe.another_waits_differs",
    "recipe {recipe}: revision {revision} of {author} waits for approval, and differs from this one: {changes}; let "
    "it be approved or retired first",
    revision=Number(),
    changes=Nested(),
)
NOT_WAITING = define(
    "recipe.not_waiting",
    "recipe {recipe}, revision {revision}: it is {status}, and only a draft is approved",
    revision=Number(),
    status=Nested(),
)
OWN = define(
    "recipe.own",
    "recipe {recipe}, revision {revision}: {author} is its author; another person has to approve it",
    revision=Number(),
)
FILE_UNREADABLE = define(
    "recipe.file_unreadable",
    "recipe {recipe}, revision {revision}: the recipe's file cannot be read; submit the file again, or put it back "
    "with revert",
    revision=Number(),
)
FILE_DIFFERS = define(
    "recipe.file_differs",
    "recipe {recipe}, revision {revision}: the recipe's file differs: {changes}; submit the file again, or put it back "
    "with revert",
    revision=Number(),
    changes=Nested(),
)
NUMBER_TAKEN = define(
    "recipe.number_taken",
    "recipe {recipe}, revision {revision}: its PLC number {number} is that of the approved {other}",
    revision=Number(),
)
RETIRED_ALREADY = define(
    "recipe.retired_already",
    "recipe {recipe}, revision {revision}: it is retired already",
    revision=Number(),
)
RECORDED_MEANWHILE = define(
    "recipe.recorded_meanwhile",
    "recipe {recipe}: revision {revision} was recorded meanwhile; look at it first",
    revision=Number(),
)
CHANGED_SINCE = define(
    "recipe.changed_since",
    "recipe {recipe}: it was changed since {base} was read, to {now}; look at it as it is now and make the change "
    "again",
)
CHANGED_SINCE_IN = define(
    "recipe.changed_since_in",
    "recipe {recipe}: it was changed since {base} was read, to {now}: {changes}; look at it as it is now and make the "
    "change again",
    changes=Nested(),
)
SHIPPED = define(
    "recipe.shipped",
    "the shipped recipes belong to the software: copy them into a folder of the site's, name it as recipes_folder in "
    "station.yaml, and edit them there",
)
NO_BASE = define(
    "recipe.no_base",
    "recipe {recipe}: expected what it is based on: export it first, or give the content hash that `station recipes "
    "list` shows",
)
ONLY_DRAFT_REJECTED = define(
    "recipe.only_draft_rejected",
    "recipe {recipe}: revision {revision} is {status}, and only a draft is rejected; look at the recipe again",
    revision=Number(),
    status=Nested(),
)
NO_DRAFT = define("recipe.no_draft", "recipe {recipe}: no draft waits for approval; submit one first")
SOMEBODY_ELSE = define("recipe.somebody_else", "somebody else changes a recipe at this moment; try again")
NOT_WRITABLE = define(
    "recipe.not_writable",
    "{file}: cannot be written: {error}; it is as it was. Free space, or make it writable for this user",
)
FILE_IN_THE_WAY = define(
    "recipe.file_in_the_way", "{file}: there is a file of that name which is no good recipe; repair it first"
)
NO_GOOD_FILE = define("recipe.no_good_file", "recipe {recipe}: there is no good file of it; give one of its revisions")
NONE_APPROVED = define("recipe.none_approved", "recipe {recipe}: none of its revisions is approved; name one")
UNKNOWN = define("recipe.unknown", "recipe {recipe}: expected one of {known}")
UNKNOWN_REVISION = define(
    "recipe.unknown_revision",
    "recipe {recipe}: revision {revision}: expected one of {known}",
    revision=Number(),
)
NO_REVISION = define("recipe.no_revision", "recipe {recipe}: revision {revision}: there is none yet", revision=Number())
HISTORY_NOT_BEGUN = define(
    "recipe.history_not_begun",
    "the recipes' history has not begun: `station recipes adopt`, or the station's first start, takes over what is "
    "there",
)
REVISION_NOT_ACCEPTED = define(
    "recipe.revision_not_accepted", "this program does not accept that revision any more: {why}", why=Nested()
)
