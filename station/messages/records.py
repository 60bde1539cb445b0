"""Messages of the records: why a request cannot be carried out, and what to do."""

from station.messages.message import Nested, Number, define

FAULT = define("records.fault", "records: {cause}; {remedy}", cause=Nested(), remedy=Nested())

# Opening, disk and database.
DISK_FULL = define("records.disk_full", "{place}: the disk is full ({words})")
NOT_WRITABLE = define("records.not_writable", "{place}: cannot be written ({words})")
LOCKED = define("records.locked", "{place}: another program holds the database ({words})")
DISK_FAILED = define("records.disk_failed", "{place}: the disk failed ({words})")
DAMAGED = define("records.damaged", "{place}: the database is damaged ({words})")
NO_DATABASE = define("records.no_database", "{place}: this is no database ({words})")
FILE_OR_FOLDER = define(
    "records.file_or_folder", "{place}: a file is where a folder has to be, or a folder where a file ({words})"
)
REFUSED = define("records.refused", "{place}: the database refused: {words}")
UNEXPECTED = define("records.unexpected", "{place}: {kind}: {words}")
MALFORMED = define("records.malformed", "what was to be recorded is malformed: {words}")
RESERVE_REACHED = define(
    "records.reserve_reached",
    "{free_mb} MB are free on the disk of {folder}, less than the reserve of {reserve_mb} MB",
    free_mb=Number(0),
    reserve_mb=Number(0),
)
ANOTHER_STATION = define("records.another_station", "{folder}: another station has it, process {process}")
REMOVED = define("records.removed", "{path}: was removed or replaced while the station ran")
MISSING_DATABASE = define(
    "records.missing_database",
    "{path}: there was none, though {number} inspections were numbered; a new one was begun",
    number=Number(0),
)
BEGUN_ANEW = define(
    "records.begun_anew",
    "{cause}; a new one was begun after number {number}",
    cause=Nested(),
    number=Number(0),
)
NUMBERS_UNKNOWN = define(
    "records.numbers_unknown", "{path}: which numbers were given is not known, and the database does not show it"
)
NUMBERS_USED_UP = define("records.numbers_used_up", "all {largest} sequence numbers were given", largest=Number(0))
NUMBER_GIVEN = define("records.number_given", "{number} was given already", number=Number(0))
NO_RECORDS = define("records.no_records", "there is no {path}")
CLOSED = define("records.closed", "they are closed")
TOO_SLOW = define("records.too_slow", "the disk did not take it within {limit_s} s")
NEWER_SCHEMA = define("records.newer_schema", "{path} has the schema {schema} of a newer fruit-station")
NOT_MIGRATED = define(
    "records.not_migrated", "the database could not be brought from schema {before} to {after}: {words}"
)
NO_SPACE_FOR_COPY = define(
    "records.no_space_for_copy",
    "{path}: no space for a copy of {size_bytes} bytes before the upgrade",
    size_bytes=Number(0),
)
ORIGIN_MISSING = define("records.origin_missing", "the outbox's origin is missing from the database")

# What is asked for, or to be recorded.
NO_INSPECTION = define("records.no_inspection", "there is no inspection {number}", number=Number(0))
NEVER_BEGUN = define("records.never_begun", "inspection {number} was never begun", number=Number(0))
NOT_THIS_START = define(
    "records.not_this_start",
    "no inspection {number} has begun since this start of the station",
    number=Number(0),
)
WRONG_REASONS = define(
    "records.wrong_reasons",
    "inspection {number}: {outcome} with the reasons {reasons}",
    number=Number(0),
)
BAD_INSPECTION = define(
    "records.bad_inspection",
    "inspection {number} is malformed: {words}",
    number=Number(0),
)
PAGE_TOO_LARGE = define("records.page_too_large", "a page of {number} inspections", number=Number(0))
NO_LOT = define("records.no_lot", "there is no lot {lot}")
LOT_WITHOUT_INSPECTIONS = define("records.lot_without_inspections", "no inspection is of a lot {lot}")
BAD_LOT_NAME = define("records.bad_lot_name", "the lot {text} is no name")
BAD_GROWER = define("records.bad_grower", "the grower {text} is no name")
LONG_LOT_NAME = define("records.long_lot_name", "the lot's name has {letters} letters", letters=Number(0))
LONG_GROWER = define("records.long_grower", "the grower's name has {letters} characters", letters=Number(0))
ANOTHER_GROWER = define("records.another_grower", "lot {lot} is registered for {known}, not for {grower}")
INSPECTION_NOT_HELD = define(
    "records.inspection_not_held", "the images of inspection {number} are not retained", number=Number(0)
)
NUMBER_AND_LOT = define(
    "records.number_and_lot", "a lot is named {lot}, and an inspection may have that number: nothing was changed"
)
LOT_NOT_HELD = define("records.lot_not_held", "the images of lot {lot} are not retained")
NO_REASON = define("records.no_reason", "no reason was given")
AUDIT_VALUE = define("records.audit_value", "the audit trail cannot hold {value}: {words}")
AUDIT_WORD = define(
    "records.audit_word",
    "audit: {field}: expected one printable line of 1 to {most} characters, got {text}",
    most=Number(0),
)
AUDIT_TEXT = define(
    "records.audit_text",
    "audit: {field}: expected at most {most} printable characters, got {text}",
    most=Number(0),
)

