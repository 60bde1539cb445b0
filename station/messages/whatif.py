"""Messages of the what-if: why a draft's result is not known, and what is wrong with its input."""

from station.messages.message import Number, define

# Why the draft's outcome of an inspection is not known.
OLD_RECIPE = define("whatif.old_recipe", "this version does not accept the inspection's own recipe")
PRESSES_OTHERWISE = define("whatif.presses_otherwise", "the draft presses otherwise ({fields})")
FIRST_IMAGES_NOT_KEPT = define(
    "whatif.first_images_not_kept",
    "the draft measures otherwise, and of a fruit that was pressed twice the first images are not kept",
)
IMAGES_NOT_KEPT = define("whatif.images_not_kept", "the draft measures otherwise, and not all of its images were kept")
OTHER_ONSET = define(
    "whatif.other_onset", "the draft finds another onset than the stored one, so its steps would be others"
)
OTHER_PROGRAM = define(
    "whatif.other_program", "its images do not give its stored areas: they were measured by another program"
)
NO_SCALE = define("whatif.no_scale", "no stored point has an area, so the scale of its images is not known")
DAMAGED_IMAGE = define("whatif.damaged_image", "one of its images is damaged")
ANOTHER_PRESS = define("whatif.another_press", "the draft would have pressed the fruit once more")
CLOSES_FURTHER = define("whatif.closes_further", "nothing was touched, and the draft would have closed further")
CURVE_ENDS = define(
    "whatif.curve_ends",
    "the curve ends at {reached_mm} mm of closing, and the draft would have pressed on",
    reached_mm=Number(1),
)
CURVE_STOPPED = define(
    "whatif.curve_stopped",
    "the curve ends at {reached_mm} mm of closing, where it was stopped early, and the draft would have pressed on",
    reached_mm=Number(1),
)

# The table of marks.
UNREADABLE = define("whatif.unreadable", "{path}: cannot be read: {words}")
NOT_UTF8 = define("whatif.not_utf8", "{path}: expected UTF-8; save the table as CSV UTF-8")
TOO_LARGE = define("whatif.too_large", "{path}: expected at most {most} bytes", most=Number(0))
NO_HEADER = define("whatif.no_header", "{path}:1: expected the header sequence,mark")
MARKED_TWICE = define("whatif.marked_twice", "{place}: {number} is marked good and bad", number=Number(0))
NO_TABLE = define("whatif.no_table", "{place}: not a CSV table: {words}")
BAD_NUMBER = define("whatif.bad_number", "{place}: sequence: expected an inspection's number, got {text}")
BAD_MARK = define("whatif.bad_mark", "{place}: mark: expected good or bad, got {text}")

# Where results are stored, and who computes them.
OUT_NOT_WRITABLE = define("whatif.out_not_writable", "--out {folder}: cannot be written: {words}")
OTHER_DRAFT = define(
    "whatif.other_draft", "--out {folder}: it holds the results of another draft or version; give another folder"
)
RESULTS_NOT_WRITTEN = define(
    "whatif.results_not_written", "{path}: {words}; free space, and the same command continues"
)
NO_WORKERS = define(
    "whatif.no_workers", "--scheduler {address}: it has no workers; start some with `dask worker {address}`"
)
PROCESS_ENDED = define(
    "whatif.process_ended",
    "a process of the what-if was ended from outside, perhaps for want of memory; the same command continues where it "
    "was, with --jobs 1 in this process alone",
)
