"""Texts of refusals."""

from hmi.texts.text import define

define("problem.title", "This could not be done")
define("problem.not_found", "There is no such page.")
define("problem.not_allowed", "This asks for the role {role}. Log in and try again.")
define(
    "problem.forged",
    "The order does not come from a page of this browser, or the station's pages were restarted. Load the page "
    "anew and try again.",
)
define("problem.replayed", "This order was sent already; it is not carried out twice.")
define("problem.old", "The page was open for too long. Load it anew and try again.")
define("problem.bad_form", "What was sent is not complete, or not what was expected.")
define("problem.too_many", "Too many pages are open. Close some.")
define(
    "problem.no_answer",
    "The station gave no answer in time. Whether the order was carried out is to be seen at its state.",
)
define("problem.refused", "The station refused:")
define("problem.broken", "The pages have run into a fault of their own, which is in their log. The station goes on.")
