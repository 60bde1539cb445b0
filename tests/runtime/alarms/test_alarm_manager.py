"""The alarm manager: a cause that stays, and what is found about it."""

from station.inspection.alarm_table import AlarmId
from station.messages.operation import INTERFACE_SILENT
from station.runtime.alarms.manager import AlarmManager
from station.runtime.observability.metrics import Metrics


def test_a_later_finding_is_the_alarms_detail_and_no_second_alarm():
    manager = AlarmManager(Metrics("0", 1.0))
    for age_s in (2.0, 3.0):
        manager.update(AlarmId.PLC_INTERFACE_LOST, INTERFACE_SILENT(age_s=age_s))
    alarm = manager.alarms.get(AlarmId.PLC_INTERFACE_LOST)
    assert alarm.detail == INTERFACE_SILENT(age_s=3.0)
    assert alarm.raised == 1
    manager.update(AlarmId.PLC_INTERFACE_LOST, None)
    assert alarm.id not in [each.id for each in manager.alarms.active]
