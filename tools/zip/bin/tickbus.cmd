@echo off
rem The tickbus command, which lies in the DeviceDriver folder: plug-ins in processes of their own need it there.
"%~dp0..\DeviceDriver\tickbus.exe" %*
