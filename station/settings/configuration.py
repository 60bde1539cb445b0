"""The station's configuration: defaults, then `station.yaml`, then the environment."""

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from pydantic import model_validator

from station.messages import settings as messages
from station.messages.message import Message
from station.settings.arm import ArmSettings
from station.settings.calibration import CalibrationSettings
from station.settings.camera import CameraSettings
from station.settings.can import CanSettings
from station.settings.earlier_settings import EARLIER
from station.settings.environment import CONFIG_VARIABLE, PLACE, named, overrides, variable
from station.settings.file_content import check_size
from station.settings.gripper import GripperSettings
from station.settings.hmi import HmiSettings
from station.settings.modbus import ModbusSettings
from station.settings.model import Settings, setting
from station.settings.network import Host, Port
from station.settings.outbox import OutboxSettings
from station.settings.paths import Folder
from station.settings.plc import HandshakeSettings
from station.settings.problems import Path as Where
from station.settings.problems import Problem, SettingsError, dotted, field_name, shortened_file
from station.settings.records import RecordsSettings
from station.settings.schema import branches, leaves, schema_of
from station.settings.service import ServiceSettings
from station.settings.validation import validated
from station.settings.yaml_loader import Document, parse_document, read_document

FILE_NAME = "station.yaml"


class MetricsSettings(Settings):
    """Addresses of the metrics and health checks, for Prometheus and supervisors."""

    host: Host = setting(
        "127.0.0.1",
        title="Address",
        description="Network address on which /metrics, /livez, /readyz and /version are served.",
        max_length=253,
    )
    port: Port = setting(
        9108,
        title="Port",
        description="TCP port of metrics and health over HTTP.",
    )


class Configuration(Settings):
    """Settings of a site: folders, addresses and devices. A recipe holds what changes with the fruit."""

    home: Folder = setting(
        Path("state"),
        title="Home folder",
        description=(
            "Folder of the station's state. A relative path in the file is relative to the file's folder, "
            "elsewhere to the working folder."
        ),
    )
    recipes_folder: Folder | None = setting(
        None,
        title="Recipe folder",
        description="Folder of the site's recipes, relative like the home folder; null uses the shipped recipes.",
    )
    modbus: ModbusSettings = setting(
        ModbusSettings(), title="Modbus TCP", description="Where the line's PLC reaches the station."
    )
    handshake: HandshakeSettings = setting(
        HandshakeSettings(), title="Handshake", description="How the PLC interface waits for the PLC and the station."
    )
    hmi: HmiSettings = setting(HmiSettings(), title="HMI", description="Where operators' browsers reach the station.")
    metrics: MetricsSettings = setting(
        MetricsSettings(), title="Metrics", description="Where Prometheus and supervisors reach the station."
    )

    arm: ArmSettings = setting(ArmSettings(), title="Arm", description="The UR10e and its poses.")
    gripper: GripperSettings = setting(GripperSettings(), title="Gripper", description="The Robotiq 2F-85.")
    camera: CameraSettings = setting(CameraSettings(), title="Camera", description="The tactile camera.")
    calibration: CalibrationSettings = setting(
        CalibrationSettings(), title="Calibration", description="The ball, and the limits of a calibration."
    )
    can: CanSettings = setting(CanSettings(), title="CAN", description="The line's reject gate and encoder.")
    records: RecordsSettings = setting(
        RecordsSettings(), title="Records", description="Storage of inspections and images."
    )
    outbox: OutboxSettings = setting(
        OutboxSettings(), title="Outbox", description="Other systems that receive inspections."
    )
    service: ServiceSettings = setting(
        ServiceSettings(), title="Service", description="How the station inspects, and its deadlines."
    )

    @model_validator(mode="after")
    def _addresses_differ(self) -> Self:
        """Refuse one address for two servers."""
        servers: dict[Where, tuple[str, int]] = {
            (name,): (getattr(self, name).host, getattr(self, name).port) for name in ("modbus", "hmi", "metrics")
        }
        if self.modbus.tls.enabled:
            servers["modbus", "tls"] = (self.modbus.host, self.modbus.tls.port)
        clashes: list[tuple[Where, Message]] = [
            ((*name, "port"), messages.PORT_TAKEN(port=address[1], other=dotted((*other, "port"))))
            for name, address in servers.items()
            for other in servers
            if other != name and servers[other] == address
        ]
        return self.accepted(*clashes)


