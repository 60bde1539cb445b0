"""Messages of settings files: recipes, `station.yaml` and environment variables."""

from station.messages.message import Listed, Nested, Number, define, define_plural

# A problem and its place.
PROBLEMS = define("settings.problems", "{problems}", problems=Listed("\n"))
PROBLEM = define("settings.problem", "{place}: {field}: {expected}", place=Nested(), field=Nested(), expected=Nested())
MORE = define("settings.more", "and more: correct these first")
LINE = define("settings.line", "{file}:{line}", line=Number())
PATH = define("settings.path", "{path}")
ENVIRONMENT = define("settings.environment", "environment")
DEFAULT = define("settings.default", "built-in default")
FIELD = define("settings.field", "{path}")
FILE = define("settings.file", "file")
FOLDER = define("settings.folder", "folder")

# A value that its field does not accept.
EXPECTED = define("settings.expected", "expected {wanted}, got {found}", wanted=Nested(), found=Nested())
NOTHING = define("settings.nothing", "nothing")
VALUE = define("settings.value", "{value}")
A_MAPPING = define("settings.a_mapping", "a mapping")
A_LIST = define_plural("settings.a_list", "a list of {number} item", "a list of {number} items", "number")
ANOTHER_VALUE = define("settings.another_value", "another value (pydantic: {type})")
UNKNOWN_KEY = define("settings.unknown_key", "unknown key {name}: expected {known}")
EARLIER_SETTING = define(
    "settings.earlier_setting",
    "{name} is a setting of an earlier version: `station config migrate FILE --write` brings the file up to date",
)
UNKNOWN_KEY_NEAR = define("settings.unknown_key_near", "unknown key {name}: did you mean {near}?")
UNKNOWN_VARIABLE = define(
    "settings.unknown_variable", "unknown variable: see docs/configuration.md for those there are"
)
UNKNOWN_VARIABLE_NEAR = define("settings.unknown_variable_near", "unknown variable: did you mean {near}?")

# Files and folders.
NOT_A_FILE = define("settings.not_a_file", "expected a regular file, got a folder, a pipe or a device")
NOT_FOUND = define("settings.not_found", "expected a readable file: there is none with this name")
NOT_PERMITTED = define(
    "settings.not_permitted", "expected a readable file: give the station's user the right to read it"
)
UNREADABLE = define("settings.unreadable", "expected a readable file: {error}")
UNWRITABLE = define("settings.unwritable", "cannot be written: {error}")
TOO_LARGE = define("settings.too_large", "expected at most {limit_kib} KiB, got more: is this the right file?")
NO_FOLDER = define("settings.no_folder", "expected a folder of recipes: {error}")
NO_RECIPES = define("settings.no_recipes", "expected recipes (*.yaml), got none")

# YAML.
NOT_UTF8 = define("settings.not_utf8", "expected UTF-8 text, got the byte 0x{byte}")
NOT_PRINTABLE = define("settings.not_printable", "expected printable text, got a control character")
NOT_UNICODE = define("settings.not_unicode", "expected characters that exist in Unicode")
NOT_YAML = define("settings.not_yaml", "expected valid YAML: {error}")
TAB = define("settings.tab", "expected spaces, got a tab")
TOO_DEEP = define("settings.too_deep", "expected at most {levels} levels of nesting", levels=Number())
TOO_MANY = define("settings.too_many", "expected at most {number} keys and values")
NOT_PLAIN = define(
    "settings.not_plain", "expected a plain value, got {found}: write it out without anchors, aliases and tags"
)
TWICE = define("settings.twice", "expected once, got it again: it is on line {line} already", line=Number())
KEY = define("settings.key", "expected a key that is a text, got {found}", found=Nested())
OTHER_SWITCH = define(
    "settings.other_switch",
    'expected a word that all YAML programs read alike, got {word}: write true or false, or "{word}" in quotes for a '
    "text",
)
OTHER_NUMBER = define(
    "settings.other_number",
    "expected a word that all YAML programs read alike, got {word}: write a number of at most {digits} decimal digits "
    'without exponent and leading zeros, or "{word}" in quotes for a text',
    digits=Number(),
)
OTHER_WORD = define(
    "settings.other_word",
    'expected a word that all YAML programs read alike, got {word}: write "{word}" in quotes for a text',
)
NOT_EDITABLE = define("settings.not_editable", "expected text that can be changed with its comments kept: {error}")

