"""Texts of refusals."""

from hmi.texts.text import define

define("problem.title", "This was not possible")
define("problem.not_found", "This page does not exist.")
define("problem.not_allowed", "This needs the role {role}. Log in and try again.")
define(
    "problem.forged",
    "The command was not sent from a page of this browser, or the station's pages were restarted. Reload the page"
    " and try again.",
)
define("problem.replayed", "This command was already sent; it is not carried out twice.")
define("problem.old", "The page was open for too long. Reload it and try again.")
define("problem.bad_form", "The data sent is incomplete or invalid.")
define("problem.too_many", "Too many pages are open. Close some.")
define(
    "problem.no_answer",
    "The station did not answer in time. Its state shows whether the command was carried out.",
)
define("problem.refused", "The station refused:")
define("problem.broken", "The pages had an internal fault; their log has the details. The station continues.")
