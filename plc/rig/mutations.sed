# Changes of rig.st, each a command of sed, that the tests in examples/tests do not notice: tools/rig-mutants makes one at a time.
s/^  jam := beam_1.Q OR beam_2.Q;/  jam := beam_1.Q;/
s/^  beam_2(IN := running AND package_2,/  beam_2(IN := running AND package_1,/
s/IN := running AND package_2, PT := T#1500ms/IN := running AND package_2, PT := T#60s/
s/OVERDUE := fault_timer.Q;/OVERDUE := FALSE;/
s/IN := TRUE, PT := T#5s/IN := TRUE, PT := T#20s/
s/YOUNG := fault_timer.ET < T#50ms;/YOUNG := FALSE;/
s/YOUNG := fault_timer.ET < T#50ms;/YOUNG := fault_timer.ET < T#5ms;/
s/    2: early := complete_2;/    2: early := complete_3;/
s/complete_2 AND (fetch_timer.ET < T#50ms OR la1_bottom)/complete_2 AND FALSE/
s/complete_2 AND (fetch_timer.ET < T#50ms OR la1_bottom)/complete_2 AND fetch_timer.ET < T#50ms/
s/<> NOTHING AND NOT at_bottom;/<> NOTHING AND NOT la1_bottom;/
s/<> NOTHING AND NOT at_bottom;/<> NOTHING AND NOT la2_bottom;/
s/<> NOTHING AND NOT la2_bottom);/<> NOTHING AND FALSE);/
s/^  at_bottom := la1_bottom AND la2_bottom;/  at_bottom := la1_bottom;/
s/landed(IN := homing = LIFTS AND at_bottom,/landed(IN := homing = LIFTS,/
s/ELSIF lifts_timer.Q THEN/ELSIF FALSE THEN/
s/ELSIF wheels_timer.Q THEN/ELSIF FALSE THEN/
s/ELSIF fetch_timer.Q THEN/ELSIF FALSE THEN/
s/ELSIF bring_timer.Q THEN/ELSIF FALSE THEN/
s/AND home_1 AND home_2, PT := settle/AND home_1, PT := settle/
s/IF not_ok OR NOT at_bottom THEN/IF not_ok THEN/
s/      was_running := FALSE;/      was_running := TRUE;/
s/ELSIF homes AND homing = FAILED THEN/ELSIF homes AND homing = FAILED AND phase <> HOME THEN/
/ELSIF phase = READY THEN/,/ELSIF phase = RUN/s/IF not_ok THEN/IF FALSE THEN/
/ELSIF homing_before = LIFTS/,/ELSIF homing_before = LET_GO/s/      homing := ACKNOWLEDGE;/      homing := FAILED;/
s/done_6(CLK := running AND drum.ACTIVE = 6 AND complete_6);/done_6(CLK := running AND drum.ACTIVE = 6);/
s/drum.ACTIVE = 4 AND complete_4);/drum.ACTIVE = 4 AND complete_4 AND NOT package_2);/
s/reset_edge(CLK := reset_button);/reset_edge(CLK := reset_button AND NOT not_ok);/
s/      fault_stands := TRUE;/      fault_stands := FALSE;/
s/  IF NOT alive THEN/  IF FALSE THEN/
