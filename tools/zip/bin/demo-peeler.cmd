@echo off
rem Two PLC programs peel blocks on the simulated peeling line. Needs a Java runtime, version 17 or newer. Options go to
rem the demo; --help lists them. The last line is the verdict.
setlocal
cd /d "%~dp0.."
if exist demo\run\peeler rmdir /s /q demo\run\peeler
mkdir demo\run\peeler\DeviceDriver
copy /y DeviceDriver\*.jar demo\run\peeler\DeviceDriver >nul
copy /y demo\peeler\*.* demo\run\peeler\DeviceDriver >nul
if not defined TICKBUS_LOG set TICKBUS_LOG=error
java --enable-native-access=ALL-UNNAMED -Dtickbus.native.dir=DeviceDriver -Dtickbus.copy=true ^
    -cp "simulator/*" tickbus.machines.peeler.PeelingDemo ^
    --drivers demo/run/peeler/DeviceDriver --control simulator/peeler.table --plc DeviceDriver/tickbus.exe ^
    --report demo/run/peeler/report.txt --recordings demo/run/peeler %*
