"""Messages about any device: its name, and that it has not answered yet."""

from station.messages.message import Nested, define

ARM = define("device.arm", "arm")
CAMERA = define("device.camera", "camera")
GRIPPER = define("device.gripper", "gripper")

NO_ANSWER_YET = define("device.no_answer_yet", "{device}: it has not answered yet; wait a moment", device=Nested())
