"""Prints pyprofibus's reading of a GSD file and the modules in its slots.

profibus_gsd.py GSD MODULE...
"""

import sys

from pyprofibus.gsd.interp import GsdInterp

gsd = GsdInterp.fromFile(sys.argv[1])
if gsd.isModular():
    gsd.clearConfiguredModules()
    for name in sys.argv[2:]:
        gsd.setConfiguredModule(name)
print(f"ident {gsd.getIdentNumber():04x}")
config = b""
for element in gsd.getCfgDataElements():
    config += bytes([element.identifier]) + bytes(element.lengthBytes)
print(f"config {config.hex()}")
for baud in [9600, 19200, 45450, 93750, 187500, 500000]:
    wait = gsd.getMaxTSDR(baud)
    if wait is not None:
        print(f"tsdr {baud} {wait}")
print(f"parameters {gsd.getUserPrmData().hex()}")