NO_SIGNING_KEY = define("records.no_signing_key", "{path}: this is no Ed25519 key in PEM form")

# Images.
IMAGES_PENDING = define("records.images_pending", "waiting for the disk")
IMAGES_KEPT = define("records.images_kept", "kept")
IMAGES_LOST = define("records.images_lost", "lost: the station ended before they were written")
FILES_MISSING = define("records.files_missing", "{number} of their files are missing", number=Number(0))
IMAGES_NOT_WANTED = define("records.images_not_wanted", "not kept, by the settings of the records")
IMAGES_REMOVED = define("records.images_removed", "removed: space for newer ones")
IMAGES_NONE = define("records.images_none", "none: only the outcome is known")
IMAGES_DROPPED = define("records.images_dropped", "not stored: {cause}", cause=Nested())
IMAGES_PARTLY = define(
    "records.images_partly", "{state}; {kept} of {number} kept", state=Nested(), kept=Number(0), number=Number(0)
)
TOO_MANY_WAIT = define("records.too_many_wait", "too many images wait for the disk")
STATION_ENDED = define("records.station_ended", "the station ended")
OVER_QUOTA = define(
    "records.over_quota",
    "they need {needed_bytes} bytes, records.images_quota_mb allows {quota_bytes}",
    needed_bytes=Number(0),
    quota_bytes=Number(0),
)
QUOTA_FULL = define("records.quota_full", "the quota is full of images of rejected fruit, or on hold")
DISK_NEARLY_FULL = define(
    "records.disk_nearly_full", "the disk is nearly full, and only images of rejected fruit, or on hold, are left"
)
REFERENCE_NOT_KEPT = define(
    "records.reference_not_kept",
    "the reference of inspection {number} was not kept ({state})",
    number=Number(0),
    state=Nested(),
)
STEP_NOT_KEPT = define(
    "records.step_not_kept",
    "the image of step {step} of inspection {number} was not kept ({state})",
    step=Number(0),
    number=Number(0),
    state=Nested(),
)
IMAGE_GONE = define("records.image_gone", "the image is not kept any more")
IMAGE_DAMAGED = define("records.image_damaged", "the image's file is damaged")
IMAGE_TOO_LARGE = define("records.image_too_large", "the image's file is larger than any of a sensor")
IMAGES_DIFFER = define("records.images_differ", "its reference and this image differ in size")
NO_RECIPE = define("records.no_recipe", "inspection {number} has no recipe", number=Number(0))
UNKNOWN_RECIPE = define("records.unknown_recipe", "this version does not accept the inspection's recipe")

# Backup and restore.
THERE_ALREADY = define("records.there_already", "{path} is there already")
NO_BACKUP = define("records.no_backup", "{path} is no backup: it has no {file}")
BAD_FILE = define("records.bad_file", "{path}: {words}")
OTHER_CONTENT = define("records.other_content", "{path} is damaged: its content is not what its name says")
NOT_THE_VERIFIED = define("records.not_the_verified", "{path} is missing, or not the one that was verified")
NO_SUCH_FILE = define("records.no_such_file", "{path}: this is no file, or larger than {most} bytes", most=Number(0))
BACKUP_UNSIGNED = define(
    "records.backup_unsigned",
    "{path} is not signed: a version before the signatures made it, or somebody removed the signature",
)
BACKUP_OTHER_KEY = define(
    "records.backup_other_key", "{path} is not signed by the key {keys}: it was changed, or another station made it"
)
IMAGE_MISSING = define("records.image_missing", "{path}: the image {image} is missing")
NO_SPACE_FOR_BACKUP = define(
    "records.no_space_for_backup",
    "{path}: {free} bytes are free, the backup and the reserve that the station needs take {wanted}",
    free=Number(0),
    wanted=Number(0),
)

