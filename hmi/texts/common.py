"""Texts of several pages."""

from hmi.texts.text import define, define_plural

define("common.older", "Older")
define_plural("common.days", "{n} day", "{n} days", "n")
define(
    "common.why_area_over_limit",
    "The contact area was not safely below the recipe's limit at one of its closings.",
)
define("common.why_growth_over_limit", "The contact area grew faster than the recipe's limit.")
define("common.why_early_stop", "The steps ended early to spare the fruit.")
define("common.why_no_contact", "The gripper closed without touching a fruit.")
define("common.why_contact_lost", "The contact was lost while the gripper closed.")
define("common.why_area_not_rising", "The contact area did not rise with the closing, so it cannot be trusted.")
define("common.why_cut_by_border", "The contact reached beyond the image.")
define("common.why_saturated", "The image was saturated.")
define("common.why_low_confidence", "The contact was found with too little confidence.")
define("common.why_reference_bad", "No good reference image could be taken.")
define("common.why_image_stale", "The camera gave no image that was new enough.")
define("common.why_out_of_range", "The fruit's width is outside the recipe's range.")
define("common.why_late", "The inspection was not done by its deadline.")
define("common.why_called_off", "The inspection was aborted.")
define("common.why_arm_fault", "The arm had a fault.")
define("common.why_gripper_fault", "The gripper had a fault.")
define("common.why_camera_fault", "The camera had a fault.")
define("common.why_records_fault", "The records could not be written.")
define("common.why_station_lost", "The station restarted before the PLC had certainly received the outcome.")
define("common.why_internal_fault", "The program had an internal fault.")
define("common.why_near_limit", "The area or its growth is too near a limit for the uncertainty of the measurement.")
define("common.why_size_unknown", "The recipe needs the fruit's size, and the PLC gave no valid one.")
