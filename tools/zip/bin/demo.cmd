@echo off
rem The PLC program runs the simulated rig: three cycles, one jam, one PLC that is killed. Needs a Java runtime, version
rem 17 or newer. Options go to the demo; --help lists them. The last line is the verdict.
setlocal
cd /d "%~dp0.."
if exist demo\run\rig rmdir /s /q demo\run\rig
mkdir demo\run\rig\DeviceDriver
copy /y DeviceDriver\*.jar demo\run\rig\DeviceDriver >nul
copy /y demo\rig\*.* demo\run\rig\DeviceDriver >nul
if not defined TICKBUS_LOG set TICKBUS_LOG=error
java --enable-native-access=ALL-UNNAMED -Dtickbus.native.dir=DeviceDriver -Dtickbus.copy=true ^
    -cp "simulator/*" tickbus.machines.rig.Demo ^
    --drivers demo/run/rig/DeviceDriver --control simulator/rig.table --plc DeviceDriver/tickbus.exe ^
    --report demo/run/rig/report.txt --recording demo/run/rig/run.vcd %*
