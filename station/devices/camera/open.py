"""Camera factory: from the settings to the driver."""

from station.devices.camera.digit import DigitCamera
from station.devices.camera.interface import Camera
from station.devices.camera.replay import ReplayCamera
from station.devices.camera.twin import TwinCamera
from station.settings.camera import CameraSettings


def camera_from(settings: CameraSettings) -> Camera:
    """Make the camera of the settings; it is not opened yet."""
    match settings.driver:
        case "digit":
            return DigitCamera(settings)
        case "replay":
            return ReplayCamera(settings)
        case "twin":
            return TwinCamera(settings)
