"""Texts of the page People."""

from hmi.web.text import define

define("people.first", "First start")
define(
    "people.first_text",
    "Nobody can log in yet. Choose the administrator and a PIN that only this person knows. There is no other access.",
)
define(
    "people.only_here",
    "The administrator's PIN can be chosen only at the station's own screen, or on its machine by the command"
    " 'station administrator'.",
)
define("people.begun", "An administrator was already chosen. Log in.")
define("people.broken", "The file of people cannot be read: {detail}")
define("people.broken_title", "Nobody can log in")
define("people.log_in", "Log in")
define("people.who", "Who are you?")
define("people.name", "Name")
define("people.role", "Role")
define("people.pin", "PIN")
define("people.new_pin", "New PIN, at least {n} digits")
define("people.old_pin", "Current PIN")
define("people.their_pin", "Their PIN")
define("people.pin_again", "The same PIN again")
define("people.own_pin", "Change my PIN")
define("people.pad", "Number pad")
define("people.erase", "Erase the last digit")
define("people.enter", "Log in")
define("people.set_up", "Set up")
define("people.save", "Save")
define("people.add", "Add or change a person")
define(
    "people.add_text",
    "If the name exists already, this person is changed. An operator's PIN has at least {few} digits, all others'"
    " at least {more}.",
)
define("people.remove", "Remove")
define("people.everybody", "People")
define("people.clean", "Lock for cleaning")
define("people.cleaning", "Locked for cleaning. The screen does not react to touch.")
define("people.wrong_pin", "Wrong PIN.")
define("people.wait", "Too many wrong PINs. Try again in {detail} s.")
define("people.pin_length", "A PIN has {detail} to 12 digits.")
define("people.pin_simple", "This PIN is too easy to guess. Do not use repeated or consecutive digits.")
define("people.pin_differs", "The two PINs are different. Type them again.")
define("people.bad_name", "A name has 1 to 40 characters, without spaces at the ends.")
define("people.bad_role", "A viewer needs no PIN.")
define("people.last_admin", "At least one administrator must remain.")
define("people.too_many", "There are too many people. Remove some.")
define("people.not_written", "It could not be saved: {detail}")