# Recipes: files.
NEWER_SCHEMA = define(
    "settings.newer_schema",
    "expected at most {known}, got {found} of a newer fruit-station: install that, or write the older form",
    known=Number(),
    found=Number(),
)
RECIPE_TWICE = define("settings.recipe_twice", "expected one recipe with {value}, but {file} has it too")
NO_SUCH_VALUE = define(
    "settings.no_such_value", "{path}: expected the path of a value in the recipe's file, as damage.area[0].area_mm2"
)

# Recipes: values that do not fit together.
PRINTABLE = define(
    "settings.printable",
    "printable characters: no control characters, none that turn the direction of text",
)
LESS_THAN = define(
    "settings.less_than",
    "expected less than {field}, {limit}{unit}, got {value}",
    limit=Number(),
    value=Number(),
)
WIDTH_MISSING = define("settings.width_missing", "expected a width, as start is 'width'")
WIDTH_UNUSED = define("settings.width_unused", "expected null, as start is 'onset', got {value}", value=Number())
AT_REST_ONLY = define(
    "settings.at_rest_only", "expected 'at_rest', as start is 'width': the way to the limits is not known"
)
STEPS_BEYOND_WIDTH = define(
    "settings.steps_beyond_width", "expected steps within the start width, got {travel_mm} mm of closing"
)
STEPS_BEYOND_LIMIT = define(
    "settings.steps_beyond_limit",
    "expected steps within closing_limit_mm, {limit_mm} mm, got {travel_mm} mm of closing",
)
BEYOND_STEPS = define("settings.beyond_steps", "expected within the steps, {travel_mm} mm, got {value}", value=Number())
CLOSING_NOT_RISING = define(
    "settings.closing_not_rising", "expected more than the closing before, got {value}", value=Number()
)
THRESHOLD_CLOSING_NOT_RISING = define(
    "settings.threshold_closing_not_rising", "expected more than the threshold before, got {value}", value=Number()
)
THRESHOLD_FALLING = define(
    "settings.threshold_falling", "expected no less than the threshold before, got {value}", value=Number()
)
NO_RESULT_CLOSING = define(
    "settings.no_result_closing",
    "expected one of the results' closings ({closings}), got {value}",
    closings=Listed(),
    value=Number(),
)
CLOSING = define("settings.closing", "{closing_mm}")
JUDGED_ON_ONE_STEP = define(
    "settings.judged_on_one_step",
    "expected another step before this closing, a multiple of {step_mm} mm from {from_mm} to below {below_mm} mm: no "
    "fruit passes by one image alone (make steps.step_mm smaller or the closing larger), got {value}",
    step_mm=Number(),
    from_mm=Number(),
    below_mm=Number(),
    value=Number(),
)
KEPT_BY_NO_AREA = define(
    "settings.kept_by_no_area",
    "expected room below area_mm2, {limit_mm2} mm²: with a guard band of {guard_percent}% on either side no fruit "
    "would pass (lower it, raise area_mm2, or lower damage.uncertainty), got {value}",
    guard_percent=Number(1),
    value=Number(),
)
STOP_BELOW_AREA = define(
    "settings.stop_below_area",
    "expected no less than the largest damage threshold, {limit_mm2} mm², got {value}",
    value=Number(),
)
STOP_BELOW_GROWTH = define(
    "settings.stop_below_growth",
    "expected no less than the damage threshold, {limit} mm²/mm, got {value}",
    limit=Number(),
    value=Number(),
)
LENGTH_UNEXPECTED = define(
    "settings.length_unexpected",
    "expected within expected_length, {smallest_mm} to {largest_mm} mm, got {value}",
    value=Number(),
)
MIDDLE_UNEXPECTED = define(
    "settings.middle_unexpected",
    "expected within expected_length, {smallest_mm} to {largest_mm} mm, got a middle of {value}",
    value=Number(),
)
CLASSES_MISSING = define("settings.classes_missing", "expected the grader's classes, as from is 'class'")
CLASS_NOT_RISING = define(
    "settings.class_not_rising",
    "expected more than the class before, {before}, got {value}",
    before=Number(),
    value=Number(),
)
EVEN_SIDE = define("settings.even_side", "expected an odd side, got {side_px}")

