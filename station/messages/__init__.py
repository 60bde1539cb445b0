"""Everything the station can say; one module for each room that says it. Importing the package defines all of it."""

from station.messages import arm, camera, channel, device, grip, gripper, judge, message, reasons, records, whatif

__all__ = ["arm", "camera", "channel", "device", "grip", "gripper", "judge", "message", "reasons", "records", "whatif"]
