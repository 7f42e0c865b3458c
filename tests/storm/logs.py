"""The lines that the ends may log, and the cause of each. Any other line is a finding."""

import re

# Misfortunes that silence an end for its peer.
SILENT = {"stopped", "killed", "terminated", "cut", "second", "paused", "stalled", "dispatcher killed", "dispatcher stopped"}
DISPATCHER = {"dispatcher killed", "dispatcher stopped"}
# Lines end in disorder when an end ends, which happens in every line of the storm.
ALWAYS = set()
DEATHS = {"killed", "terminated", "second", "cut", "stopped"}

# The states of a line, in the words of the driver and of the command, and the misfortunes that cause them.
STATE = r'^(?:driver "\w+" is|mirror:|plc:|\[[^]]* WARN +tickbus_fieldbus::link\] driver "\w+" is) '
KNOWN = [
    (STATE + r"(opening|running): (opening the line|beginning to listen on|listening on|connecting to|connected with|polling|waiting|joined|the PLC) ?", ALWAYS),
    (STATE + r"running: serving ", ALWAYS),
    (STATE + r"opening: \S+ has connected; waiting for its first (record|telegram)", ALWAYS),
    (STATE + r"(stale|opening|failed): nothing has come from ", SILENT),
    (STATE + r"(opening|failed): the peer left: (the dispatcher at )?\S+ closed the connection; (listening on|next attempt|if it )", ALWAYS),
    (STATE + r"failed: the peer left: \S+ closed the connection when it was asked who it is", DEATHS),
    (STATE + r"failed: the link failed: cannot connect to \S+ \(Connection refused", ALWAYS),
    (STATE + r"failed: the link failed: cannot connect to \S+ \((Network is unreachable|No route to host|.*timed out)", {"cut"}),
    (STATE + r"(opening|failed): the link failed: \S+ has (been silent|not answered) for ", SILENT),
    (STATE + r"(opening|failed): the link failed: the connection with \S+ broke (in the middle of a record: .* )?\((Connection timed out|No route|Network is)", {"cut"}),
    (STATE + r"(opening|failed): the link failed: the connection with \S+ broke (in the middle of a record: .* )?\((Connection reset|Broken pipe)", DEATHS),
    # A newcomer is turned away while another one is served, and a server that is not the only one gets no port.
    (STATE + r"(opening|failed): the peer left: \S+ closed the connection( before it had sent anything)?; if it serves", DEATHS),
    (STATE + r"failed: .*Address already in use", {"second"}),
    (r"^(mirror|plc): failed reason=the line never ran: .*", {"second"}),
    (r'driver "\w+": \S+ was turned away, since one client is served at a time', DEATHS),
    (STATE + r"(opening|failed): the link failed: \S+ has been silent for \S+ \S+ takes its place", DEATHS),
    (STATE + r"(opening|failed|stale): the link failed: unit \d+ of \S+, asked to .*, did not answer within ", SILENT),
    (r'^(\[[^]]* WARN [^]]*\] )?driver "\w+": .+ writes what .+ wrote less than ', DEATHS),
    (STATE + r"opening: refused: unit \d+ of \S+ refused to write .* \(server device busy\)", DEATHS),
    (STATE + r"failed: refused: \S+ refuses writing .* access is not allowed \(code 0x03\)", DEATHS),
    # OPC UA, and the dispatcher.
    (STATE + r"(opening: asking|opening: opening a session with|running: in session with) ", ALWAYS),
    (STATE + r"(failed|opening): the peer left: the (server|last client) closed (the|its) session", ALWAYS),
    # The server ends in the middle of a greeting.
    (STATE + r"failed: the protocol was broken: \S+ does not answer as an OPC UA server \(BadConnectionClosed", DEATHS),
    (STATE + r"opening: the peer left: no input has a source any more", ALWAYS),
    (STATE + r"failed: the link failed: the connection with the dispatcher at \S+ broke \(Connection reset", DISPATCHER | {"cut"}),
    (STATE + r"failed: refused: the dispatcher has another client ", DEATHS | DISPATCHER),
    # A second writer, which was refused, cannot leave its fail-safe values behind; neither can one that is cut off.
    (r"closes, and the peer has not confirmed the fail-safe values within ", DEATHS | DISPATCHER),
    # Recordings.
    (r"the recording ended with tick \d+ of the file: No space left on device", {"small disk"}),
    (r": (process \d+|another process) records to this file, or replays it; name another file", {"second"}),
    # The output of Python and FMPy about it.
    (r"^(Traceback \(most recent call last\):|  File .*|    .*)$", {"second"}),
    (r"the server does not take the value of \"\w+\" \(BadUserAccessDenied", DEATHS),
    (r"^  correct the lines named in the message; `tickbus check FILE`", {"second"}),
    (r"^\tat (tickbus\.Tickbus|End\.main)", {"second"}),
    # The last output of the command.
    (r"^(mirror|plc): ok ", ALWAYS),
]


def unexplained(text, befallen):
    """The unexplained lines of a log."""
    found = []
    for line in text.splitlines():
        causes = [causes for pattern, causes in KNOWN if re.search(pattern, line)]
        if line.strip() and not any(not each or befallen & each for each in causes):
            found.append(line)
    return found
