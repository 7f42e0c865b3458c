"""The lines that the ends may log, and what causes each. Any other line is a finding."""

import re

# Pattern, and what has to have befallen the line for it: "" for nothing.
KNOWN = [
]


def unexplained(text, befallen):
    """The lines of a log that nothing explains."""
    found = []
    for line in text.splitlines():
        if not line.strip():
            continue
        causes = [causes for pattern, causes in KNOWN if re.search(pattern, line)]
        if not any(not each or befallen & set(each) for each in causes):
            found.append(line)
    return found
