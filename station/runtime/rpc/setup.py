"""Facts for the guided first set-up: addresses, taught poses, the jaws' zero, calibration."""

from station.channel.panel_run import SetupView
from station.runtime.devices.manager import ARM, CAMERA, GRIPPER, DeviceManager
from station.runtime.imaging.golden_reference import GOLDEN
from station.settings.arm import ArmPoses, ArmSettings
from station.settings.camera import CameraSettings
from station.settings.configuration import Configuration
from station.settings.gripper import GripperSettings

PLC = "plc"


def setup_view(configuration: Configuration, devices: DeviceManager) -> SetupView:
    """Return the facts now."""
    calibration, golden = devices.calibration.calibration, devices.calibration.golden()
    modbus, arm, joints_rad = configuration.modbus, configuration.arm, devices.joints_rad
    addresses = {
        GRIPPER: _gripper_address(configuration.gripper),
        ARM: arm.host,
        CAMERA: _camera_address(configuration.camera),
        PLC: f"{modbus.host}:{modbus.port}",
    }
    return SetupView(
        addresses={name: address for name, address in addresses.items() if name == PLC or name in devices.monitors},
        poses_taught=_are_taught(arm),
        joints_rad=joints_rad and tuple(round(each, 4) for each in joints_rad),
        width_mm=devices.width_mm(),
        calibration=None if calibration is None else calibration.summary(),
        zero_mm=None if calibration is None else calibration.zero_mm,
        has_reference=(golden or configuration.home / GOLDEN).is_file(),
        ball_recipe=configuration.calibration.recipe,
    )


def _are_taught(arm: ArmSettings) -> bool:
    """Check whether the poses at the nest are the site's own; the simulated arm's are the defaults."""
    usual = ArmPoses()
    own = arm.poses.nest != usual.nest and arm.poses.above_nest != usual.above_nest
    return own or arm.host.startswith("127.")


def _gripper_address(gripper: GripperSettings) -> str:
    if gripper.driver == "urcap":
        return f"{gripper.urcap.host}:{gripper.urcap.port}"
    rtu = gripper.modbus_rtu
    return rtu.serial_port if rtu.line == "serial" else f"{rtu.host}:{rtu.port}"


def _camera_address(camera: CameraSettings) -> str:
    match camera.driver:
        case "digit":
            return f"DIGIT {camera.digit.serial}"
        case "twin":
            return f"{camera.twin.host}:{camera.twin.port}"
        case "replay":
            return camera.replay.source
