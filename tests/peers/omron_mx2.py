"""Runs a motor by pymx2, a driver for the real inverter Omron MX2, which is used as it is published.

omron_mx2.py DEVICE LATENCY

The last line has the frequencies that the inverter showed on its way.
"""

import sys
import time

from mx2 import MX2
from mx2.enums import Coil, InverterStatus, MainProfileParameters, ModbusRegisters, MonitoringFunctions
from mx2.exceptions import MX2Exception, NoResponseException

PATIENCE = 30


class Patient:
    """The driver, whose calls are made again where a busy computer was too late: it has one fixed time for each answer."""

    def __init__(self, drive):
        self.drive = drive

    def __getattr__(self, name):
        call = getattr(self.drive, name)

        def patiently(*arguments):
            for _ in range(5):
                try:
                    return call(*arguments)
                except NoResponseException:
                    time.sleep(1)
                    # Else the late answer would be read as that of the next request.
                    self.drive._ser.reset_input_buffer()
            return call(*arguments)

        return patiently


def until(what, done):
    limit = time.monotonic() + PATIENCE
    while not done():
        if time.monotonic() > limit:
            sys.exit(f"in vain until {what}")


def main():
    drive = MX2(sys.argv[1], 9600)
    # It reads what is there after this many milliseconds, and a busy computer answers later than the real inverter.
    drive.latency_time = int(sys.argv[2])
    drive.open()
    drive = Patient(drive)

    def register(which):
        return drive.read_registers(which, 1)[0].value

    def coil(which):
        return drive.read_coil_status(which, 1)[0].value

    def frequency():
        return register(MonitoringFunctions.OutputFrequency) / 100

    until("it is ready", lambda: coil(Coil.InverterReady))
    until("it stands", lambda: register(ModbusRegisters.InverterStatusA) == 2)
    assert register(MainProfileParameters.AccelerationTime1) == 1000
    drive.write_in_register(MainProfileParameters.F001, 1000)
    assert register(MainProfileParameters.F001) == 1000
    drive.write_in_coil(Coil.OperationCommand, True)
    until("it accelerates", lambda: register(ModbusRegisters.InverterStatusC) == InverterStatus.Accelerating)
    seen = []

    def is_there():
        seen.append(frequency())
        return coil(Coil.ConstantSpeedReached)

    until("it has its speed", is_there)
    assert frequency() == 10.0, frequency()
    assert register(ModbusRegisters.InverterStatusA) == 3
    assert register(MonitoringFunctions.RotationDirection) == 1
    assert seen == sorted(seen) and len(set(seen)) > 3, seen

    drive.write_in_coil(Coil.ExternalTrip, True)
    until("it trips", lambda: coil(Coil.Alarm))
    assert register(ModbusRegisters.InverterStatusB) == 2
    assert drive.read_fault_monitor(1, 0).value == 12, "by an external trip"
    drive.write_in_coil(Coil.ExternalTrip, False)
    drive.write_in_coil(Coil.TripReset, True)
    drive.write_in_coil(Coil.TripReset, False)
    until("it is reset", lambda: not coil(Coil.Alarm))
    until("it has its speed again", lambda: coil(Coil.ConstantSpeedReached))

    drive.write_in_coil(Coil.OperationCommand, False)
    until("it has stopped", lambda: coil(Coil.ZeroHzDetection))

    # What the manual has as read-only, and what the inverter does not have.
    for refused in (
        lambda: drive.write_in_register(MonitoringFunctions.OutputCurrent, 1),
        lambda: drive.write_in_coil(Coil.InverterReady, True),
        lambda: drive.read_registers(MonitoringFunctions.D030, 1),
    ):
        try:
            refused()
        except MX2Exception as error:
            seen_error = type(error).__name__
            assert seen_error == "FunctionNotFoundException", seen_error
        else:
            sys.exit("not refused")
    drive.save_settings_to_eeprom()
    drive.close()
    print(f"omron_mx2: ok {' '.join(map(str, sorted(set(seen))))}")


main()
