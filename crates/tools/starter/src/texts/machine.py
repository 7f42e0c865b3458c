"""{{name}}: the simulated machine."""

import tickbus

with tickbus.open("driver.cfg") as plc:
{{signals}}    for number, turn in enumerate(plc.every("10ms")):
        status = plc.receive(turn.time)  # FRESH, UNCHANGED or STALE
{{model}}        plc.send()  # the PLC is answered within the turn
        if number % 100 == 0:
            print({{shown}}, flush=True)