# What to do.
FREE_SPACE = define("records.free_space", "free space on the disk")
FREE_SPACE_OR_QUOTA = define("records.free_space_or_quota", "free space, or lower records.images_quota_mb")
FREE_SPACE_OR_OTHER = define("records.free_space_or_other", "free space, or name another folder")
MAKE_WRITABLE = define(
    "records.make_writable",
    "make the folder and its files writable for the station's user, and the disk too",
)
CLOSE_PROGRAM = define("records.close_program", "close the program that has it open for writing")
REPLACE_DISK = define("records.replace_disk", "look at the system's log, and replace the disk if it says so")
OPEN_AGAIN = define(
    "records.open_again",
    "open the records again: it is moved aside, and a new one is begun with the numbers going on",
)
MOVE_AWAY = define("records.move_away", "move it away, or set another home")
SEE_LOG = define("records.see_log", "see the log")
REPORT_FAULT = define("records.report_fault", "this is a fault of the program: report it with the log")
STOP_OTHER = define("records.stop_other", "stop that one, or set another home")
FIND_OLD = define("records.find_old", "look for the old one; its images are in {folder}")
RECOVER_OLD = define(
    "records.recover_old",
    "the old one and its images are in {folder}: `sqlite3 FILE .recover` reads what is left of it",
)
CONTINUE_AFTER = define(
    "records.continue_after",
    "find the last number that the PLC or the reports know, then: station records continue-after NUMBER",
)
ARCHIVE = define("records.archive", "archive the records' folder and begin a new one")
GIVE_HIGHER = define("records.give_higher", "give {number} or a higher number", number=Number(0))
GIVE_HOME = define("records.give_home", "give the station's home folder, or let the station begin one")
RESTORE_OR_START = define(
    "records.restore_or_start",
    "there was one: restore a backup, or start the station, which moves what is left aside and begins a new one",
)
OPEN_FIRST = define("records.open_first", "open them first")
CHECK_DISK = define("records.check_disk", "check the disk, or raise records.deadline_s")
USE_NEWER = define("records.use_newer", "use the version that made it")
INSTALL_NEWER = define(
    "records.install_newer", "install that version again, or put back the copy in {folder} that this version made"
)
INSTALL_EARLIER = define(
    "records.install_earlier", "it is as it was; install the earlier version again and report this"
)
INSTALL_EARLIER_COPY = define(
    "records.install_earlier_copy",
    "it is as it was; install the earlier version again and report this; a copy of it is {path}",
)
REPLACE_KEY = define(
    "records.replace_key",
    "put back the file, or remove it: then a new key is made, and the public part that you keep elsewhere changes",
)
PUT_BACK_BACKUP = define("records.put_back_backup", "put back a backup")
LIST_SHOWS = define("records.list_shows", "`station records list` shows what there is")
LIST_SHOWS_RANGE = define(
    "records.list_shows_range",
    "the records hold {first} to {last}; `station records list` shows them",
    first=Number(0),
    last=Number(0),
)
RECORDS_EMPTY = define("records.empty", "the records are empty")
ASK_OPEN = define("records.ask_open", "read which inspections are open")
BEGIN_FIRST = define("records.begin_first", "begin it first")
ASK_FOR_FEWER = define("records.ask_for_fewer", "ask for 1 to {most}", most=Number(0))
LIST_SHOWS_LOTS = define("records.list_shows_lots", "`station records list` shows the lots' names")
REGISTER_LOT = define("records.register_lot", "register its start first: station records lot start")
PRINTABLE_NAME = define("records.printable_name", "give one of printable letters")
LONGEST_LOT_NAME = define("records.longest_lot_name", "the PLC gives at most {most}", most=Number(0))
SHORTER_NAME = define("records.shorter_name", "give a name of at most {most} characters", most=Number(0))
CORRECT_LOT = define(
    "records.correct_lot",
    "give the new lot another name, or correct it: station records lot start --correct",
)
HOLDS_SHOW = define("records.holds_show", "`station records holds` lists those that are")
SAY_WHICH = define("records.say_which", "repeat the command with --lot or with --inspection")
GIVE_REASON = define("records.give_reason", "give a reason, for those who read it later")
PROPER_WORD = define("records.proper_word", "give a proper {field}")
SHORTER_TEXT = define("records.shorter_text", "give a shorter {field}, without control characters")
OPEN_ANOTHER = define("records.open_another", "open another one")
OPEN_ANOTHER_STEP = define("records.open_another_step", "open another step")
WHAT_IS_KEPT = define(
    "records.what_is_kept",
    "open another one; records.images_quota_mb and records.accepted_share decide what is kept",
)
OLDEST_GO_FIRST = define("records.oldest_go_first", "the oldest images make room for new ones")
LOOK_AT_FILE = define("records.look_at_file", "look at {path}")
RUN_CHECK = define("records.run_check", "run `station records check`")
RUN_CHECK_KEEP = define("records.run_check_keep", "run `station records check`; keep the last backup")
NEW_FOLDER = define("records.new_folder", "name a new folder; a backup never changes another one")
NAME_BACKUP = define("records.name_backup", "name a folder that `station records backup` made")
TAKE_ANOTHER = define("records.take_another", "take another backup: this one is not whole")
TRUST_BACKUP = define(
    "records.trust_backup",
    "give the public key of the station that made it by --public-key; or, only if nobody else could write to it, "
    "restore it by --unverified: results that were changed in it are then not found",
)
