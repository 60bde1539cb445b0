"""Texts of the page Set-up."""

from hmi.web.text import define, define_plural

define("setup.tab", "Set-up")
define("setup.lead", "From a fresh installation to the first fruit. The station itself decides what is done.")
define_plural("setup.progress", "{done} of {n} step is done.", "{done} of {n} steps are done.", "n")
define("setup.complete", "The set-up is complete. The acceptance test of the commissioning guide is next.")
define("setup.only_admin", "The set-up is shown to administrators.")
define("setup.state.done", "Done")
define("setup.state.next", "Next")
define("setup.state.open", "Can be done now")
define("setup.state.blocked", "Waits for: {steps}")
define("setup.address", "Address in the configuration:")

define("setup.step.gripper", "Gripper")
define("setup.step.arm", "Arm")
define("setup.step.camera", "Camera")
define("setup.step.plc", "PLC")
define("setup.step.poses", "Poses at the nest")
define("setup.step.zero", "Zero of the jaws")
define("setup.step.calibration", "Calibration with the ball")
define("setup.step.reference", "Untouched gel")
define("setup.step.recipe", "Recipe")
define("setup.step.first", "First fruit")

define("setup.how.gripper", "Power it and connect it at this address, or change the address and restart the station.")
define("setup.how.arm", "Power it and set it to remote control, or change the address and restart the station.")
define("setup.how.camera", "Plug it in, or change its serial number and restart the station.")
define(
    "setup.how.plc",
    "Connect the PLC to this address, and let its program change the heartbeat. The configuration has to permit the"
    " PLC's address.",
)
define(
    "setup.how.poses",
    "The poses are the simulated arm's. Move the arm on the pendant, in local control and at reduced speed, to home,"
    " above the nest and to the nest. Write the joint positions of each into the configuration.",
)
define("setup.joints", "Joint positions now, in rad:")
define(
    "setup.how.zero",
    "Close the fingers by steps of 1 mm until gel and sponge just touch. The width has to be 0.0 mm: add what it shows"
    " to finger_offset_mm in the configuration. The calibration then measures what is left.",
)
define("setup.width", "Width now:")
define("setup.zero_off", "The calibration found the zero off by {mm} mm.")
define("setup.how.calibration", "Set manual mode, clean the gel, put the ball into its holder, and calibrate.")
define(
    "setup.how.reference",
    "The calibration stores an image of the untouched gel, with which each fruit's reference is compared.",
)
define("setup.reference_stored", "An image of the untouched gel is stored.")
define("setup.how.recipe", "Choose the fruit. Recipes that are not approved are on the page Recipes.")
define("setup.how.first", "Set production mode, start the station, put a fruit into the nest, and let the PLC trigger.")
define("setup.first_fruit", "Fruit {n}")
define("setup.taught", "The poses are the site's own.")
define("setup.taught_simulated", "The arm is simulated: the default poses are right.")
define("setup.heard", "The PLC is connected and its heartbeat moves.")