def load_configuration(file: Path | None = None, environ: Mapping[str, str] | None = None) -> Configuration:
    """Read the configuration: defaults, overridden by the file, overridden by the environment (`environ`).

    The file is the one given; else the one that `STATION_CONFIG` names; else `station.yaml` in the home folder
    (`STATION_HOME`, or the default) where there is one. Every path in the result is absolute.

    Raises:
        SettingsError: all problems of the environment and of the file.
    """
    environ = os.environ if environ is None else environ
    chosen = configuration_file(file, environ)
    return _loaded(read_document(chosen) if chosen else Document("default", None, {}), chosen, environ)


def check_configuration(content: bytes, file: Path) -> Configuration:
    """Read a configuration as `load_configuration` would, if the file had this content.

    Raises:
        SettingsError: all problems of the environment and of the content.
    """
    check_size(content, file)
    return _loaded(parse_document(content, shortened_file(file)), file, os.environ)


def _loaded(document: Document, chosen: Path | None, environ: Mapping[str, str]) -> Configuration:
    root = schema_of(Configuration)
    given, problems = overrides(root, environ)
    merged = document.value if document.value is not None else {}
    for path, value in given.items():
        merged = _with(merged, path, value)

    def locate(path: Where) -> tuple[Message, Message]:
        name = named(path, given)
        if name:
            return PLACE, messages.FIELD(path=name)
        return document.locate(path) if chosen else (messages.DEFAULT(), field_name(path))

    merged = _anchored(merged, document, given, chosen.parent if chosen else Path())
    document = replace(document, problems=(*problems, *document.problems))
    return validated(Configuration, document, merged, locate, EARLIER)


def configuration_file(file: Path | None = None, environ: Mapping[str, str] | None = None) -> Path | None:
    """Return the file that `load_configuration` reads, or None for none; the arguments are the same.

    Raises:
        SettingsError: the environment names none.
    """
    environ = os.environ if environ is None else environ
    if file is not None:
        return file
    if CONFIG_VARIABLE in environ:
        if not environ[CONFIG_VARIABLE]:
            expected = messages.EXPECTED(wanted=messages.FILE_PATH(), found=messages.NOTHING())
            raise SettingsError([Problem(PLACE, messages.FIELD(path=CONFIG_VARIABLE), expected)])
        return Path(environ[CONFIG_VARIABLE])
    in_home = Path(environ.get(variable(("home",)), Configuration().home)) / FILE_NAME
    return in_home if os.path.lexists(in_home) else None


def _with(values: Any, path: Where, value: Any) -> Any:
    """Return plain values with one more; a section that is no mapping is left, to be refused as it is."""
    if not path:
        return value
    if not isinstance(values, dict):
        return values
    return {**values, path[0]: _with(values.get(path[0], {}), path[1:], value)}


def _anchored(values: Any, document: Document, given: Mapping[Where, Any], folder: Path) -> Any:
    """Return plain values with every path absolute: the file's from its folder, others from the working folder."""
    root = schema_of(Configuration)
    for leaf in leaves(root):
        if all(branch.get("format") != "path" for branch in branches(leaf.node, root)):
            continue
        in_file = leaf.path in document.lines and leaf.path not in given
        text = _at(values, leaf.path) if in_file or leaf.path in given else leaf.node.get("default")
        if text and isinstance(text, str) and not text.startswith("~"):
            values = _with(values, leaf.path, str(Path(folder if in_file else "", text).absolute()))
    return values


def _at(values: Any, path: Where) -> Any:
    """Return the value of a field, or None for none."""
    for part in path:
        values = values.get(part) if isinstance(values, dict) else None
    return values