# The configuration.
HOST = define("settings.host", "an IP address or a host's name")
NETWORK = define("settings.network", "an IP address or a network such as 192.168.1.0/24, without host bits")
FOLDER_PATH = define("settings.folder_path", "the path of a folder, written out without ~")
FILE_PATH = define("settings.file_path", "the path of a file, written out without ~")
SHORT_PATH = define("settings.short_path", "a path of at most {bytes} bytes, {name_bytes} a name", bytes=Number())
PORT_TAKEN = define(
    "settings.port_taken",
    "expected a port of its own, got {port}, which {other} is too",
    port=Number(),
)
ONE_AXIS = define("settings.one_axis", "image_right and image_down: expected two axes, got {axis} for both")
BRAKES_TOO_LONG = define(
    "settings.brakes_too_long",
    "braking from {speed} rad/s at {deceleration} rad/s² takes {braking_s} s, and the watchdog at {watchdog_hz} Hz "
    "leaves {allowed_s} s: lower joint_speed_rad_s, or raise stop_deceleration_rad_s2",
    speed=Number(),
    deceleration=Number(),
    braking_s=Number(2),
    allowed_s=Number(2),
)
NO_STROKE_LEFT = define(
    "settings.no_stroke_left",
    "the fingers take {taken_mm} mm of an opening of {stroke_mm} mm and leave no room: check finger_offset_mm, "
    "mm_per_count and the two counts",
    stroke_mm=Number(1),
)
TLS_WITHOUT_FILES = define(
    "settings.tls_without_files", "TLS is enabled without {files}: name the PEM files or set enabled: false"
)
PASSWORD_WITHOUT_USER = define(
    "settings.password_without_user", "mqtt.password_file is given without mqtt.user: name the user that it is of"
)
TOO_FEW_BEATS = define(
    "settings.too_few_beats",
    "station_lost_after_s is {limit_s} s, and beats come every {period_s} s: expected at least three beats, so that "
    "one lost beat is no lost station",
)
NODES_NOT_DISTINCT = define(
    "settings.nodes_not_distinct", "station_node, gate_node and encoder_node have to be three different node ids"
)
HEARTBEAT_TOO_STRICT = define(
    "settings.heartbeat_too_strict",
    "heartbeat_lost_s is {limit_s} s and has to be at least twice heartbeat_s, {least_s} s: one late beat must not "
    "stop the line",
)
COUNT_TOO_STRICT = define(
    "settings.count_too_strict",
    "count_stale_s is {limit_s} s and has to be at least twice encoder_period_s, {least_s} s: one late count must not "
    "stop the line",
)
NO_MULTICAST = define(
    "settings.no_multicast",
    "channel is '{channel}' and has to be a multicast address, such as 239.74.163.2, for the interface udp_multicast",
)
NO_INTERFACE = define(
    "settings.no_interface",
    "channel is '{channel}' and has to be the name of a network interface, such as can0, for the interface socketcan",
)

# Migration of an earlier configuration.
MOVED_TWICE = define("settings.moved_twice", "is {new} now, which is there too: keep one of them, as {new}")
NO_NAMES = define("settings.no_names", "expected settings by their names")
